#include "bake-server/upkeep/collect_garbage.h"

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <system_error>
#include <vector>

#include "bake-server/blobs/blob_layout.h"
#include "bake-server/upkeep/upkeep_lock.h"
#include "core/base/parse_size.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kNanoseconds = 1'000'000'000;

absl::Status failed(const char* what, const fs::path& path, int error) {
  return absl::UnavailableError(absl::StrCat("cannot ", what, " ", path.string(), ": ", std::strerror(error),
                                             "; check that disk and its permissions"));
}

std::optional<Digest> digest_of_name(const std::string& hex) {
  Digest digest;
  if (hex.size() != 2 * digest.bytes.size()) return std::nullopt;
  const std::string bytes = absl::HexStringToBytes(hex);
  std::copy(bytes.begin(), bytes.end(), digest.bytes.begin());
  if (digest.hex() != hex) return std::nullopt;
  return digest;
}

struct FileInfo {
  uint64_t bytes = 0;
  int64_t changed_ns = 0;
};

/// Of a regular file; nothing else is any of our business.
std::optional<FileInfo> look_at(const fs::path& path) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return std::nullopt;
  return FileInfo{static_cast<uint64_t>(info.st_size), info.st_mtim.tv_sec * kNanoseconds + info.st_mtim.tv_nsec};
}

/// Calls `visit` with what lies in a folder, which need not exist.
absl::Status for_each_entry(const fs::path& folder, const std::function<absl::Status(const fs::path&)>& visit) {
  std::error_code error;
  fs::directory_iterator at(folder, error);
  if (error.value() == ENOENT) return absl::OkStatus();
  for (; !error && at != fs::directory_iterator(); at.increment(error)) LL_RETURN_IF_ERROR(visit(at->path()));
  return error ? failed("list", folder, error.value()) : absl::OkStatus();
}

class Collection {
 public:
  Collection(const fs::path& state, const GarbageOptions& options, int64_t limit_ns)
      : layout_(state / "blobs"), options_(options), limit_ns_(limit_ns) {}

  absl::Status mark(const References& references) {
    LL_RETURN_IF_ERROR(references([&](const Digest& digest) {
      marked_.push_back(digest);
      return !cancelled();
    }));
    std::sort(marked_.begin(), marked_.end());
    marked_.erase(std::unique(marked_.begin(), marked_.end()), marked_.end());
    return stopped();
  }

  /// What a collection that was cut has left in the trash.
  absl::Status restore_all() {
    std::error_code error;
    fs::create_directories(layout_.trash(), error);
    if (error) return failed("make", layout_.trash(), error.value());
    return for_each_entry(layout_.trash(), [&](const fs::path& path) {
      if (const auto digest = digest_of_name(path.filename())) restore_blob(layout_, *digest);
      return absl::OkStatus();
    });
  }

  absl::Status sweep_blobs() {
    return for_each_entry(layout_.folder(), [&](const fs::path& sub) -> absl::Status {
      const std::string prefix = sub.filename();
      if (prefix.size() != 2) return absl::OkStatus();
      return for_each_entry(sub, [&](const fs::path& path) -> absl::Status {
        LL_RETURN_IF_ERROR(stopped());
        const auto digest = digest_of_name(prefix + path.filename().string());
        const auto info = look_at(path);
        if (!digest || !info) return absl::OkStatus();
        const bool old = info->changed_ns < limit_ns_ && !std::binary_search(marked_.begin(), marked_.end(), *digest);
        LL_ASSIGN_OR_RETURN(const bool gone, old ? discard(*digest, info->changed_ns) : false);
        ++(gone ? garbage_.blobs : garbage_.kept);
        (gone ? garbage_.bytes : garbage_.kept_bytes) += info->bytes;
        return absl::OkStatus();
      });
    });
  }

  absl::Status sweep_uploads() {
    return for_each_entry(layout_.uploads(), [&](const fs::path& path) -> absl::Status {
      LL_RETURN_IF_ERROR(stopped());
      const auto info = look_at(path);
      if (!info || info->changed_ns >= limit_ns_) return absl::OkStatus();
      if (!options_.dry_run && ::unlink(path.c_str()) != 0) {
        return errno == ENOENT ? absl::OkStatus() : failed("remove", path, errno);
      }
      ++garbage_.uploads;
      garbage_.bytes += info->bytes;
      return absl::OkStatus();
    });
  }

  const Garbage& garbage() const { return garbage_; }

 private:
  bool cancelled() const { return options_.cancel != nullptr && options_.cancel->cancelled(); }
  absl::Status stopped() const {
    return cancelled() ? absl::CancelledError("the collection of garbage was stopped") : absl::OkStatus();
  }

  /// False: somebody wants it.
  absl::StatusOr<bool> discard(const Digest& digest, int64_t changed_ns) const {
    if (options_.dry_run) return true;
    const fs::path from = layout_.blob(digest), to = layout_.discarded(digest);
    if (::rename(from.c_str(), to.c_str()) != 0) {
      if (errno == ENOENT) return false;  // it was found damaged, and set aside
      return failed("move", from, errno);
    }
    const auto info = look_at(to);
    if (!info) return false;  // it was put back
    if (info->changed_ns != changed_ns) {
      restore_blob(layout_, digest);
      return false;
    }
    if (::unlink(to.c_str()) == 0) return true;
    if (errno == ENOENT) return false;  // it was put back
    return failed("remove", to, errno);
  }

  const BlobLayout layout_;
  const GarbageOptions& options_;
  const int64_t limit_ns_;
  std::vector<Digest> marked_;  // sorted
  Garbage garbage_;
};

std::string count_text(uint64_t n, const char* one, const char* many) {
  return absl::StrCat(n, " ", n == 1 ? one : many);
}

}  // namespace

absl::StatusOr<Garbage> collect_garbage(const fs::path& state, const References& references,
                                        const GarbageOptions& options) {
  LL_ASSIGN_OR_RETURN(const UpkeepLock lock, UpkeepLock::take(state));
  LL_ASSIGN_OR_RETURN(const int64_t now_ns, lock.now_ns());
  Collection collection(state, options, now_ns - options.grace_seconds * kNanoseconds);
  LL_RETURN_IF_ERROR(collection.restore_all());
  LL_RETURN_IF_ERROR(collection.mark(references));
  LL_RETURN_IF_ERROR(collection.sweep_blobs());
  LL_RETURN_IF_ERROR(collection.sweep_uploads());
  return collection.garbage();
}

std::string garbage_text(const Garbage& garbage, bool dry_run) {
  return absl::StrCat(dry_run ? "would free " : "freed ", size_text(garbage.bytes), ": ",
                      count_text(garbage.blobs, "blob", "blobs"), " and ",
                      count_text(garbage.uploads, "cut upload", "cut uploads"), "; ",
                      count_text(garbage.kept, "blob stays", "blobs stay"), " (", size_text(garbage.kept_bytes), ")");
}

}  // namespace lightloom
