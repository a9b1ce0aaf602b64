// A picture of the lit level through a camera, by ray casting on the CPU.
#pragma once

#include <span>

#include "core/relight/lightmap.h"

namespace lightloom {

enum class Layer {
  kFull,      ///< albedo/π·(direct + E) + emission
  kDirect,    ///< albedo/π·direct + emission
  kIndirect,  ///< albedo/π·E
  kE          ///< E/π: white surfaces under the indirect light alone
};

struct ViewOptions {
  int width = 960;
  int samples = 4;  ///< rays per pixel
  Layer layer = Layer::kFull;
  Parallel parallel;
};

/// Radiance, R, G, B; the sky where nothing is hit.
absl::StatusOr<Image> render_view(const RayTracer& tracer, const SurfaceElements& elements,
                                  std::span<const Vec3> irradiance, const Camera& camera, const ViewOptions& options);

/// The one exposure and tone map of every picture this project writes: the image's log-average luminance (zeros left out)
/// goes to 0.18, then x·(1 + x/16)/(1 + x) per channel (Reinhard et al. 2002, Eq. 4, white at 4). Returns the factor.
float expose(Image* image, float factor = 0);

}  // namespace lightloom
