// What the runtime's benchmarks measure, and how they print it.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/asset_source.h"

namespace lightloom::bench {

/// The asset that LIGHTLOOM_BENCH_ASSET names (a .loom folder), else a made-up one. Exits with a message if it is bad.
struct BenchAsset {
  std::vector<uint8_t> manifest;
  ReadChunk read;

  AssetSource open() const;
  /// For lightloom_load; a BenchAsset is the user.
  static int read_chunk(void* user, const uint8_t digest[32], uint64_t size, void* out);
};
BenchAsset bench_asset();

/// The middle, and how far the runs spread.
struct Spread {
  double median, least, most;
};
Spread spread(std::vector<double> values);

/// What a pass over everything takes, and beside it, measured in turn with it, the best bare loops that read as many bytes of
/// fp16 matrix: with one right-hand side, and with three, as the colours are. Bare loops may be missing.
struct PassSamples {
  const char* path;
  const char* pass;
  uint64_t bytes;              ///< of the asset
  std::vector<double> cpu_ms;  ///< of all threads
  std::vector<double> bare_gb_per_s, bare_rgb_gb_per_s;
};
/// Rows of a table in Markdown; a ratio is the median over the samples.
void print_pass_header();
void print_pass(const PassSamples& samples);

/// Shares of the surface elements whose light changes.
inline constexpr double kShares[] = {0.0, 0.0001, 0.001, 0.01, 0.1, 1.0};
/// What a change is worth that is followed up in those frames, relative.
inline constexpr float kEpsilon = 0.01f;

/// A row of the table of frames after a change.
struct FrameRow {
  const char* path;
  double share;
  double set_ms, frame_ms;
  uint32_t tiles, probes, cells;
};
void print_frame_header();
void print_frame(const FrameRow& row);

}  // namespace lightloom::bench
