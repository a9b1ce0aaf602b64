// What a picture shows, and how its radiance becomes pixels: one definition for every picture this project writes.
#pragma once

#include "core/scene/image.h"
#include "core/scene/scene.h"

namespace lightloom {

/// full = direct + indirect.
enum class Layer {
  kFull,      ///< albedo/π·(direct + E) + emission; the sky where nothing is hit
  kDirect,    ///< albedo/π·direct + emission; the sky where nothing is hit
  kIndirect,  ///< albedo/π·E
  kE,         ///< E/π: white surfaces under the indirect light alone
  kAlbedo     ///< diffuse reflectance
};

/// Whether a layer shows the sky behind the level.
inline bool shows_sky(Layer layer) { return layer == Layer::kFull || layer == Layer::kDirect; }

/// Rows of a picture `width` pixels wide, width ÷ aspect. Fails above 16384: cameras come from files.
absl::StatusOr<int> image_height(const Camera& camera, int width);

/// Exposure and tone map: the image's log-average luminance (zeros left out) goes to 0.18, then x·(1 + x/16)/(1 + x) per
/// channel (Reinhard et al. 2002, Eq. 4, white at 4). Returns the factor; `factor` > 0 is used in place of the average.
float expose(Image* image, float factor = 0);

}  // namespace lightloom
