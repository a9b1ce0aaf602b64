// The slow, obvious decoder: the definitions of core/asset/chunk.h in double precision. The Vulkan passes are
// compared with it; tools use it where there is no device.
#pragma once

#include <span>
#include <vector>

#include "core/base/parallel.h"
#include "runtime/asset_source.h"

namespace lightloom {

/// A whole asset in host memory.
struct DecoderAsset {
  uint32_t order = 0;
  uint32_t surface_elements = 0;  ///< S
  std::vector<SourceCell> cells;
  std::vector<std::vector<uint32_t>> relight;  ///< per probe, AssetSource::relight
};
/// Fails as AssetSource does, and if two receivers are the same surface element.
absl::StatusOr<DecoderAsset> load_decoder_asset(const AssetSource& source);

/// What changes from frame to frame; arrays of S, linear RGB.
struct SurfaceLight {
  std::vector<Vec3> direct;  ///< irradiance straight from punctual lights, W/m²
  std::vector<Vec3> albedo;
  std::vector<Vec3> emission;  ///< radiance
  Vec3 environment;            ///< radiance of the sky
};

struct DecodedFrame {
  std::vector<Vec3> radiosity;   ///< S: radiance that leaves each surface element
  std::vector<Vec3> lambda;      ///< probes × sh_count(order)
  std::vector<Vec3> irradiance;  ///< S: E, 0 where there is no receiver
};

/// One frame after `previous`, the E of the frame before (S, all 0 for the first bounce).
/// REQUIRES: array sizes as above.
DecodedFrame decode_frame(const DecoderAsset& asset, const SurfaceLight& light, std::span<const Vec3> previous,
                          const Parallel& how = {});

}  // namespace lightloom
