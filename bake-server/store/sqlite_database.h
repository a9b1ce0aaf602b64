// One SQLite connection: prepared statements that are kept, transactions that undo themselves, errors as absl::Status.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/file.h"
#include "core/base/status.h"

namespace lightloom {

/// Bytes to bind that are no text.
struct Blob {
  std::string_view bytes;
};

class Database;
struct PreparedStatement;

/// One run of a statement; ends with the object. REQUIRES: the same SQL does not run twice at a time.
class Query {
 public:
  Query(Query&& other) noexcept;
  ~Query();

  /// Whether there is another row. Errors of preparing and binding come out here, too.
  absl::StatusOr<bool> step();
  // Of the row that step() found:
  int64_t integer(int column) const;
  std::string bytes(int column) const;

 private:
  friend class Database;
  explicit Query(Database* database) : database_(database) {}
  void bind(int index, int64_t value);
  void bind(int index, std::string_view text);
  void bind(int index, Blob blob);
  void check(int code);

  Database* database_;
  PreparedStatement* statement_ = nullptr;
  absl::Status status_;
};

/// Not thread-safe.
class Database {
 public:
  /// Opens or creates `file`: WAL, every commit durable, foreign keys enforced.
  static absl::StatusOr<std::unique_ptr<Database>> open(const std::filesystem::path& file, Durability durability);
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// REQUIRES: `sql` is a literal, one statement; the arguments are integers, texts and Blobs for its ?1, ?2, ...
  template <class... Args>
  Query query(const char* sql, const Args&... args) {
    Query query = prepare(sql);
    int index = 0;
    (query.bind(++index, args), ...);
    return query;
  }

  /// Runs the statement to its end. Returns how many rows it changed.
  template <class... Args>
  absl::StatusOr<int64_t> run(const char* sql, const Args&... args) {
    Query statement = query(sql, args...);
    return finish(statement);
  }

  /// Runs several statements that need no arguments.
  absl::Status script(const char* sql);
  int64_t last_insert_id() const;
  const std::filesystem::path& file() const;

 private:
  friend class Query;
  friend class Transaction;
  struct Impl;
  explicit Database(std::unique_ptr<Impl> impl);
  Query prepare(const char* sql);
  absl::StatusOr<int64_t> finish(Query& statement);
  absl::Status error(int code) const;
  absl::Status in_words(int code) const;

  std::unique_ptr<Impl> impl_;
};

/// Undone at its end unless committed. One within another is a savepoint: what it commits lasts if the outer one commits.
class Transaction {
 public:
  explicit Transaction(Database& database) : database_(database) {}
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  /// Both: the error, if any, by which SQLite ended the transaction before.
  absl::Status begin();
  absl::Status commit();

 private:
  absl::Status undone() const;

  Database& database_;
  enum class State { kClosed, kOuter, kInner } state_ = State::kClosed;  // kClosed: never begun, or committed
};

}  // namespace lightloom
