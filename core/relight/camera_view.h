// A picture of the lit level through a camera, by ray casting on the CPU.
#pragma once

#include <span>

#include "core/relight/lightmap.h"
#include "core/scene/picture.h"

namespace lightloom {

struct ViewOptions {
  int width = 960;
  int samples = 4;  ///< rays per pixel
  Layer layer = Layer::kFull;
  Parallel parallel;
};

/// The layer, R, G, B, height = width ÷ aspect.
absl::StatusOr<Image> render_view(const RayTracer& tracer, const SurfaceElements& elements,
                                  std::span<const Vec3> irradiance, const Camera& camera, const ViewOptions& options);

}  // namespace lightloom
