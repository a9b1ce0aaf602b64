#include "bake-server/store/sqlite_database.h"

#include <absl/strings/str_cat.h>
#include <sqlite3.h>

#include <cerrno>
#include <utility>

#include "core/base/check.h"
#include "core/base/steady_clock.h"

namespace lightloom {

/// A statement that runs; its error, if any, is what step() returns.
class SqliteDatabase::Running final : public Rows {
 public:
  Running(SqliteDatabase* database, Prepared* statement, absl::Status status)
      : database_(database), statement_(statement), status_(std::move(status)) {}
  ~Running() override {
    if (statement_ == nullptr) return;
    sqlite3_reset(statement_->handle);
    sqlite3_clear_bindings(statement_->handle);
    statement_->running = false;
  }

  absl::StatusOr<bool> step() override {
    LL_RETURN_IF_ERROR(status_);
    const int code = sqlite3_step(statement_->handle);
    if (code == SQLITE_ROW) return true;
    if (code == SQLITE_DONE) return false;
    return database_->error(code);
  }
  int64_t integer(int column) const override { return sqlite3_column_int64(statement_->handle, column); }
  std::string bytes(int column) const override {
    const void* data = sqlite3_column_blob(statement_->handle, column);
    const int size = sqlite3_column_bytes(statement_->handle, column);
    return data == nullptr ? std::string() : std::string(static_cast<const char*>(data), static_cast<size_t>(size));
  }
  int64_t changed() const override { return sqlite3_changes64(database_->connection_); }

 private:
  SqliteDatabase* const database_;
  Prepared* const statement_;
  const absl::Status status_;
};

namespace {

int bind(sqlite3_stmt* statement, int index, const Value& value) {
  if (const auto* number = std::get_if<int64_t>(&value.get())) return sqlite3_bind_int64(statement, index, *number);
  // A null pointer would bind NULL, not an empty value.
  const auto data = [](std::string_view bytes) { return bytes.empty() ? "" : bytes.data(); };
  if (const auto* text = std::get_if<std::string_view>(&value.get())) {
    return sqlite3_bind_text64(statement, index, data(*text), text->size(), SQLITE_TRANSIENT, SQLITE_UTF8);
  }
  const std::string_view bytes = std::get<Blob>(value.get()).bytes;
  return sqlite3_bind_blob64(statement, index, data(bytes), bytes.size(), SQLITE_TRANSIENT);
}

}  // namespace

SqliteDatabase::SqliteDatabase(std::filesystem::path file) : file_(std::move(file)), clock_(steady_unix_clock()) {}

SqliteDatabase::~SqliteDatabase() {
  for (const auto& [sql, statement] : statements_) sqlite3_finalize(statement.handle);
  LL_CHECK(sqlite3_close(connection_) == SQLITE_OK);
}

absl::StatusOr<std::unique_ptr<SqliteDatabase>> SqliteDatabase::open(const std::filesystem::path& file,
                                                                     Durability durability) {
  std::unique_ptr<SqliteDatabase> database(new SqliteDatabase(file));
  // NOMUTEX: the owner serialises the calls.
  const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE;
  const int code = sqlite3_open_v2(file.c_str(), &database->connection_, flags, nullptr);
  if (code != SQLITE_OK) return database->error(code);
  // Nobody else writes here (the folder is locked), but a backup or a curious person may read.
  sqlite3_busy_timeout(database->connection_, 5000);
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

absl::Status SqliteDatabase::script(const char* sql) {
  const int code = sqlite3_exec(connection_, sql, nullptr, nullptr, nullptr);
  return code == SQLITE_OK ? absl::OkStatus() : error(code);
}

absl::StatusOr<int64_t> SqliteDatabase::number(const char* sql) {
  Query rows = query(sql);
  LL_RETURN_IF_ERROR(rows.step().status());
  return rows.integer(0);
}

absl::StatusOr<int64_t> SqliteDatabase::schema_version() { return number("PRAGMA user_version"); }

absl::StatusOr<bool> SqliteDatabase::is_empty() {
  LL_ASSIGN_OR_RETURN(const int64_t things, number("SELECT COUNT(*) FROM sqlite_master"));
  return things == 0;
}

std::unique_ptr<Rows> SqliteDatabase::start(const char* sql, std::span<const Value> values) {
  Prepared& statement = statements_[sql];
  int code = SQLITE_OK;
  if (statement.handle == nullptr) {
    code = sqlite3_prepare_v3(connection_, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement.handle, nullptr);
    if (code != SQLITE_OK) return std::make_unique<Running>(this, nullptr, error(code));
  }
  LL_CHECK(!statement.running);
  statement.running = true;
  absl::Status status = absl::OkStatus();
  for (size_t i = 0; i < values.size() && code == SQLITE_OK; ++i) {
    code = bind(statement.handle, static_cast<int>(i) + 1, values[i]);
    if (code != SQLITE_OK) status = error(code);
  }
  return std::make_unique<Running>(this, &statement, std::move(status));
}

/// At once: there is nobody to wait for.
absl::Status SqliteDatabase::send_values(const char* sql, std::span<const Value> values) {
  const std::unique_ptr<Rows> rows = start(sql, values);
  for (bool row = true; row;) {
    LL_ASSIGN_OR_RETURN(row, rows->step());
  }
  return absl::OkStatus();
}

absl::Status SqliteDatabase::error(int code) {
  absl::Status status = in_words(code);
  // A transaction that has begun, but that SQLite no longer has.
  if (in_transaction() && undone_.ok() && sqlite3_get_autocommit(connection_) != 0) undone_ = status;
  return status;
}

absl::Status SqliteDatabase::in_words(int code) const {
  const std::string file = file_.string();
  const std::string folder = file_.parent_path().string();
  const std::string reason = connection_ == nullptr ? sqlite3_errstr(code) : sqlite3_errmsg(connection_);
  const int system_error = connection_ == nullptr ? 0 : sqlite3_system_errno(connection_);
  const int kind = code & 0xFF;  // extended codes hold the plain one in their low byte

  const bool no_space = system_error == ENOSPC || system_error == EDQUOT || system_error == EFBIG;
  // SQLite does not say why it could not make a file: it then tried to read it, and says why that failed.
  const bool no_file = kind == SQLITE_CANTOPEN && absl::IsResourceExhausted(check_writable(file_));
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

absl::Status SqliteDatabase::begin(bool inner) {
  // Some errors end a transaction: what comes after them must not be committed by itself.
  if (inner && sqlite3_get_autocommit(connection_) != 0) return undone();
  // IMMEDIATE: what the transaction reads must not change before it writes.
  LL_RETURN_IF_ERROR(run(inner ? "SAVEPOINT inner_one" : "BEGIN IMMEDIATE").status());
  if (!inner) undone_ = absl::OkStatus();
  return absl::OkStatus();
}

absl::Status SqliteDatabase::undone() const {
  if (!undone_.ok()) return undone_;
  return absl::AbortedError(file_.string() + ": an earlier error has undone this change; try again");
}

absl::Status SqliteDatabase::commit(bool inner) {
  if (sqlite3_get_autocommit(connection_) != 0) return undone();
  LL_RETURN_IF_ERROR(run(inner ? "RELEASE inner_one" : "COMMIT").status());
  return absl::OkStatus();
}

void SqliteDatabase::roll_back(bool inner) {
  if (sqlite3_get_autocommit(connection_) != 0) return;
  sqlite3_exec(connection_, inner ? "ROLLBACK TO inner_one; RELEASE inner_one" : "ROLLBACK", nullptr, nullptr, nullptr);
}

}  // namespace lightloom
