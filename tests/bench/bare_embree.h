// The floor of every bake: closest hits and nothing else.
#pragma once

#include <embree3/rtcore.h>

#include <algorithm>
#include <cstdint>
#include <limits>

#include "core/scene/scene.h"
#include "core/transport/gather.h"

namespace lightloom::bench {

/// Embree as RayTracer sets it up, without what RayTracer does to a hit.
class BareEmbree {
 public:
  explicit BareEmbree(const Scene& scene) : device_(rtcNewDevice("isa=avx2")), scene_(rtcNewScene(device_)) {
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
    for (const Object& object : scene.objects) {
      if (!object.is_static || object.triangles.empty()) continue;
      RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
      auto* vertices = static_cast<Vec3*>(rtcSetNewGeometryBuffer(
          geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3), object.positions.size()));
      auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(
          geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), object.triangles.size()));
      std::copy(object.positions.begin(), object.positions.end(), vertices);
      for (const Triangle& t : object.triangles) indices = std::copy(t.v.begin(), t.v.end(), indices);
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(scene_, geometry);
      rtcReleaseGeometry(geometry);
    }
    rtcCommitScene(scene_);
  }
  ~BareEmbree() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  BareEmbree(const BareEmbree&) = delete;
  BareEmbree& operator=(const BareEmbree&) = delete;

  bool hits(Vec3 o, Vec3 d) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit ray{};
    ray.ray.org_x = o.x, ray.ray.org_y = o.y, ray.ray.org_z = o.z;
    ray.ray.dir_x = d.x, ray.ray.dir_y = d.y, ray.ray.dir_z = d.z;
    ray.ray.tfar = std::numeric_limits<float>::infinity();
    ray.ray.mask = 0xffffffffu;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene_, &context, &ray);
    return ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
  }
  /// Of the rays that a Gatherer would shoot.
  uint64_t hits(const GatherPoint& receiver, Strata strata) const {
    uint64_t found = 0;
    Rng rng(receiver.seed);
    for (uint32_t r = 0; r < strata.columns * strata.rows; ++r) {
      const GatherRay ray = gather_ray(receiver, r, strata, &rng);
      found += hits(ray.origin, ray.direction);
    }
    return found;
  }

 private:
  RTCDevice device_;
  RTCScene scene_;
};

}  // namespace lightloom::bench
