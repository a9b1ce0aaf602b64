#include "core/receivers/reversed.h"

#include <algorithm>

#include "core/base/rng.h"
#include "core/base/sampling.h"
#include "core/receivers/surface_point.h"

namespace lightloom {
namespace {

constexpr int kPoints = 16;                           // of an object
constexpr uint32_t kSide = 4, kRays = kSide * kSide;  // from each side of a point

/// Of kRays rays from one side of a surface: those that meet the front of another object, and those that meet backs.
struct Seen {
  int other_fronts = 0, backs = 0;
};

Seen look(const RayTracer& tracer, const ShadingPoint& from, uint32_t object, Rng* rng) {
  Seen seen;
  for (uint32_t i = 0; i < kRays; ++i) {
    const Sample2 uv = stratified(i, kSide, rng);
    const Hit hit = tracer.closest(from.position, leave(from, square_to_cosine_hemisphere(uv.u, uv.v)));
    if (!hit) continue;
    seen.backs += hit.back;
    seen.other_fronts += !hit.back && hit.object != object;
  }
  return seen;
}

bool is_reversed(const RayTracer& tracer, uint32_t index) {
  const Scene& scene = tracer.scene();
  const Object& object = scene.objects[index];
  // Running sums of area, to pick triangles by.
  std::vector<double> sums;
  double sum = 0;
  for (const Triangle& t : object.triangles) {
    const Vec3 a = object.positions[t.v[0]];
    sum += static_cast<double>(length(cross(object.positions[t.v[1]] - a, object.positions[t.v[2]] - a)));
    sums.push_back(sum);
  }
  if (!(sum > 0)) return false;
  Rng rng(hash_combine(object.id.low64(), 0xbac4));
  int before = 0, behind = 0, points = 0;
  for (int i = 0; i < kPoints; ++i) {
    const double at = sum * (i + static_cast<double>(rng.next_float())) / kPoints;
    const auto chosen = std::min(std::upper_bound(sums.begin(), sums.end(), at), sums.end() - 1);
    const uint32_t t = static_cast<uint32_t>(chosen - sums.begin());
    float b1 = rng.next_float(), b2 = rng.next_float();
    if (b1 + b2 > 1) b1 = 1 - b1, b2 = 1 - b2;
    if (scene.materials[object.triangles[t].material].double_sided) continue;
    const Seen front = look(tracer, shading_point(object, t, b1, b2, false), index, &rng);
    const Seen back = look(tracer, shading_point(object, t, b1, b2, true), index, &rng);
    if (2 * front.backs >= static_cast<int>(kRays)) continue;  // sunk in another solid: no side of it speaks
    ++points;
    before += front.other_fronts;
    behind += back.other_fronts;
  }
  return 4 * points >= kPoints && 8 * behind >= points * static_cast<int>(kRays) && 2 * behind > 3 * before;
}

}  // namespace

std::vector<uint32_t> reversed_objects(const RayTracer& tracer, const Parallel& parallel) {
  const std::vector<Object>& objects = tracer.scene().objects;
  std::vector<uint8_t> reversed(objects.size(), 0);
  parallel_for(objects.size(), parallel, [&](uint64_t i) {
    if (objects[i].is_static) reversed[i] = is_reversed(tracer, static_cast<uint32_t>(i));
  });
  std::vector<uint32_t> out;
  for (uint32_t i = 0; i < reversed.size(); ++i) {
    if (reversed[i]) out.push_back(i);
  }
  return out;
}

}  // namespace lightloom
