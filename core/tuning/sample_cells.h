// What compression costs and saves: a few of a plan's cells, gathered once and compressed in several ways.
//
// The factors that are kept average over a cluster's receivers, so that much of the noise of gather rays goes with the rank
// that is cut off. Noise and truncation are therefore judged together, against rays of other seeds.
#pragma once

#include <vector>

#include "core/compression/truncated_svd.h"
#include "core/tuning/error_sample.h"

namespace lightloom {

struct CompressionChoice {
  int order = 7, rays = 256, relight_rays = 4096, max_rank = 32;
  float threshold = 0.02f;
};

/// Errors in units of rel_rmse.
struct CompressionCost {
  double error = 0;  ///< of noise and truncation, without fp16
  double fp16 = 0;   ///< what rounding to 16 bits does
  // Bytes a receiver, but for its near field:
  double projection = 0;  ///< matrices with a column for each coefficient of a probe
  double other = 0;
};

class SampleCells {
 public:
  /// Gathers them, for all orders and ray counts. REQUIRES: a finished plan, by the default method; it need not outlive this.
  /// Error: cancellation.
  static absl::StatusOr<SampleCells> create(const RayTracer& tracer, const Plan& plan, const ErrorSample& sample,
                                            const Parallel& how);

  static constexpr int kRays[] = {64, 128, 256, 512, 1024};  ///< that can be asked for
  /// No sample light reaches them: errors say nothing, and are 0.
  bool dark() const { return dark_; }
  /// Error: cancellation.
  absl::StatusOr<CompressionCost> compress(const CompressionChoice& choice, const Parallel& how) const;

 private:
  static constexpr size_t kRayCounts = std::size(kRays);
  static constexpr uint32_t kBatchRays = 64, kBatches = 16, kJudges = 4;  ///< batches that judge those

  struct Cell {
    std::vector<Vec3> positions, normals;
    std::vector<float> sigma;                // CellTask::sigma
    Matrix transport[kRayCounts];            // of the widest order, by kRays
    std::vector<double> near[kRayCounts];    // E from near fields: receivers × lights, by kRays
    std::vector<float> judged;               // E: receivers × judging batches × lights × orders
    std::vector<std::vector<float>> lambda;  // per light: probes × J of the widest order
    uint64_t seed = 0;
  };
  std::vector<Cell> cells_;
  size_t lights_ = 0;
  bool dark_ = false;
  std::vector<double> weight_;  // per light, of a squared error
};

}  // namespace lightloom
