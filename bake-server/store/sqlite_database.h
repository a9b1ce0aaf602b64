// One SQLite connection.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "bake-server/store/database.h"
#include "core/base/file.h"
#include "core/base/status.h"

struct sqlite3;
struct sqlite3_stmt;

namespace lightloom {

class SqliteDatabase final : public Database {
 public:
  /// Opens or creates `file`: WAL, every commit durable, foreign keys enforced.
  static absl::StatusOr<std::unique_ptr<SqliteDatabase>> open(const std::filesystem::path& file, Durability durability);
  ~SqliteDatabase() override;

  const std::filesystem::path& file() const { return file_; }

  absl::Status send_values(const char* sql, std::span<const Value> values) override;
  absl::Status script(const char* sql) override;
  absl::StatusOr<int64_t> schema_version() override;
  absl::StatusOr<bool> is_empty() override;
  absl::Status number_on() override { return absl::OkStatus(); }  // it does so by itself
  std::string name() const override { return file_.string(); }
  /// Unix time when it was opened, and steady from then on.
  int64_t now_ms() override { return clock_(); }

 private:
  struct Prepared {
    sqlite3_stmt* handle = nullptr;
    bool running = false;
  };
  class Running;

  explicit SqliteDatabase(std::filesystem::path file);
  std::unique_ptr<Rows> start(const char* sql, std::span<const Value> values) override;
  absl::Status begin(bool inner) override;
  absl::Status commit(bool inner) override;
  void roll_back(bool inner) override;
  absl::StatusOr<int64_t> number(const char* sql);
  absl::Status undone() const;
  absl::Status error(int code);
  absl::Status in_words(int code) const;

  const std::filesystem::path file_;
  const std::function<int64_t()> clock_;
  sqlite3* connection_ = nullptr;
  absl::Status undone_;                              // the error by which SQLite ended it
  std::map<std::string_view, Prepared> statements_;  // by their SQL; std::map keeps addresses
};

}  // namespace lightloom
