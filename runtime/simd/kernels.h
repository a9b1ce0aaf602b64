// The four passes' inner loops, one set per instruction set. Only plain data crosses this header, and it defines no
// inline function: the files that are compiled for newer processors must not leave code that the linker could pick for
// older ones.
#pragma once

#include <cstddef>
#include <cstdint>

namespace lightloom::simd {

/// Surface elements of a tile, the unit in which changes are tracked; and the floats of its packed RGB.
inline constexpr uint32_t kTile = 64;
inline constexpr uint32_t kTileFloats = 3 * kTile;
/// λ of a probe is 3 planes (r, g, b) of this many floats each: sh_count rounded up to a multiple of it, padding 0.
inline constexpr uint32_t kLambdaAlign = 16;
/// Probes that are relit together, so that each Y that is loaded is used for 3 times as many columns.
inline constexpr uint32_t kRelightProbes = 4;
inline constexpr uint32_t kRelightColumns = 3 * kRelightProbes;
/// Receivers are padded to it, cluster by cluster, and their columns interleaved in runs of it.
inline constexpr uint32_t kReceiverAlign = 16;
/// Receivers of one call of Kernels::receive, at most.
inline constexpr uint32_t kReceiveBlock = 256;
/// Halfs that a kernel may read (and ignore) behind those of a projection.
inline constexpr uint32_t kOverread = 16;

/// One tile, kTileFloats floats each.
struct RadiosityJob {
  const float* direct;
  const float* albedo;
  const float* emission;
  const float* irradiance;
};

struct RelightJob {
  const float* sh;         ///< Y_j(ω_r): [j/16][r][j%16], padding 0
  const float* radiosity;  ///< packed RGB by element; one float may be read behind the last
  /// Per probe and ray the element it hits; null: no probe.
  const uint32_t* elements[kRelightProbes];
  uint32_t rays;           ///< N
  uint32_t lambda_stride;  ///< a multiple of kLambdaAlign
  float scale;             ///< 4π/N
};

/// Symbols as in core/asset/chunk.h.
struct ClusterView {
  const uint16_t* projection;      ///< K × P × stride halfs
  const uint16_t* reconstruction;  ///< [r/16][k][r%16] halfs, so that all are read in one sweep
  const uint16_t* uniform;         ///< per receiver, padded
  const float* correction;         ///< K
  const uint32_t* probes;          ///< P indices of probes
  uint32_t rank;                   ///< K
  uint32_t probe_count;            ///< P
  uint32_t stride;                 ///< sh_stride
};

struct Kernels {
  const char* name;
  /// B' = albedo/π · (direct + E) + emission. If any |B' − B| > epsilon · max(|B|, floor), stores B' and its
  /// greatest |value| of each colour and returns true; otherwise the tile keeps its B, so that small changes add up until
  /// they count.
  bool (*radiosity)(const RadiosityJob& job, float epsilon, float floor, float* radiosity, float greatest[3]);
  /// lambda[(3·probe + colour)·lambda_stride + j] = 4π/N · Σ_r Y_j(ω_r) · L_r of kRelightProbes probes.
  void (*relight)(const RelightJob& job, float* lambda);
  /// coefficients[4k + colour] = c_k, k = 0..K; `lambda` is that of all probes.
  void (*project)(const ClusterView& cluster, const float* lambda, uint32_t lambda_stride, float* coefficients);
  /// irradiance[colour·kReceiveBlock + r] = E of receiver first + r, r < count. REQUIRES: first and count multiples of
  /// kReceiverAlign, count ≤ kReceiveBlock.
  void (*receive)(const ClusterView& cluster, const float* coefficients, uint32_t first, uint32_t count,
                  float* irradiance);
};

/// Every set that this processor can run, the plain one first and the best one last.
struct KernelList {
  const Kernels* sets[3];
  size_t count;
};
const KernelList& available_kernels();
const Kernels& best_kernels();

// The sets. Only kernels.cpp knows which of them exist and may be used.
extern const Kernels kScalarKernels;
extern const Kernels kAvx2Kernels;
extern const Kernels kAvx512Kernels;

}  // namespace lightloom::simd
