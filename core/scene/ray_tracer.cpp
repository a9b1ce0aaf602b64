#include "core/scene/ray_tracer.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>
#include <vector>

#include "core/base/text.h"

namespace lightloom {
namespace {

/// What the filter functions see of an object: Embree's user pointer.
struct GeometryContext {
  const Scene* scene = nullptr;
  const Object* object = nullptr;
  uint32_t content_rank = 0;  // of the object's id among all: settles ties without depending on the object order
  bool has_mask = false;
};

/// Embree's distances come from estimates of reciprocals, which differ between CPU makers, and are off by more where a
/// triangle is thin, hit at a grazing angle, or large and close. Hits nearer to each other than this, relatively, are told apart by
/// recompute().
constexpr float kTie = 0x1p-14f;

/// Extends Embree's context by the nearest hit accepted so far, to settle ties.
struct QueryContext {
  RTCIntersectContext embree;
  float t_max = 0;
  const GeometryContext* nearest = nullptr;
  uint32_t primitive = 0;
  float t = 0;  // by Embree
};

RTCRay make_ray(Vec3 o, Vec3 d, float t_max) {
  RTCRay ray{};
  ray.org_x = o.x, ray.org_y = o.y, ray.org_z = o.z;
  ray.dir_x = d.x, ray.dir_y = d.y, ray.dir_z = d.z;
  ray.tnear = 0;
  ray.tfar = t_max;
  ray.mask = 0xffffffffu;
  return ray;
}

/// Möller & Trumbore 1997 for a triangle known to be hit, in double with IEEE division: Embree's own t, u, v come from
/// reciprocal estimates that differ between CPU makers.
void recompute(Vec3 o, Vec3 d, Vec3 p0, Vec3 p1, Vec3 p2, Hit* hit) {
  struct D3 {
    double x, y, z;
  };
  const auto sub = [](Vec3 a, Vec3 b) {
    return D3{static_cast<double>(a.x) - b.x, static_cast<double>(a.y) - b.y, static_cast<double>(a.z) - b.z};
  };
  const auto cr = [](D3 a, D3 b) { return D3{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; };
  const auto dt = [](D3 a, D3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; };
  const D3 e1 = sub(p1, p0), e2 = sub(p2, p0), s = sub(o, p0), dir{d.x, d.y, d.z};
  const D3 h = cr(dir, e2), q = cr(s, e1);
  const double det = dt(e1, h);
  hit->back = det < 0;
  if (det == 0) return;  // grazing to the last bit: Embree's estimate stands
  double b1 = std::clamp(dt(s, h) / det, 0.0, 1.0);
  double b2 = std::clamp(dt(dir, q) / det, 0.0, 1.0);
  if (const double sum = b1 + b2; sum > 1) b1 /= sum, b2 /= sum;
  hit->t = static_cast<float>(std::max(0.0, dt(e2, q) / det));
  hit->b1 = static_cast<float>(b1);
  hit->b2 = static_cast<float>(b2);
}

/// What a filter is asked about, as no CPU maker has it otherwise.
Hit exact_hit(const RTCFilterFunctionNArguments* args, const GeometryContext& g, uint32_t primitive) {
  const auto& v = g.object->triangles[primitive].v;
  const auto& p = g.object->positions;
  Hit hit;
  hit.t = RTCRayN_tfar(args->ray, args->N, 0);
  hit.b1 = RTCHitN_u(args->hit, args->N, 0);
  hit.b2 = RTCHitN_v(args->hit, args->N, 0);
  recompute({RTCRayN_org_x(args->ray, args->N, 0), RTCRayN_org_y(args->ray, args->N, 0),
             RTCRayN_org_z(args->ray, args->N, 0)},
            {RTCRayN_dir_x(args->ray, args->N, 0), RTCRayN_dir_y(args->ray, args->N, 0),
             RTCRayN_dir_z(args->ray, args->N, 0)},
            p[v[0]], p[v[1]], p[v[2]], &hit);
  return hit;
}

/// By distance, then by the content of what is hit: neither the BVH nor the order of objects shows.
std::pair<float, uint64_t> order_of(const RTCFilterFunctionNArguments* args, const GeometryContext& g,
                                    uint32_t primitive) {
  return {exact_hit(args, g, primitive).t, static_cast<uint64_t>(g.content_rank) << 32 | primitive};
}

bool passes_mask(const RTCFilterFunctionNArguments* args, const GeometryContext& g, uint32_t primitive) {
  if (!g.has_mask) return true;
  const Hit hit = exact_hit(args, g, primitive);
  return opaque_at(*g.scene, *g.object, g.object->triangles[primitive], hit.b1, hit.b2);
}

void filter_closest(const RTCFilterFunctionNArguments* args) {
  const auto& g = *static_cast<const GeometryContext*>(args->geometryUserPtr);
  auto* query = reinterpret_cast<QueryContext*>(args->context);
  const uint32_t primitive = RTCHitN_primID(args->hit, args->N, 0);
  float& t_far = RTCRayN_tfar(args->ray, args->N, 0);
  const bool near_tie = query->nearest && t_far >= query->t * (1 - kTie);
  if ((near_tie && order_of(args, *query->nearest, query->primitive) < order_of(args, g, primitive)) ||
      !passes_mask(args, g, primitive)) {
    args->valid[0] = 0;
    return;
  }
  query->nearest = &g;
  query->primitive = primitive;
  query->t = t_far;
  t_far = std::min(t_far * (1 + kTie), query->t_max);  // so that Embree shows what comes next to it, too
}

void filter_occluded(const RTCFilterFunctionNArguments* args) {
  const auto& g = *static_cast<const GeometryContext*>(args->geometryUserPtr);
  if (!passes_mask(args, g, RTCHitN_primID(args->hit, args->N, 0))) args->valid[0] = 0;
}

}  // namespace

struct RayTracer::Impl {
  std::atomic<int64_t> bytes{0};  // that Embree has, told by itself; before what still tells it while it goes
  const Scene* scene = nullptr;
  RTCDevice device = nullptr;
  RTCScene embree = nullptr;
  std::vector<GeometryContext> contexts;

  ~Impl() {
    if (embree) rtcReleaseScene(embree);
    if (device) rtcReleaseDevice(device);
  }
};

RayTracer::RayTracer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RayTracer::~RayTracer() = default;

absl::StatusOr<std::unique_ptr<RayTracer>> RayTracer::create(const Scene& scene) {
  if (!__builtin_cpu_supports("avx2")) {
    return absl::FailedPreconditionError(
        "this CPU lacks AVX2, which baked bytes are pinned to; use an x86-64-v3 machine");
  }
  auto impl = std::make_unique<Impl>();
  impl->scene = &scene;
  impl->device = rtcNewDevice("isa=avx2");
  if (!impl->device) {
    return absl::InternalError("Embree cannot start (error " + std::to_string(rtcGetDeviceError(nullptr)) + ")");
  }
  const auto count = [](void* bytes, ssize_t change, bool) {
    *static_cast<std::atomic<int64_t>*>(bytes) += change;
    return true;
  };
  rtcSetDeviceMemoryMonitorFunction(impl->device, count, &impl->bytes);
  impl->embree = rtcNewScene(impl->device);
  rtcSetSceneFlags(impl->embree, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(impl->embree, RTC_BUILD_QUALITY_HIGH);

  // Rank objects by content.
  std::vector<uint32_t> by_id(scene.objects.size());
  for (uint32_t i = 0; i < by_id.size(); ++i) by_id[i] = i;
  std::sort(by_id.begin(), by_id.end(), [&](uint32_t a, uint32_t b) {
    return std::pair(scene.objects[a].id, a) < std::pair(scene.objects[b].id, b);
  });
  impl->contexts.resize(scene.objects.size());
  for (uint32_t rank = 0; rank < by_id.size(); ++rank) impl->contexts[by_id[rank]].content_rank = rank;

  for (uint32_t i = 0; i < scene.objects.size(); ++i) {
    const Object& object = scene.objects[i];
    if (!object.is_static || object.triangles.empty()) continue;
    GeometryContext& context = impl->contexts[i];
    context.scene = &scene;
    context.object = &object;
    for (const Triangle& t : object.triangles) {
      if (scene.materials[t.material].alpha_mode == AlphaMode::kMask) context.has_mask = true;
    }
    RTCGeometry geometry = rtcNewGeometry(impl->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<Vec3*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                sizeof(Vec3), object.positions.size()));
    auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(uint32_t), object.triangles.size()));
    if (!vertices || !indices) {
      rtcReleaseGeometry(geometry);
      return absl::ResourceExhaustedError("out of memory for the ray tracer's copy of object '" +
                                          printable(object.name) + "'");
    }
    std::copy(object.positions.begin(), object.positions.end(), vertices);
    for (const Triangle& t : object.triangles) indices = std::copy(t.v.begin(), t.v.end(), indices);
    rtcSetGeometryUserData(geometry, &context);
    rtcSetGeometryIntersectFilterFunction(geometry, filter_closest);
    if (context.has_mask) rtcSetGeometryOccludedFilterFunction(geometry, filter_occluded);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(impl->embree, geometry, i);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(impl->embree);
  if (const RTCError error = rtcGetDeviceError(impl->device); error != RTC_ERROR_NONE) {
    return absl::InternalError("Embree cannot build the scene (error " + std::to_string(error) + ")");
  }
  return std::unique_ptr<RayTracer>(new RayTracer(std::move(impl)));
}

Hit RayTracer::closest(Vec3 origin, Vec3 direction, float t_max) const {
  QueryContext query;
  rtcInitIntersectContext(&query.embree);
  query.t_max = t_max;
  RTCRayHit rayhit{};
  rayhit.ray = make_ray(origin, direction, t_max);
  rayhit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->embree, &query.embree, &rayhit);
  Hit hit;
  if (rayhit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return hit;
  hit.object = rayhit.hit.geomID;
  hit.triangle = rayhit.hit.primID;
  hit.t = query.t;
  hit.b1 = rayhit.hit.u;
  hit.b2 = rayhit.hit.v;
  const Object& object = impl_->scene->objects[hit.object];
  const auto& v = object.triangles[hit.triangle].v;
  recompute(origin, direction, object.positions[v[0]], object.positions[v[1]], object.positions[v[2]], &hit);
  return hit;
}

bool RayTracer::occluded(Vec3 origin, Vec3 direction, float t_max) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray = make_ray(origin, direction, t_max);
  rtcOccluded1(impl_->embree, &context, &ray);
  return ray.tfar < 0;
}

bool RayTracer::visible(Vec3 from, Vec3 to) const { return !occluded(from, to - from, 1.0f); }

const Scene& RayTracer::scene() const { return *impl_->scene; }

uint64_t RayTracer::bytes() const { return static_cast<uint64_t>(std::max<int64_t>(impl_->bytes, 0)); }

Vec3 RayTracer::position(const Hit& hit) const {
  const Object& object = impl_->scene->objects[hit.object];
  return interpolate(object.positions, object.triangles[hit.triangle], hit.b1, hit.b2);
}

Vec3 RayTracer::geometric_normal(const Hit& hit) const {
  const Object& object = impl_->scene->objects[hit.object];
  const auto& v = object.triangles[hit.triangle].v;
  return normalize(
      cross(object.positions[v[1]] - object.positions[v[0]], object.positions[v[2]] - object.positions[v[0]]));
}

float RayTracer::offset(Vec3 p) { return 1e-5f + 2e-5f * std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}); }

}  // namespace lightloom
