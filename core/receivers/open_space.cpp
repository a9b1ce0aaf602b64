#include "core/receivers/open_space.h"

#include "core/base/sampling.h"

namespace lightloom {

Space classify(const RayTracer& tracer, const ShadingPoint& point, uint64_t seed) {
  constexpr uint32_t kSide = 6, kRays = kSide * kSide;
  constexpr uint32_t kFirstRays = 12;  // decide where they agree
  Rng rng(hash_combine(seed, 0x51de));
  FirstHits count;
  for (uint32_t i = 0; i < kRays; ++i) {
    // A stride coprime to the number of rays spreads the first ones over the hemisphere.
    const Sample2 uv = stratified(i * 7 % kRays, kSide, &rng);
    count.add(tracer.closest(point.position, leave(point, square_to_cosine_hemisphere(uv.u, uv.v))));
    if (i + 1 == kFirstRays && (count.backs == 0 || count.backs == static_cast<int>(kFirstRays))) break;
  }
  if (2 * count.backs >= count.rays) return Space::kSolid;
  return 8 * count.hits < count.rays ? Space::kVoid : Space::kOpen;
}

bool joined(const RayTracer& tracer, const ShadingPoint& a, const ShadingPoint& b) {
  if (tracer.visible(a.position, b.position)) return true;
  const float height = kDetour * length(b.position - a.position);
  const Vec3 above_a = a.position + a.geometric * height, above_b = b.position + b.geometric * height;
  return tracer.visible(a.position, above_a) && tracer.visible(above_a, above_b) && tracer.visible(above_b, b.position);
}

}  // namespace lightloom
