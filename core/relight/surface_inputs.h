// What the runtime is told each frame, computed on the CPU: direct light, albedo and emission of every surface element.
#pragma once

#include <filesystem>
#include <vector>

#include "core/asset/manifest.h"
#include "core/base/parallel.h"
#include "core/receivers/receivers.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

/// The surface elements of an asset, found again in the scene it was baked from. Element i is receivers.all[i]: objects
/// in the manifest's order, keys ascending.
struct SurfaceElements {
  AtlasLayout layout;   ///< per scene object
  Receivers receivers;  ///< Receiver::object indexes Scene::objects
};

/// Fails if the scene is not the one that was baked (then bake again), or the asset cannot be read.
absl::StatusOr<SurfaceElements> load_surface_elements(const std::filesystem::path& loom, const Manifest& manifest,
                                                      const Scene& scene);

/// Arrays of one value per surface element, linear RGB.
struct SurfaceInputs {
  std::vector<Vec3> direct;  ///< irradiance straight from punctual lights, W/m²
  std::vector<Vec3> albedo;
  std::vector<Vec3> emission;  ///< radiance
};

/// Albedo and emission alone; `direct` stays empty. Averages over `samples` points of each texel.
absl::StatusOr<SurfaceInputs> surface_materials(const RayTracer& tracer, const SurfaceElements& elements, int samples,
                                                const Parallel& parallel);

/// Averages over `samples` points of each texel.
absl::StatusOr<SurfaceInputs> light_surfaces(const RayTracer& tracer, const SurfaceElements& elements, int samples,
                                             const Parallel& parallel);

}  // namespace lightloom
