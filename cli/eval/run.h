// What was measured of one variant of a method, on disk as JSON: an evaluation that was stopped goes on from there.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "cli/eval/method.h"

namespace lightloom::eval {

/// Against the truth of one rig. Names as Comparison has them.
struct RigError {
  std::string rig;
  double rel_rmse = 0;
  double noise = 0;  ///< of the truth
  double bias = 0, p50 = 0, p95 = 0, p99 = 0;

  /// rel_rmse without the truth's noise, which is independent of it: their squares add up. What is far below the noise cannot
  /// be told from it, so a quarter of the noise is the least.
  double error() const;
};

struct Run {
  std::string key;  ///< of all that it depends on
  std::string method, label;
  Settings settings;
  Facts facts;  ///< seconds are medians over the repeats
  std::vector<double> seconds, core_seconds;
  std::vector<double> frame_ms;  ///< each frame
  std::vector<RigError> rigs;
  std::set<std::string> machines;  ///< that times were taken on

  /// Geometric mean over the rigs.
  double error() const;
  double worst() const;
  /// Median, 0 without frames.
  double frame() const;
  void add_times(const Facts& of_one);
};

double median(std::vector<double> values);

nlohmann::json to_json(const Run& run);
/// Throws nlohmann::json::exception.
Run run_from_json(const nlohmann::json& json);
absl::Status save(const Run& run, const std::filesystem::path& path);
/// None if there is no file, or it is of something else.
std::optional<Run> load_run(const std::filesystem::path& path, const std::string& key);

/// results.csv: a line a variant. rigs.csv: a line a variant and rig.
std::string results_csv(const std::string& level, const std::vector<Run>& runs);
std::string rigs_csv(const std::string& level, const std::vector<Run>& runs);

}  // namespace lightloom::eval
