// What the tests of Store share: small jobs.
#pragma once

#include <absl/strings/str_cat.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "bake-server/store/sqlite_store.h"
#include "bake-server/store/store.h"

namespace lightloom::test {

/// A folder of this test alone; removed with its content at the end.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "lightloom-store-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) ADD_FAILURE() << "cannot make " << name;
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// The value; an error fails the test and gives an empty one.
template <class T>
T value(absl::StatusOr<T> result) {
  EXPECT_TRUE(result.ok()) << result.status();
  return result.ok() ? *std::move(result) : T{};
}
inline void value(const absl::Status& status) { EXPECT_TRUE(status.ok()) << status; }

inline std::vector<uint8_t> bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

inline Digest digest(int64_t number) { return sha256(absl::StrCat("output ", number)); }

inline NewTask cell(uint32_t stage, int64_t order) { return {"cell", stage, absl::StrCat("argument ", order), order}; }

inline NewJob new_job(const std::string& request_id, std::vector<NewTask> tasks) {
  NewJob job;
  job.request_id = request_id;
  job.client = "c";
  job.name = "level";
  job.tasks = std::move(tasks);
  return job;
}

/// tasks, ready, running, done, failed.
inline std::vector<uint64_t> counts(const Job& job) {
  return {job.tasks, job.ready, job.running, job.done, job.failed};
}

}  // namespace lightloom::test
