// Speed against accuracy on one level: every variant of every method prepared, timed, lit under every rig, and judged by path
// tracing.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/eval/expected_error.h"
#include "cli/eval/run.h"

namespace lightloom::eval {

struct Request {
  std::string folder;  ///< keeps truths, runs and lightmaps; what is there and fits is not made again
  std::vector<const Method*> methods;
  bool quick = false;
  int bounces = 1;
  int frames = 9;   ///< timed per variant
  int repeats = 1;  ///< of each preparation: rounds over all variants
  TruthOptions truth;
};

/// What a report is made of.
struct Evaluation {
  std::string level, machine;
  std::vector<std::string> pooled;  ///< the levels it is of, if several: pool.h
  uint64_t receivers = 0, triangles = 0;
  int bounces = 1;
  struct Rig {
    std::string name;
    double noise = 0;  ///< of its truth
    int samples = 0;
  };
  std::vector<Rig> rigs;
  struct MethodWords {
    std::string name, title, about;
  };
  std::vector<MethodWords> methods;
  std::vector<Run> runs;                  ///< by method; the first of each is its default
  std::optional<ExpectedError> expected;  ///< of our default settings, where they were evaluated
};

absl::StatusOr<Evaluation> evaluate(LitLevel* level, const std::string& name, const Request& request);

/// Where evaluate() left E of a method's default under a rig, and its truth.
std::filesystem::path lightmap_path(const std::string& folder, const std::string& method, size_t rig);
std::filesystem::path truth_path(const std::string& folder, size_t rig);

/// The first run of a method; nullptr: it was not asked for.
const Run* default_run(const Evaluation& evaluation, const std::string& method);

absl::Status save(const Evaluation& evaluation, const std::filesystem::path& path);
absl::StatusOr<Evaluation> load_evaluation(const std::filesystem::path& path);

}  // namespace lightloom::eval
