#include "core/relight/camera_view.h"

#include <algorithm>
#include <cmath>

#include "core/base/sampling.h"
#include "core/reference/path_tracer.h"

namespace lightloom {
namespace {

Vec3 shade(const RayTracer& tracer, const SurfaceElements& elements, const ReceiverSearch& search,
           std::span<const Vec3> irradiance, const Hit& hit, Layer layer) {
  const Scene& scene = tracer.scene();
  const Object& object = scene.objects[hit.object];
  const Triangle& t = object.triangles[hit.triangle];
  if (is_dark_back(scene, hit)) return {};
  if (layer == Layer::kAlbedo) return albedo_at(scene, object, t, hit.b1, hit.b2);
  Vec3 light;
  if (layer != Layer::kDirect) light += sample_irradiance(elements, search, irradiance, hit);
  if (layer == Layer::kE) return light / kPi;
  if (layer != Layer::kIndirect) {
    light += direct_irradiance(tracer, shading_point(object, hit.triangle, hit.b1, hit.b2, hit.back));
  }
  Vec3 radiance = albedo_at(scene, object, t, hit.b1, hit.b2) * light / kPi;
  if (layer != Layer::kIndirect && !hit.back) radiance += emission_at(scene, object, t, hit.b1, hit.b2);
  return radiance;
}

}  // namespace

absl::StatusOr<Image> render_view(const RayTracer& tracer, const SurfaceElements& elements,
                                  std::span<const Vec3> irradiance, const Camera& camera, const ViewOptions& options) {
  LL_ASSIGN_OR_RETURN(const int height, image_height(camera, options.width));
  Image image(options.width, height, {"R", "G", "B"});
  const ReceiverSearch search(tracer, elements.layout, elements.receivers);
  const uint32_t side = strata(options.samples);
  const bool done = parallel_for(static_cast<uint64_t>(height), options.parallel, [&](uint64_t row) {
    for (int x = 0; x < options.width; ++x) {
      Rng rng(hash_combine(row, static_cast<uint64_t>(x)));
      Vec3 sum;
      for (uint32_t s = 0; s < side * side; ++s) {
        const Sample2 jitter = stratified(s, side, &rng);
        const Vec3 direction =
            camera_direction(camera, (static_cast<float>(x) + jitter.u) / static_cast<float>(options.width),
                             (static_cast<float>(row) + jitter.v) / static_cast<float>(height));
        const Hit hit = tracer.closest(camera.position, direction);
        if (hit) {
          sum += shade(tracer, elements, search, irradiance, hit, options.layer);
        } else if (shows_sky(options.layer)) {
          sum += tracer.scene().environment;
        }
      }
      image.set_rgb(x, static_cast<int>(row), sum / static_cast<float>(side * side));
    }
  });
  if (!done) return absl::CancelledError("cancelled while rendering");
  return image;
}

}  // namespace lightloom
