#include "bake-server/blobs/blob_store.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

namespace lightloom {
namespace fs = std::filesystem;
namespace {

constexpr size_t kPiece = size_t{1} << 20;

absl::Status failed(const fs::path& path, const char* what) {
  const std::string reason = std::string("cannot ") + what + " " + path.string() + ": " + std::strerror(errno);
  return errno == ENOSPC || errno == EDQUOT ? absl::ResourceExhaustedError(reason + "; free space there")
                                            : absl::UnavailableError(reason);
}

/// A file descriptor, closed at the end.
class File {
 public:
  File(const fs::path& path, int flags) : descriptor_(::open(path.c_str(), flags | O_CLOEXEC, 0644)) {}
  ~File() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  bool is_open() const { return descriptor_ >= 0; }
  int get() const { return descriptor_; }

 private:
  int descriptor_;
};

absl::StatusOr<std::vector<uint8_t>> read_at(const File& file, const fs::path& path, uint64_t offset, uint64_t most) {
  std::vector<uint8_t> out(most);
  size_t done = 0;
  while (done < out.size()) {
    const ssize_t n = ::pread(file.get(), out.data() + done, out.size() - done, static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return failed(path, "read");
    if (n == 0) break;
    done += static_cast<size_t>(n);
  }
  out.resize(done);
  return out;
}

absl::StatusOr<Digest> digest_of(const fs::path& path) {
  const File file(path, O_RDONLY);
  if (!file.is_open()) return failed(path, "open");
  Hasher hasher;
  for (uint64_t at = 0;;) {
    LL_ASSIGN_OR_RETURN(const auto piece, read_at(file, path, at, kPiece));
    if (piece.empty()) return hasher.finish();
    hasher.bytes(piece.data(), piece.size());
    at += piece.size();
  }
}

absl::Status write_at(const fs::path& path, uint64_t offset, std::span<const uint8_t> data) {
  const File file(path, O_WRONLY | O_CREAT);
  if (!file.is_open()) return failed(path, "open");
  size_t done = 0;
  while (done < data.size()) {
    const ssize_t n = ::pwrite(file.get(), data.data() + done, data.size() - done, static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return failed(path, "write");
    done += static_cast<size_t>(n);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<BlobStore>> BlobStore::open(const fs::path& folder, Durability durability) {
  std::error_code error;
  fs::create_directories(folder / "uploads", error);
  if (error) {
    return absl::UnavailableError("cannot make " + (folder / "uploads").string() + ": " + error.message() +
                                  "; choose another folder");
  }
  return std::unique_ptr<BlobStore>(new BlobStore(folder, durability));
}

fs::path BlobStore::path(const Digest& digest) const {
  const std::string hex = digest.hex();
  return folder_ / hex.substr(0, 2) / hex.substr(2);
}

fs::path BlobStore::part(const Digest& digest) const { return folder_ / "uploads" / digest.hex(); }

std::shared_ptr<std::mutex> BlobStore::turn(const Digest& digest) {
  const std::lock_guard lock(mutex_);
  std::erase_if(turns_, [](const auto& entry) { return entry.second.expired(); });
  auto& known = turns_[digest];
  auto mine = known.lock();
  if (!mine) known = mine = std::make_shared<std::mutex>();
  return mine;
}

bool BlobStore::has(const Digest& digest) const {
  std::error_code error;
  return fs::is_regular_file(path(digest), error);
}

absl::StatusOr<uint64_t> BlobStore::size(const Digest& digest) const {
  std::error_code error;
  const uint64_t size = fs::file_size(path(digest), error);
  if (error) return absl::NotFoundError("there is no blob " + digest.hex());
  return size;
}

absl::StatusOr<std::vector<uint8_t>> BlobStore::read(const Digest& digest, uint64_t offset, uint64_t most) const {
  const File file(path(digest), O_RDONLY);
  if (!file.is_open()) {
    if (errno == ENOENT) return absl::NotFoundError("there is no blob " + digest.hex());
    return failed(path(digest), "open");
  }
  return read_at(file, path(digest), offset, most);
}

uint64_t BlobStore::uploaded(const Digest& digest) const {
  if (const auto whole = size(digest); whole.ok()) return *whole;
  std::error_code error;
  const uint64_t size = fs::file_size(part(digest), error);
  return error ? 0 : size;
}

absl::Status BlobStore::append(const Digest& digest, uint64_t size, uint64_t offset, std::span<const uint8_t> data) {
  if (size > kMostBytes || offset > size || data.size() > size - offset) {
    return absl::InvalidArgumentError("a piece of blob " + digest.hex() + " does not lie within its size");
  }
  const auto mine = turn(digest);
  const std::lock_guard lock(*mine);
  if (has(digest)) return absl::OkStatus();
  if (uploaded(digest) > size) {  // somebody else gave another size
    std::error_code ignored;
    fs::remove(part(digest), ignored);
  }
  if (uploaded(digest) != offset) {
    return absl::AbortedError("the upload of blob " + digest.hex() + " is at byte " + std::to_string(uploaded(digest)) +
                              "; go on there");
  }
  LL_RETURN_IF_ERROR(write_at(part(digest), offset, data));
  if (offset + data.size() < size) return absl::OkStatus();

  LL_ASSIGN_OR_RETURN(const Digest found, digest_of(part(digest)));
  if (found != digest) {
    std::error_code ignored;
    fs::remove(part(digest), ignored);
    return absl::DataLossError("blob " + digest.hex() + " arrived with other bytes; send it again");
  }
  return commit(part(digest), digest);
}

absl::Status BlobStore::commit(const fs::path& temporary, const Digest& digest) const {
  std::error_code error;
  fs::create_directories(path(digest).parent_path(), error);
  if (durability_ == Durability::kPowerLoss) return commit_file(temporary, path(digest));
  fs::rename(temporary, path(digest), error);
  if (!error) return absl::OkStatus();
  return absl::UnavailableError("cannot rename " + temporary.string() + ": " + error.message());
}

absl::StatusOr<Digest> BlobStore::put(std::span<const uint8_t> bytes) {
  const Digest digest = sha256(bytes);
  if (has(digest)) return digest;
  const fs::path temporary = temporary_beside(part(digest));
  LL_RETURN_IF_ERROR(write_at(temporary, 0, bytes));
  LL_RETURN_IF_ERROR(commit(temporary, digest));
  return digest;
}

}  // namespace lightloom
