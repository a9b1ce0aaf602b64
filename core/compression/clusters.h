// Clusters of a bake cell's receivers and their compressed transport (SL17 Eq. 11, Sec. 4.1), with the uniform radiance
// field kept exactly.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/asset/chunk.h"
#include "core/base/vec.h"
#include "core/compression/truncated_svd.h"

namespace lightloom {

struct CompressionOptions {
  int order = 7;
  int max_rank = 32;
  float threshold = 0.02f;       ///< relative Frobenius error at which the rank ends
  uint32_t min_receivers = 128;  ///< > 0: a cluster is not split below this many receivers
  float probe_loss = 0.5f;       ///< share of threshold² that a receiver's squared row may lose to probes left out
  bool weigh_bands = true;       ///< measure errors on S·W
  uint32_t relight_rays = 0;     ///< of the probes: the uniform field that is kept is sh_uniform(order, relight_rays)
  uint64_t seed = 0;
};

struct CompressedCell {
  std::vector<uint32_t> order;    ///< receivers in cluster order, indices into the rows of T
  std::vector<uint16_t> uniform;  ///< as CellChunk::uniform
  std::vector<CellChunk::Cluster> clusters;
  double error = 0;  ///< ‖S − S̃‖ ÷ ‖S‖ over the cell, in the weighted norm
};

/// T: receivers × (probes·J), E = T·λ. `averaged`: S, rows of T averaged with their neighbours' (average.h), or T itself: V
/// and its rank are of S, and errors are measured on it. U·Σ = T·V, so no light is blurred. A cluster whose error stays above
/// the threshold at max_rank is split at the median of its longest axis while both halves keep min_receivers.
///
/// Errors may be measured on S·W, W falling with the band l of a column as 1/(1+l): a level's light has far less energy in
/// high bands, and so does what truncation there costs.
CompressedCell compress_cell(const Matrix& transport, const Matrix& averaged, std::span<const Vec3> positions,
                             const CompressionOptions& options);

/// T̃·λ as a runtime computes it from the stored numbers (chunk.h), for tests. λ: probes × sh_count, one colour.
std::vector<float> decode_cluster(const CellChunk::Cluster& cluster, std::span<const uint16_t> uniform, int order,
                                  std::span<const float> lambda);

}  // namespace lightloom
