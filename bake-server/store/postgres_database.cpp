#include "bake-server/store/postgres_database.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <libpq-fe.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <iterator>
#include <map>
#include <utility>
#include <vector>

#include "bake-server/store/postgres_dialect.h"
#include "core/base/check.h"
#include "core/base/steady_clock.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

constexpr Oid kInt8 = 20, kText = 25, kBytea = 17;
constexpr int kBinary = 1;
constexpr size_t kMostAhead = 256;  // statements whose answers wait: they must fit into the sockets' buffers
constexpr int64_t kClockEveryMs = 5000;
// Any number that nobody else locks in a database of ours.
constexpr const char* kLock = "SELECT pg_advisory_xact_lock(5570193308531903852)";
constexpr const char* kNow = "SELECT (EXTRACT(EPOCH FROM clock_timestamp()) * 1000)::BIGINT";

struct Clear {
  void operator()(PGresult* result) const { PQclear(result); }
};
using Result = std::unique_ptr<PGresult, Clear>;

std::string one_line(std::string_view message) {
  std::string line = escape_controls(message.substr(0, message.find('\n')));
  const std::string_view level = "ERROR:  ";
  return line.starts_with(level) ? line.substr(level.size()) : line;
}

int64_t integer_of(const char* bytes, int size) {
  if (size == 1) return *bytes;  // a bool
  uint64_t big = 0;
  for (int i = 0; i < size; ++i) big = big << 8 | static_cast<uint8_t>(bytes[i]);
  return size == 4 ? static_cast<int32_t>(big) : static_cast<int64_t>(big);
}

class PostgresRows final : public Rows {
 public:
  explicit PostgresRows(absl::StatusOr<Result> result) : result_(std::move(result)) {}

  absl::StatusOr<bool> step() override {
    LL_RETURN_IF_ERROR(result_.status());
    return ++row_ < PQntuples(result_->get());
  }
  int64_t integer(int column) const override {
    return integer_of(PQgetvalue(result_->get(), row_, column), PQgetlength(result_->get(), row_, column));
  }
  std::string bytes(int column) const override {
    return {PQgetvalue(result_->get(), row_, column), static_cast<size_t>(PQgetlength(result_->get(), row_, column))};
  }
  int64_t changed() const override {
    int64_t rows = 0;
    (void)absl::SimpleAtoi(PQcmdTuples(result_->get()), &rows);  // empty: a statement that changes none
    return rows;
  }

 private:
  absl::StatusOr<Result> result_;
  int row_ = -1;
};

class PostgresDatabase final : public Database {
 public:
  PostgresDatabase(std::string url, Durability durability) : url_(std::move(url)), durability_(durability) {}
  ~PostgresDatabase() override { PQfinish(connection_); }

  absl::Status connect() {
    PQfinish(std::exchange(connection_, nullptr));
    prepared_.clear();
    fresh_.clear();
    ahead_ = 0;
    const char* const names[] = {"dbname",           "application_name", "connect_timeout",
                                 "tcp_user_timeout", "client_encoding",  nullptr};
    const char* const values[] = {url_.c_str(), "lightloom-server", "10", "20000", "UTF8", nullptr};
    connection_ = PQconnectdbParams(names, values, /*expand_dbname=*/1);
    if (connection_ == nullptr) return absl::ResourceExhaustedError("no memory for a connection to PostgreSQL");
    if (PQstatus(connection_) != CONNECTION_OK) {
      return absl::UnavailableError(absl::StrCat("cannot connect to PostgreSQL at ", name(), ": ",
                                                 one_line(PQerrorMessage(connection_)),
                                                 "; check that it runs, and --database"));
    }
    PQsetNoticeProcessor(
        connection_, [](void*, const char*) {}, nullptr);
    LL_RETURN_IF_ERROR(
        plain(durability_ == Durability::kPowerLoss ? "SET synchronous_commit = on" : "SET synchronous_commit = off"));
    LL_CHECK(PQenterPipelineMode(connection_) == 1);
    return read_clock();
  }

  absl::Status send_values(const char* sql, std::span<const Value> values) override {
    LL_CHECK(in_transaction());
    LL_RETURN_IF_ERROR(push(sql, values));
    return ahead_ < kMostAhead ? absl::OkStatus() : drain(nullptr);
  }

  absl::Status script(const char* sql) override {
    LL_RETURN_IF_ERROR(usable());
    LL_RETURN_IF_ERROR(drain(nullptr));
    LL_CHECK(PQexitPipelineMode(connection_) == 1);
    const absl::Status status = plain(to_postgres(sql).c_str());
    if (PQstatus(connection_) == CONNECTION_OK) LL_CHECK(PQenterPipelineMode(connection_) == 1);
    return status;
  }

  absl::StatusOr<int64_t> schema_version() override {
    LL_ASSIGN_OR_RETURN(const int64_t known, number("SELECT COUNT(*) FROM pg_tables WHERE schemaname = current_schema()"
                                                    " AND tablename = 'schema_version'"));
    if (known == 0) return 0;
    return number("SELECT version FROM schema_version");
  }
  absl::StatusOr<bool> is_empty() override {
    LL_ASSIGN_OR_RETURN(const int64_t tables,
                        number("SELECT COUNT(*) FROM pg_tables WHERE schemaname = current_schema()"));
    return tables == 0;
  }

  absl::Status number_on() override {
    for (const char* sql :
         {"SELECT setval(pg_get_serial_sequence('jobs', 'id'), GREATEST(MAX(id), 1)) FROM jobs",
          "SELECT setval(pg_get_serial_sequence('tasks', 'id'), GREATEST(MAX(id), 1)) FROM tasks",
          "SELECT setval(pg_get_serial_sequence('attempts', 'id'), GREATEST(MAX(id), 1)) FROM attempts",
          "SELECT setval(pg_get_serial_sequence('events', 'id'), GREATEST(MAX(id), 1)) FROM events"}) {
      LL_RETURN_IF_ERROR(send_values(sql, {}));
    }
    return absl::OkStatus();
  }

  std::string name() const override {
    if (connection_ == nullptr || PQdb(connection_) == nullptr) return "the address that was given";
    return absl::StrCat("database '", PQdb(connection_), "' on ",
                        PQhost(connection_) == nullptr ? "" : PQhost(connection_));
  }

  int64_t now_ms() override {
    const int64_t now = clock_() + offset_ms_.load();
    int64_t last = last_ms_.load();
    while (last < now && !last_ms_.compare_exchange_weak(last, now)) {
    }
    return std::max(last, now);
  }

 protected:
  std::unique_ptr<Rows> start(const char* sql, std::span<const Value> values) override {
    return std::make_unique<PostgresRows>(result_of(sql, values));
  }

 private:
  absl::Status begin(bool inner) override {
    if (inner) {
      LL_RETURN_IF_ERROR(undone_);
      return send_values("SAVEPOINT inner_one", {});
    }
    LL_RETURN_IF_ERROR(usable());
    if (clock_() - clock_read_ms_ > kClockEveryMs) LL_RETURN_IF_ERROR(read_clock());
    undone_ = absl::OkStatus();
    LL_RETURN_IF_ERROR(push("BEGIN", {}));
    return push(kLock, {});
  }

  absl::Status commit(bool inner) override {
    LL_RETURN_IF_ERROR(undone_);
    if (inner) return send_values("RELEASE inner_one", {});
    LL_ASSIGN_OR_RETURN(const Result result, result_of("COMMIT", {}));
    // Of a transaction that has failed it says ROLLBACK.
    if (std::string_view(PQcmdStatus(result.get())) != "COMMIT") {
      return absl::AbortedError(name() + ": an earlier error has undone this change; try again");
    }
    return absl::OkStatus();
  }

  void roll_back(bool inner) override {
    if (inner) {
      // What failed before has undone the whole of it, which its end will say.
      if (!undone_.ok()) return;
      (void)drain(nullptr, /*expected=*/true);
      absl::Status status = send_values("ROLLBACK TO inner_one", {});
      if (status.ok()) status = send_values("RELEASE inner_one", {});
      if (!status.ok()) undone_ = status;
      return;
    }
    if (PQstatus(connection_) != CONNECTION_OK) return;  // the server undoes it
    (void)drain(nullptr, true);
    if (push("ROLLBACK", {}).ok()) (void)drain(nullptr, true);
  }

  /// A connection that was lost is made anew, but not within a transaction.
  absl::Status usable() {
    if (connection_ != nullptr && PQstatus(connection_) == CONNECTION_OK) return absl::OkStatus();
    if (in_transaction()) return absl::UnavailableError("the connection to " + name() + " was lost; try again");
    return connect();
  }

  absl::StatusOr<Result> result_of(const char* sql, std::span<const Value> values) {
    LL_RETURN_IF_ERROR(usable());
    LL_RETURN_IF_ERROR(push(sql, values));
    Result result;
    LL_RETURN_IF_ERROR(drain(&result));
    return result;
  }

  absl::StatusOr<int64_t> number(const char* sql) {
    LL_ASSIGN_OR_RETURN(const Result result, result_of(sql, {}));
    if (PQntuples(result.get()) == 0) return absl::DataLossError(name() + " does not say its schema's version");
    return integer_of(PQgetvalue(result.get(), 0, 0), PQgetlength(result.get(), 0, 0));
  }

  /// Sends a statement; its answer is read later.
  absl::Status push(const char* sql, std::span<const Value> values) {
    std::vector<Oid> types;
    std::vector<std::string> texts(values.size());
    std::vector<const char*> data;
    std::vector<int> lengths, formats;
    for (size_t i = 0; i < values.size(); ++i) {
      std::string_view bytes;
      if (const auto* number = std::get_if<int64_t>(&values[i].get())) {
        types.push_back(kInt8);
        texts[i] = absl::StrCat(*number);
        bytes = texts[i];
      } else if (const auto* text = std::get_if<std::string_view>(&values[i].get())) {
        // Only SQLite takes it. Found here, it fails one call, not all that are sent together.
        if (text->find('\0') != std::string_view::npos) {
          return absl::InvalidArgumentError("a text has a NUL byte: leave it out");
        }
        types.push_back(kText);
        bytes = *text;
      } else {
        types.push_back(kBytea);
        bytes = std::get<Blob>(values[i].get()).bytes;
      }
      data.push_back(bytes.empty() ? "" : bytes.data());
      lengths.push_back(static_cast<int>(bytes.size()));
      formats.push_back(types.back() == kInt8 ? 0 : kBinary);
    }
    const auto known = prepared_.find(sql);
    std::string name;
    if (known == prepared_.end()) {
      name = absl::StrCat("s", next_name_++);
      if (PQsendPrepare(connection_, name.c_str(), to_postgres(sql).c_str(), static_cast<int>(types.size()),
                        types.data()) != 1) {
        return lost();
      }
      ++ahead_;
      prepared_.emplace(sql, name);
      fresh_.push_back(sql);
    } else {
      name = known->second;
    }
    if (PQsendQueryPrepared(connection_, name.c_str(), static_cast<int>(values.size()), data.data(), lengths.data(),
                            formats.data(), kBinary) != 1) {
      return lost();
    }
    ++ahead_;
    return absl::OkStatus();
  }

  /// Reads the answers of all that was sent. The last one's, if it is asked for, is the caller's to report; an error of another
  /// undoes the transaction, unless it was `expected`.
  absl::Status drain(Result* last, bool expected = false) {
    if (ahead_ == 0) return absl::OkStatus();
    if (PQpipelineSync(connection_) != 1) return lost();
    absl::Status first = absl::OkStatus();
    bool of_last = false;
    for (size_t i = 0; i < ahead_; ++i) {
      for (;;) {
        Result result(PQgetResult(connection_));
        if (result == nullptr) break;
        const ExecStatusType status = PQresultStatus(result.get());
        if (status == PGRES_FATAL_ERROR && first.ok()) {
          first = in_words(*result);
          of_last = last != nullptr && i + 1 == ahead_;
        }
        if (PQstatus(connection_) != CONNECTION_OK) return lost();
        if (last != nullptr && i + 1 == ahead_) *last = std::move(result);
      }
    }
    ahead_ = 0;
    const Result synced(PQgetResult(connection_));
    if (synced == nullptr || PQresultStatus(synced.get()) != PGRES_PIPELINE_SYNC) return lost();
    for (const std::string_view sql : fresh_) {
      if (!first.ok()) prepared_.erase(sql);  // it may have been skipped
    }
    fresh_.clear();
    if (!first.ok() && !of_last && !expected && in_transaction()) undone_ = first;
    return first;
  }

  absl::Status lost() {
    const std::string reason = one_line(PQerrorMessage(connection_));
    ahead_ = 0;
    PQfinish(std::exchange(connection_, nullptr));
    absl::Status status =
        absl::UnavailableError(absl::StrCat("the connection to PostgreSQL was lost (", reason, "); try again"));
    if (in_transaction()) undone_ = status;
    return status;
  }

  absl::Status in_words(const PGresult& result) const {
    const char* const field = PQresultErrorField(&result, PG_DIAG_SQLSTATE);
    const std::string_view state = field == nullptr ? "" : field;
    const std::string reason = one_line(PQresultErrorMessage(&result));
    if (state == "53100") {
      return absl::ResourceExhaustedError(
          absl::StrCat("no space left for the farm's state in ", name(), " (", reason, "): free some on its disk"));
    }
    if (state == "23505") return absl::AlreadyExistsError(absl::StrCat(name(), ": ", reason));
    if (state == "22021") return absl::InvalidArgumentError("a text is no UTF-8 (" + reason + ")");
    if (state.starts_with("XX00") && state != "XX000") {
      return absl::DataLossError(absl::StrCat(name(), " is damaged (", reason, "): restore it from a backup"));
    }
    if (state == "42501" || state.starts_with("28")) {
      return absl::PermissionDeniedError(
          absl::StrCat(name(), ": ", reason, "; give --database a user who owns the database"));
    }
    // Connections, resources, shutdown, failover, deadlocks: worth another try.
    constexpr std::string_view kAgain[] = {"08", "53", "57", "25006", "40"};
    if (state.empty() ||
        std::any_of(std::begin(kAgain), std::end(kAgain), [&](auto k) { return state.starts_with(k); })) {
      return absl::UnavailableError(absl::StrCat(name(), " does not answer (", reason, "); try again"));
    }
    return absl::InternalError(
        absl::StrCat(name(), ": PostgreSQL error ", std::string(state), " (", reason, "): please report this"));
  }

  /// Outside of pipeline mode; several statements.
  absl::Status plain(const char* sql) {
    const Result result(PQexec(connection_, sql));
    const ExecStatusType status = PQresultStatus(result.get());
    return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK ? absl::OkStatus() : in_words(*result);
  }

  absl::Status read_clock() {
    LL_ASSIGN_OR_RETURN(const int64_t now_ms, number(kNow));
    clock_read_ms_ = clock_();
    offset_ms_ = now_ms - clock_read_ms_;
    return absl::OkStatus();
  }

  const std::string url_;
  const Durability durability_;
  PGconn* connection_ = nullptr;
  std::map<std::string_view, std::string> prepared_;  // by their SQL: their names
  std::vector<std::string_view> fresh_;               // of them: since answers were last read
  uint64_t next_name_ = 0;
  size_t ahead_ = 0;     // statements that were sent and not read
  absl::Status undone_;  // the error that has undone it
  const std::function<int64_t()> clock_ = steady_unix_clock();
  int64_t clock_read_ms_ = 0;
  std::atomic<int64_t> offset_ms_ = 0, last_ms_ = 0;  // of its clock from ours
};

}  // namespace

absl::StatusOr<std::unique_ptr<Database>> open_postgres(const std::string& url, Durability durability) {
  auto database = std::make_unique<PostgresDatabase>(url, durability);
  LL_RETURN_IF_ERROR(database->connect());
  return database;
}

}  // namespace lightloom
