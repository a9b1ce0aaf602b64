// A connection to a database: prepared statements that are kept, transactions that undo themselves, errors as absl::Status.
//
// SQL is SQLite's. PostgreSQL hears the same in its own words (postgres_dialect.h).
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "core/base/status.h"

namespace lightloom {

/// Bytes to bind that are no text.
struct Blob {
  std::string_view bytes;
};

/// What a statement is given for its ?1, ?2, ...: valid while the call lasts.
class Value {
 public:
  Value(std::integral auto number) : value_(static_cast<int64_t>(number)) {}
  Value(std::string_view text) : value_(text) {}
  Value(const std::string& text) : value_(std::string_view(text)) {}
  Value(const char* text) : value_(std::string_view(text)) {}
  Value(Blob blob) : value_(blob) {}

  const std::variant<int64_t, std::string_view, Blob>& get() const { return value_; }

 private:
  std::variant<int64_t, std::string_view, Blob> value_;
};

/// One run of a statement; ends with the object.
class Rows {
 public:
  Rows() = default;
  virtual ~Rows() = default;
  Rows(const Rows&) = delete;
  Rows& operator=(const Rows&) = delete;

  /// Whether there is another row. Errors of preparing and binding come out here, too.
  virtual absl::StatusOr<bool> step() = 0;
  // Of the row that step() found:
  virtual int64_t integer(int column) const = 0;
  virtual std::string bytes(int column) const = 0;
  /// How many rows the statement changed. REQUIRES: step() found no more.
  virtual int64_t changed() const = 0;
};

/// Rows that are held by value.
class Query {
 public:
  explicit Query(std::unique_ptr<Rows> rows) : rows_(std::move(rows)) {}
  absl::StatusOr<bool> step() { return rows_->step(); }
  int64_t integer(int column) const { return rows_->integer(column); }
  std::string bytes(int column) const { return rows_->bytes(column); }
  int64_t changed() const { return rows_->changed(); }

 private:
  std::unique_ptr<Rows> rows_;
};

/// Not thread-safe.
class Database {
 public:
  Database() = default;
  virtual ~Database() = default;
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// REQUIRES: `sql` is a literal, one statement, which does not run twice at a time.
  template <class... Args>
  Query query(const char* sql, const Args&... args) {
    const std::array<Value, sizeof...(Args)> values{Value(args)...};
    return Query(start(sql, values));
  }

  /// Runs the statement to its end. Returns how many rows it changed.
  template <class... Args>
  absl::StatusOr<int64_t> run(const char* sql, const Args&... args) {
    Query statement = query(sql, args...);
    for (bool row = true; row;) {
      LL_ASSIGN_OR_RETURN(row, statement.step());
    }
    return statement.changed();
  }

  /// Runs a statement of which nobody asks how it went, within a transaction: an error may come out with a later statement, or
  /// with the transaction's end, which then fails.
  template <class... Args>
  absl::Status send(const char* sql, const Args&... args) {
    const std::array<Value, sizeof...(Args)> values{Value(args)...};
    return send_values(sql, values);
  }
  virtual absl::Status send_values(const char* sql, std::span<const Value> values) = 0;

  /// Runs several statements that need no arguments.
  virtual absl::Status script(const char* sql) = 0;
  /// Of the tables that are there; 0: none of ours. Set by the schema itself.
  virtual absl::StatusOr<int64_t> schema_version() = 0;
  /// Whether there are tables at all.
  virtual absl::StatusOr<bool> is_empty() = 0;
  /// Rows that number themselves go on above those that were given numbers.
  virtual absl::Status number_on() = 0;
  /// For people: where it is.
  virtual std::string name() const = 0;
  /// Milliseconds of Unix time that never run backwards: where several programs use a database, they go by one clock, its own.
  virtual int64_t now_ms() = 0;

 protected:
  virtual std::unique_ptr<Rows> start(const char* sql, std::span<const Value> values) = 0;
  bool in_transaction() const { return in_transaction_; }

 private:
  friend class Transaction;
  // One that is inner is a savepoint.
  virtual absl::Status begin(bool inner) = 0;
  virtual absl::Status commit(bool inner) = 0;
  virtual void roll_back(bool inner) = 0;

  bool in_transaction_ = false;
};

/// Undone at its end unless committed. One within another is a savepoint: what it commits lasts if the outer one commits.
class Transaction {
 public:
  explicit Transaction(Database& database) : database_(database) {}
  ~Transaction() {
    if (state_ == State::kClosed) return;
    if (state_ == State::kOuter) database_.in_transaction_ = false;
    database_.roll_back(state_ == State::kInner);
  }
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  /// Both: the error, if any, by which the database ended the transaction before.
  absl::Status begin() {
    const bool inner = database_.in_transaction_;
    LL_RETURN_IF_ERROR(database_.begin(inner));
    state_ = inner ? State::kInner : State::kOuter;
    database_.in_transaction_ = true;
    return absl::OkStatus();
  }
  absl::Status commit() {
    LL_RETURN_IF_ERROR(database_.commit(state_ == State::kInner));
    if (state_ == State::kOuter) database_.in_transaction_ = false;
    state_ = State::kClosed;
    return absl::OkStatus();
  }

 private:
  Database& database_;
  enum class State { kClosed, kOuter, kInner } state_ = State::kClosed;  // kClosed: never begun, or committed
};

}  // namespace lightloom
