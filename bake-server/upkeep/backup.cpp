#include "bake-server/upkeep/backup.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <functional>
#include <memory>
#include <system_error>
#include <vector>

#include "bake-server/blobs/blob_store.h"
#include "bake-server/store/copy_tables.h"
#include "bake-server/store/postgres_store.h"
#include "bake-server/store/sql_upkeep.h"
#include "bake-server/store/sqlite_store.h"
#include "bake-server/upkeep/upkeep_lock.h"
#include "core/base/file.h"
#include "core/base/parse_size.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kPiece = uint64_t{1} << 20;  // that is read at a time

absl::Status failed(const char* what, const fs::path& path, const std::string& reason) {
  return absl::UnavailableError(
      absl::StrCat("cannot ", what, " ", path.string(), ": ", reason, "; check that disk and its permissions"));
}

absl::Status check_target(const fs::path& state, const fs::path& to) {
  std::error_code error;
  const fs::path within = fs::weakly_canonical(to, error).lexically_relative(fs::weakly_canonical(state, error));
  if (!error && !within.empty() && *within.begin() != "..") {
    return absl::FailedPreconditionError(absl::StrCat("cannot back up to ", to.string(),
                                                      ": it lies in the state folder ", state.string(),
                                                      ": name a folder outside of it"));
  }
  if (!fs::exists(fs::symlink_status(to, error))) return absl::OkStatus();
  if (fs::is_directory(fs::symlink_status(to, error)) && fs::is_empty(to, error) && !error) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("cannot back up to ", to.string(), ": it is there already: name a new folder"));
}

/// Waits until all that was written on the path's file system is on the disk.
absl::Status sync_file_system(const fs::path& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return failed("open", path, std::strerror(errno));
  absl::Status status = ::syncfs(fd) == 0 ? absl::OkStatus() : failed("sync", path, std::strerror(errno));
  ::close(fd);
  return status;
}

/// Removed at the end, unless it was renamed.
class Draft {
 public:
  explicit Draft(const fs::path& target) : path_(temporary_beside(target)) {}
  ~Draft() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Draft(const Draft&) = delete;
  Draft& operator=(const Draft&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

absl::Status copy_blob(const Digest& digest, uint64_t size, const BlobStore& from, BlobStore* to) {
  uint64_t at = 0;
  do {
    LL_ASSIGN_OR_RETURN(const auto piece, from.read(digest, at, kPiece));
    if (piece.empty() && size > 0) return absl::DataLossError("blob " + digest.hex() + " is cut; check that disk");
    LL_RETURN_IF_ERROR(to->append(digest, size, at, piece));
    at += piece.size();
  } while (at < size);
  return absl::OkStatus();
}

/// NotFound, DataLoss: it is missing or damaged.
absl::Status add_blob(const Digest& digest, const fs::path& state, const BlobStore& from, const fs::path& draft,
                      BlobStore* to, Backup* backup) {
  const BlobLayout source(state / "blobs"), copy(draft / "blobs");
  LL_ASSIGN_OR_RETURN(const uint64_t size, from.size(digest));
  std::error_code error;
  fs::create_directories(copy.blob(digest).parent_path(), error);
  if (error) return failed("make", copy.blob(digest).parent_path(), error.message());
  if (::link(source.blob(digest).c_str(), copy.blob(digest).c_str()) == 0) {
    ++backup->linked;
  } else {
    LL_RETURN_IF_ERROR(copy_blob(digest, size, from, to));
  }
  ++backup->blobs;
  backup->bytes += size;
  return absl::OkStatus();
}

/// Into a SQLite file, whatever `database` is.
using CopyDatabase = std::function<absl::Status(const fs::path& to)>;

absl::StatusOr<CopyDatabase> copier(const fs::path& state, const std::string& database) {
  if (database.empty()) {
    LL_ASSIGN_OR_RETURN(std::shared_ptr<Database> original, open_sqlite_reader(state));
    return [original](const fs::path& to) { return copy_sqlite(*original, to); };
  }
  LL_RETURN_IF_ERROR(open_postgres_reader(database).status());
  return [database](const fs::path& to) -> absl::Status {
    LL_ASSIGN_OR_RETURN(const auto copy, make_sqlite(to));
    return copy_postgres(database, *copy);
  };
}

}  // namespace

absl::StatusOr<Backup> back_up(const fs::path& state, const fs::path& target, const CancelFlag* cancel,
                               const std::string& database) {
  const fs::path to = (target / "").parent_path();  // without a slash at the end
  LL_ASSIGN_OR_RETURN(const CopyDatabase copy_database, copier(state, database));
  LL_RETURN_IF_ERROR(check_target(state, to));
  LL_ASSIGN_OR_RETURN(const UpkeepLock lock, UpkeepLock::wait(state));

  // The database first: blobs are there before it names them.
  const Draft draft(to);
  std::error_code error;
  fs::create_directories(draft.path(), error);
  if (error) return failed("make", draft.path(), error.message());
  LL_RETURN_IF_ERROR(copy_database(draft.path() / "store.db"));

  std::vector<Digest> digests;
  {
    LL_ASSIGN_OR_RETURN(const auto copy, open_sqlite_reader(draft.path()));
    LL_RETURN_IF_ERROR(visit_references(*copy, [&](const Digest& digest) {
      digests.push_back(digest);
      return true;
    }));
  }
  std::sort(digests.begin(), digests.end());
  digests.erase(std::unique(digests.begin(), digests.end()), digests.end());

  LL_ASSIGN_OR_RETURN(const auto from, BlobStore::open(state / "blobs"));
  LL_ASSIGN_OR_RETURN(const auto into, BlobStore::open(draft.path() / "blobs", Durability::kProcess));
  Backup backup;
  for (const Digest& digest : digests) {
    if (cancel != nullptr && cancel->cancelled()) return absl::CancelledError("the backup was stopped");
    const absl::Status added = add_blob(digest, state, *from, draft.path(), into.get(), &backup);
    if (absl::IsNotFound(added) || absl::IsDataLoss(added)) {
      if (backup.missing++ == 0) backup.first_missing = digest;
    } else {
      LL_RETURN_IF_ERROR(added);
    }
  }

  LL_RETURN_IF_ERROR(sync_file_system(draft.path()));
  if (::rename(draft.path().c_str(), to.c_str()) != 0) return failed("write", to, std::strerror(errno));
  LL_RETURN_IF_ERROR(sync_file_system(to));
  return backup;
}

absl::Status restore(const fs::path& from, const std::string& database) {
  LL_ASSIGN_OR_RETURN(const auto backup, open_sqlite_reader(from));
  LL_ASSIGN_OR_RETURN(const auto into, make_postgres(database));
  return copy_tables(*backup, *into);
}

std::string backup_text(const Backup& backup) {
  return absl::StrCat(backup.blobs, backup.blobs == 1 ? " blob, " : " blobs, ", size_text(backup.bytes), ", ",
                      backup.linked, " of them linked");
}

absl::Status check_whole(const Backup& backup, const fs::path& to) {
  if (backup.missing == 0) return absl::OkStatus();
  const std::string blobs =
      backup.missing == 1 ? "a blob that a job names is missing or damaged: "
                          : absl::StrCat(backup.missing, " blobs that jobs name are missing or damaged, the first is ");
  return absl::DataLossError(absl::StrCat("the backup ", to.string(), " has all else, but ", blobs,
                                          backup.first_missing.hex(), "; put it back from an earlier backup"));
}

}  // namespace lightloom
