// An evaluation as a page that needs no network, and as charts.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/eval/chart.h"
#include "cli/eval/evaluation.h"
#include "cli/eval/pictures.h"

namespace lightloom::eval {

/// Another renderer's errors by core-seconds, measured elsewhere.
struct Curve {
  std::string title, about;
  std::vector<ChartPoint> points;
};

/// CSV with the columns core_seconds, error and words; its first line names them, lines with # before it are `about`, the first
/// of them the title.
absl::StatusOr<Curve> read_curve(const std::filesystem::path& path);

struct NamedChart {
  std::string name;  ///< of a file
  Chart chart;
};
/// Error against each cost; of a pool, as multiples of what our default's costs.
std::vector<NamedChart> make_charts(const Evaluation& evaluation, const Curve* curve);

/// What a method has where it costs as much, or errs as little, as the default of the first one: along the front of its own
/// settings, between them by interpolation. None where none of them is as cheap, or as accurate.
struct Equals {
  std::optional<double> error_in_bytes, bytes_for_error, error_in_core_seconds, core_seconds_for_error;
};
Equals equals(const Evaluation& evaluation, const std::string& method);

/// Where a method's default is beaten in a chart's cost and in error at once, and by whom; empty: nowhere.
struct Beaten {
  std::string cost;
  std::vector<std::string> by;  ///< "method, variant"
};
std::vector<Beaten> beaten(const Evaluation& evaluation, const Run& run);

/// One row of a stability suite: stability.json of tests/stability/report.
struct StabilityRow {
  std::string name, what, picture;
  double measured = 0, bound = 0;
  bool holds = false;
};
absl::StatusOr<std::vector<StabilityRow>> read_stability(const std::filesystem::path& folder);

struct Page {
  const Evaluation& evaluation;
  const std::vector<NamedChart>& charts;
  const std::vector<Sheet>& sheets;
  const Curve* curve = nullptr;
  std::vector<StabilityRow> stability = {};
  std::string command;
  std::vector<Evaluation> levels = {};  ///< that `evaluation` pools
};
/// Errors: pictures that cannot be read.
absl::StatusOr<std::string> report_html(const Page& page);

}  // namespace lightloom::eval
