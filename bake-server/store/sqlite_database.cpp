#include "bake-server/store/sqlite_database.h"

#include <absl/strings/str_cat.h>
#include <sqlite3.h>

#include <cerrno>
#include <map>
#include <utility>

#include "core/base/check.h"

namespace lightloom {

struct PreparedStatement {
  sqlite3_stmt* handle = nullptr;
  bool running = false;
};

struct Database::Impl {
  std::filesystem::path file;
  sqlite3* connection = nullptr;
  bool transaction = false;                                  // one has begun, whether or not SQLite still has it
  absl::Status undone;                                       // the error by which SQLite ended it
  std::map<std::string_view, PreparedStatement> statements;  // by their SQL; std::map keeps addresses
};

Query::Query(Query&& other) noexcept
    : database_(other.database_),
      statement_(std::exchange(other.statement_, nullptr)),
      status_(std::move(other.status_)) {}

Query::~Query() {
  if (statement_ == nullptr) return;
  // Its error, if any, was returned by step().
  sqlite3_reset(statement_->handle);
  sqlite3_clear_bindings(statement_->handle);
  statement_->running = false;
}

void Query::check(int code) {
  if (code != SQLITE_OK && status_.ok()) status_ = database_->error(code);
}

void Query::bind(int index, int64_t value) {
  if (statement_ != nullptr) check(sqlite3_bind_int64(statement_->handle, index, value));
}

// A null pointer would bind NULL, not an empty value.
void Query::bind(int index, std::string_view text) {
  if (statement_ == nullptr) return;
  const char* data = text.empty() ? "" : text.data();
  check(sqlite3_bind_text64(statement_->handle, index, data, text.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
}

void Query::bind(int index, Blob blob) {
  if (statement_ == nullptr) return;
  const char* data = blob.bytes.empty() ? "" : blob.bytes.data();
  check(sqlite3_bind_blob64(statement_->handle, index, data, blob.bytes.size(), SQLITE_TRANSIENT));
}

absl::StatusOr<bool> Query::step() {
  LL_RETURN_IF_ERROR(status_);
  const int code = sqlite3_step(statement_->handle);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  return database_->error(code);
}

int64_t Query::integer(int column) const { return sqlite3_column_int64(statement_->handle, column); }

std::string Query::bytes(int column) const {
  const void* data = sqlite3_column_blob(statement_->handle, column);
  const int size = sqlite3_column_bytes(statement_->handle, column);
  return data == nullptr ? std::string() : std::string(static_cast<const char*>(data), static_cast<size_t>(size));
}

Database::Database(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Database::~Database() {
  for (const auto& [sql, statement] : impl_->statements) sqlite3_finalize(statement.handle);
  LL_CHECK(sqlite3_close(impl_->connection) == SQLITE_OK);
}

absl::StatusOr<std::unique_ptr<Database>> Database::open(const std::filesystem::path& file, Durability durability) {
  auto impl = std::make_unique<Impl>();
  impl->file = file;
  // NOMUTEX: the owner serialises the calls.
  const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE;
  const int code = sqlite3_open_v2(file.c_str(), &impl->connection, flags, nullptr);
  std::unique_ptr<Database> database(new Database(std::move(impl)));
  if (code != SQLITE_OK) return database->error(code);
  // Nobody else writes here (the folder is locked), but a backup or a curious person may read.
  sqlite3_busy_timeout(database->impl_->connection, 5000);
  {
    Query mode = database->query("PRAGMA journal_mode=WAL");
    LL_RETURN_IF_ERROR(mode.step().status());
    if (mode.bytes(0) != "wal") {
      return absl::FailedPreconditionError(absl::StrCat(file.string(),
                                                        ": SQLite cannot keep a write-ahead log there (mode '",
                                                        mode.bytes(0), "'): choose a state folder on a local disk"));
    }
  }
  LL_RETURN_IF_ERROR(database->script("PRAGMA foreign_keys=ON"));
  LL_RETURN_IF_ERROR(
      database->script(durability == Durability::kPowerLoss ? "PRAGMA synchronous=FULL" : "PRAGMA synchronous=OFF"));
  return database;
}

absl::Status Database::script(const char* sql) {
  const int code = sqlite3_exec(impl_->connection, sql, nullptr, nullptr, nullptr);
  return code == SQLITE_OK ? absl::OkStatus() : error(code);
}

int64_t Database::last_insert_id() const { return sqlite3_last_insert_rowid(impl_->connection); }

const std::filesystem::path& Database::file() const { return impl_->file; }

Query Database::prepare(const char* sql) {
  Query query(this);
  PreparedStatement& statement = impl_->statements[sql];
  if (statement.handle == nullptr) {
    query.check(sqlite3_prepare_v3(impl_->connection, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement.handle, nullptr));
    if (!query.status_.ok()) return query;
  }
  LL_CHECK(!statement.running);
  statement.running = true;
  query.statement_ = &statement;
  return query;
}

absl::StatusOr<int64_t> Database::finish(Query& statement) {
  for (bool row = true; row;) {
    LL_ASSIGN_OR_RETURN(row, statement.step());
  }
  return sqlite3_changes64(impl_->connection);
}

absl::Status Database::error(int code) const {
  absl::Status status = in_words(code);
  if (impl_->transaction && impl_->undone.ok() && sqlite3_get_autocommit(impl_->connection) != 0) {
    impl_->undone = status;
  }
  return status;
}

absl::Status Database::in_words(int code) const {
  const std::string file = impl_->file.string();
  const std::string folder = impl_->file.parent_path().string();
  const std::string reason = impl_->connection == nullptr ? sqlite3_errstr(code) : sqlite3_errmsg(impl_->connection);
  const int system_error = impl_->connection == nullptr ? 0 : sqlite3_system_errno(impl_->connection);
  const int kind = code & 0xFF;  // extended codes hold the plain one in their low byte

  const bool no_space = system_error == ENOSPC || system_error == EDQUOT || system_error == EFBIG;
  // SQLite does not say why it could not make a file: it then tried to read it, and says why that failed.
  const bool no_file = kind == SQLITE_CANTOPEN && absl::IsResourceExhausted(check_writable(impl_->file));
  if (kind == SQLITE_FULL || (kind == SQLITE_IOERR && no_space) || no_file) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no space left for the farm's state in ", folder, " (", reason, "): free some on that disk"));
  }
  switch (kind) {
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return absl::DataLossError(absl::StrCat(file, " is damaged (", reason,
                                              "): restore the state folder from a backup, or choose an empty one"));
    case SQLITE_READONLY:
    case SQLITE_PERM:
    case SQLITE_CANTOPEN:
      return absl::PermissionDeniedError(absl::StrCat(
          "cannot write ", file, " (", reason, "): change the permissions of ", folder, ", or choose another folder"));
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return absl::UnavailableError(
          absl::StrCat(file, " is held by another process (", reason, "): end what has it open"));
    case SQLITE_CONSTRAINT:
      if (code == SQLITE_CONSTRAINT_UNIQUE || code == SQLITE_CONSTRAINT_PRIMARYKEY) {
        return absl::AlreadyExistsError(absl::StrCat(file, ": ", reason));
      }
      break;
    case SQLITE_IOERR:
      return absl::UnavailableError(
          absl::StrCat("cannot read or write ", file, " (", reason, "): check the disk that holds ", folder));
    default:
      break;
  }
  return absl::InternalError(absl::StrCat(file, ": SQLite error ", code, " (", reason, "): please report this"));
}

absl::Status Transaction::begin() {
  Database::Impl& impl = *database_.impl_;
  const bool inner = impl.transaction;
  // Some errors end a transaction: what comes after them must not be committed by itself.
  if (inner && sqlite3_get_autocommit(impl.connection) != 0) return undone();
  // IMMEDIATE: what the transaction reads must not change before it writes.
  LL_RETURN_IF_ERROR(database_.run(inner ? "SAVEPOINT inner" : "BEGIN IMMEDIATE").status());
  state_ = inner ? State::kInner : State::kOuter;
  impl.transaction = true;
  if (!inner) impl.undone = absl::OkStatus();
  return absl::OkStatus();
}

absl::Status Transaction::undone() const {
  const Database::Impl& impl = *database_.impl_;
  if (!impl.undone.ok()) return impl.undone;
  return absl::AbortedError(impl.file.string() + ": an earlier error has undone this change; try again");
}

absl::Status Transaction::commit() {
  Database::Impl& impl = *database_.impl_;
  if (sqlite3_get_autocommit(impl.connection) != 0) return undone();
  LL_RETURN_IF_ERROR(database_.run(state_ == State::kInner ? "RELEASE inner" : "COMMIT").status());
  if (state_ == State::kOuter) impl.transaction = false;
  state_ = State::kClosed;
  return absl::OkStatus();
}

Transaction::~Transaction() {
  if (state_ == State::kClosed) return;
  Database::Impl& impl = *database_.impl_;
  if (state_ == State::kOuter) impl.transaction = false;
  if (sqlite3_get_autocommit(impl.connection) != 0) return;
  sqlite3_exec(impl.connection, state_ == State::kInner ? "ROLLBACK TO inner; RELEASE inner" : "ROLLBACK", nullptr,
               nullptr, nullptr);
}

}  // namespace lightloom
