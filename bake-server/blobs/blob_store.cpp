#include "bake-server/blobs/blob_store.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

namespace lightloom {
namespace fs = std::filesystem;
namespace {

constexpr size_t kPiece = size_t{1} << 20;

absl::Status failed(const fs::path& path, const char* what, int error = errno) {
  const std::string reason = std::string("cannot ") + what + " " + path.string() + ": " + std::strerror(error);
  return error == ENOSPC || error == EDQUOT ? absl::ResourceExhaustedError(reason + "; free space there")
                                            : absl::UnavailableError(reason + "; check that disk and its permissions");
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
  struct stat there {};
  if (::fstat(file.get(), &there) != 0) return failed(path, "read");
  const uint64_t size = static_cast<uint64_t>(there.st_size);
  std::vector<uint8_t> out(std::min(most, size - std::min(offset, size)));
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

/// 0 if there is none.
uint64_t bytes_in(const fs::path& path) {
  std::error_code error;
  const uint64_t size = fs::file_size(path, error);
  return error ? 0 : size;
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

/// Makes the file as young as one that was just written. True: it lies there now, and collect_garbage() knows it.
bool touch(const fs::path& path) {
  const timespec times[2] = {{0, UTIME_OMIT}, {0, UTIME_NOW}};
  if (::utimensat(AT_FDCWD, path.c_str(), times, AT_SYMLINK_NOFOLLOW) != 0) return false;
  // The file may have been moved between the look-up of its name and the change of its time.
  struct stat info {};
  return ::lstat(path.c_str(), &info) == 0 && S_ISREG(info.st_mode);
}

}  // namespace

bool restore_blob(const BlobLayout& layout, const Digest& digest) {
  const fs::path from = layout.discarded(digest), to = layout.blob(digest);
  // Unlike a rename, a link leaves a younger file in peace.
  const bool linked = ::link(from.c_str(), to.c_str()) == 0 || errno == EEXIST;
  if (linked) return ::unlink(from.c_str()), true;
  return errno != ENOENT && ::rename(from.c_str(), to.c_str()) == 0;  // a file system without links
}

absl::StatusOr<std::unique_ptr<BlobStore>> BlobStore::open(const fs::path& folder, Durability durability,
                                                           CheckRoom check_room) {
  std::unique_ptr<BlobStore> store(new BlobStore(folder, durability, std::move(check_room)));
  for (const fs::path& sub : {store->layout_.uploads(), store->layout_.trash()}) {
    LL_RETURN_IF_ERROR(store->make_folder(sub));
  }
  return store;
}

absl::Status BlobStore::make_folder(const fs::path& folder) const {
  const std::lock_guard lock(mutex_);
  if (std::error_code error; made_.contains(folder) && fs::exists(folder, error)) return absl::OkStatus();
  if (durability_ == Durability::kPowerLoss) {
    LL_RETURN_IF_ERROR(make_durable_folder(folder));
  } else {
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) return failed(folder, "make", error.value());
  }
  made_.insert(folder);
  return absl::OkStatus();
}

std::shared_ptr<std::mutex> BlobStore::turn(const Digest& digest) {
  const std::lock_guard lock(mutex_);
  std::erase_if(turns_, [](const auto& entry) { return entry.second.expired(); });
  auto& known = turns_[digest];
  auto mine = known.lock();
  if (!mine) known = mine = std::make_shared<std::mutex>();
  return mine;
}

bool BlobStore::has(const Digest& digest) const {
  const fs::path path = layout_.blob(digest);
  return touch(path) || (restore_blob(layout_, digest) && touch(path));
}

absl::Status BlobStore::require(const std::vector<Digest>& digests) const {
  for (const Digest& digest : digests) {
    if (!has(digest)) return absl::InvalidArgumentError("blob " + digest.hex() + " is not here; upload it first");
  }
  return absl::OkStatus();
}

absl::StatusOr<uint64_t> BlobStore::size(const Digest& digest) const {
  std::error_code error;
  uint64_t size = fs::file_size(layout_.blob(digest), error);
  if (error && restore_blob(layout_, digest)) size = fs::file_size(layout_.blob(digest), error);
  if (error) return absl::NotFoundError("there is no blob " + digest.hex());
  return size;
}

absl::StatusOr<std::vector<uint8_t>> BlobStore::read(const Digest& digest, uint64_t offset, uint64_t most) const {
  const fs::path path = layout_.blob(digest);
  const File file(path, O_RDONLY);
  if (file.is_open()) return read_at(file, path, offset, most);
  if (errno != ENOENT) return failed(path, "open");
  if (restore_blob(layout_, digest)) return read(digest, offset, most);
  return absl::NotFoundError("there is no blob " + digest.hex());
}

absl::Status BlobStore::set_damaged_aside(const Digest& digest) {
  const auto mine = turn(digest);
  const std::lock_guard lock(*mine);
  const fs::path path = layout_.blob(digest);
  // Somebody may have put a right one there since.
  LL_ASSIGN_OR_RETURN(const Digest found, digest_of(path));
  if (found == digest) return absl::OkStatus();
  std::error_code error;
  fs::create_directories(layout_.damaged(), error);
  if (!error) fs::rename(path, layout_.damaged() / digest.hex(), error);
  return error ? failed(path, "set aside", error.value()) : absl::OkStatus();
}

uint64_t BlobStore::uploaded(const Digest& digest) const {
  return has(digest) ? size(digest).value_or(0) : bytes_in(layout_.part(digest));
}

absl::Status BlobStore::append(const Digest& digest, uint64_t size, uint64_t offset, std::span<const uint8_t> data) {
  if (size > kMostBytes || offset > size || data.size() > size - offset) {
    return absl::InvalidArgumentError("a piece of blob " + digest.hex() + " does not lie within its size");
  }
  const auto mine = turn(digest);
  const std::lock_guard lock(*mine);
  if (has(digest)) return absl::OkStatus();
  const fs::path part = layout_.part(digest);
  // What came of an upload that is refused would fill the disk, and leave no room for anything else.
  const auto drop = [&](absl::Status status) {
    std::error_code ignored;
    fs::remove(part, ignored);
    return status;
  };
  if (absl::Status room = check_room_ ? check_room_() : absl::OkStatus(); !room.ok()) return drop(std::move(room));
  uint64_t there = bytes_in(part);
  if (there > size) {  // somebody else gave another size
    (void)drop(absl::OkStatus());
    there = 0;
  }
  if (there != offset) {
    return absl::AbortedError("the upload of blob " + digest.hex() + " is at byte " + std::to_string(there) +
                              "; go on there");
  }
  if (absl::Status written = write_at(part, offset, data); !written.ok()) return drop(std::move(written));
  if (offset + data.size() < size) return absl::OkStatus();

  Digest found;
  if (data.size() == size) {
    found = sha256(data);
  } else {
    LL_ASSIGN_OR_RETURN(found, digest_of(part));
  }
  if (found != digest) {
    return drop(absl::DataLossError("blob " + digest.hex() + " arrived with other bytes; send it again"));
  }
  absl::Status made = commit(part, digest);
  if (!absl::IsNotFound(made)) return made;
  return absl::AbortedError("blob " + digest.hex() + " was long in coming and is no longer waited for; send it again");
}

absl::Status BlobStore::commit(const fs::path& temporary, const Digest& digest) const {
  const fs::path path = layout_.blob(digest);
  LL_RETURN_IF_ERROR(make_folder(path.parent_path()));
  touch(temporary);  // its last byte may have come long ago
  if (durability_ == Durability::kPowerLoss) return commit_file(temporary, path);
  std::error_code error;
  fs::rename(temporary, path, error);
  return error ? failed(temporary, "rename", error.value()) : absl::OkStatus();
}

absl::StatusOr<Digest> BlobStore::put(std::span<const uint8_t> bytes) {
  const Digest digest = sha256(bytes);
  if (has(digest)) return digest;
  const fs::path temporary = temporary_beside(layout_.part(digest));
  absl::Status status = write_at(temporary, 0, bytes);
  if (status.ok()) status = commit(temporary, digest);
  if (status.ok()) return digest;
  std::error_code ignored;
  fs::remove(temporary, ignored);
  return status;
}

}  // namespace lightloom
