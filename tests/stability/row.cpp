#include "tests/stability/row.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace lightloom::stability {
namespace {

constexpr std::array<const char*, 11> kCases{"sealed rooms",  "near lights",     "unseen surfaces", "unexpected lights",
                                             "feedback",      "defects",         "transforms",      "HDR",
                                             "moving lights", "cluster borders", "degenerate input"};

/// What all files of the running test begin with.
std::string file_stem(Case of) {
  const ::testing::TestInfo& test = *::testing::UnitTest::GetInstance()->current_test_info();
  std::array<char, 3> number{};
  std::snprintf(number.data(), number.size(), "%02u", static_cast<unsigned>(of) % 100);
  std::string stem = std::string(number.data()) + "-" + test.test_suite_name() + "." + test.name();
  std::replace(stem.begin(), stem.end(), '/', '_');
  return stem;
}

void write(const std::filesystem::path& folder, const Row& row, bool holds, const std::function<Image()>& picture) {
  static int pictures = 0;  // of this process
  const std::string stem = file_stem(row.of);
  std::string name;
  if (picture) {
    name = stem + "-" + std::to_string(++pictures) + ".png";
    const absl::Status written = write_png(picture(), folder / name);
    ASSERT_TRUE(written.ok()) << written;
  }
  // A number that is none has no place in JSON: null.
  const nlohmann::ordered_json line = {{"case", kCases[static_cast<size_t>(row.of)]},
                                       {"what", row.what},
                                       {"measured", row.measured},
                                       {"bound", row.bound},
                                       {"holds", holds},
                                       {"picture", name}};
  std::ofstream out(folder / (stem + ".jsonl"), std::ios::app);
  out << line.dump() << '\n';
  ASSERT_TRUE(out.flush().good()) << "cannot write " << folder / (stem + ".jsonl");
}

}  // namespace

void check(const Row& row, const std::function<Image()>& picture) {
  const bool holds = row.measured <= row.bound;  // not of a NaN
  std::printf("%s | %s | %.3g | %.3g | %s\n", kCases[static_cast<size_t>(row.of)], row.what.c_str(), row.measured,
              row.bound, holds ? "holds" : "does not hold");
  if (row.no_worse > 0) {
    EXPECT_LE(row.measured, row.no_worse) << row.what << ": worse than it was";
    EXPECT_FALSE(holds) << row.what << ": holds now; take no_worse out, and mend docs/failure-modes.md";
  } else {
    EXPECT_TRUE(holds) << row.what << ": " << row.measured << " exceeds " << row.bound;
  }
  if (const char* folder = std::getenv("LIGHTLOOM_STABILITY_OUT")) write(folder, row, holds, picture);
}

}  // namespace lightloom::stability
