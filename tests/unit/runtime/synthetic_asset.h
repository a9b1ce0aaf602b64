// Assets made up in memory, for tests of the runtime.
#pragma once

#include <map>
#include <vector>

#include "runtime/decoder.h"
#include "runtime/include/lightloom.h"

namespace lightloom::testing {

struct SyntheticAsset {
  Manifest manifest;
  std::map<Digest, std::vector<uint8_t>> chunks;

  ChunkRef put(std::vector<uint8_t> bytes);
  /// Appends the object, its identity made from its index; keys are its surface's, ascending. Returns how
  /// chunks name it.
  ChunkObject add_object(uint32_t width, uint32_t height, const std::vector<uint32_t>& keys);
  void add_probe(const RelightChunk& chunk);
  /// Appends the cell; `probes` are indices into manifest.probes.
  void add_cell(const CellChunk& chunk, const std::vector<uint32_t>& probes);

  /// Lays the objects' lightmaps out side by side, in an image so high.
  void lay_out_in_a_row(int32_t height);
  absl::StatusOr<AssetSource> open() const;
  /// For lightloom_load; `this` is the user.
  static int read_chunk(void* user, const uint8_t digest[32], uint64_t size, void* out);
};

/// A manifest without objects, probes or cells.
SyntheticAsset empty_asset(int order, int relight_rays);

struct RandomAssetOptions {
  int order = 4;
  int relight_rays = 200;
  uint32_t objects = 5;
  uint32_t side = 16;  ///< of lightmaps, at most
  uint32_t probes = 24;
  uint32_t cells = 7;
  uint32_t max_clusters = 4;  ///< per cell
  uint32_t max_cluster_probes = 9;
  uint32_t max_rank = 32;
  uint64_t seed = 1;
  bool closed = false;  ///< every ray hits a surface element, every element is a receiver, uniform is 1
};
/// Consistent with itself (u · projection = correction) and dim enough that feedback converges; otherwise
/// noise.
SyntheticAsset random_asset(const RandomAssetOptions& options);

/// Random within physical ranges.
SurfaceLight random_light(uint32_t surface_elements, uint64_t seed);

/// The coefficients that the relight pass of `rays` rays gives to the uniform field 1.
std::vector<double> uniform_coefficients(int order, int rays);

}  // namespace lightloom::testing
