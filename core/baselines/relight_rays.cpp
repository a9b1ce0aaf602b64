#include "core/baselines/relight_rays.h"

#include <algorithm>
#include <cstring>
#include <map>

#include "core/bake/tasks.h"
#include "core/base/check.h"
#include "core/baselines/lanes.h"

namespace lightloom {
namespace {

/// Groups × 8 columns at once: their sums stay in registers.
template <size_t Groups>
void project_columns(std::span<const uint32_t> elements, const Vec3* radiance, const float* weights, size_t stride,
                     float* out) {
  Lanes sum[3][Groups] = {};
  for (size_t r = 0; r < elements.size(); ++r, weights += stride) {
    const Vec3 l = radiance[elements[r]];
    for (size_t g = 0; g < Groups; ++g) {
      const Lanes w = load_lanes(weights + g * kLanes);
      sum[0][g] += w * l.x;
      sum[1][g] += w * l.y;
      sum[2][g] += w * l.z;
    }
  }
  for (size_t c = 0; c < 3; ++c) std::memcpy(out + c * stride, sum[c], sizeof sum[c]);
}

}  // namespace

absl::StatusOr<RelightRays> RelightRays::trace(const RayTracer& tracer, const Plan& plan, std::span<const Vec3> probes,
                                               const BakeControl& control) {
  const Scene& scene = tracer.scene();
  RelightRays out;
  out.count_ = static_cast<uint32_t>(plan.params.relight_rays);
  out.sky_ = static_cast<uint32_t>(plan.receivers.all.size());
  out.elements_.resize(probes.size() * out.count_);
  std::map<Digest, uint32_t> object_of;
  for (uint32_t o = 0; o < scene.objects.size(); ++o) object_of[scene.objects[o].id] = o;
  const ReceiverSearch search(tracer, plan.layout, plan.receivers);
  const bool done = parallel_for(probes.size(), control.stage("relight rays"), [&](uint64_t p) {
    const RelightChunk chunk = bake_relight(tracer, plan, search, probes[p]).chunk;
    // Rays are numbered by the sides of the chunk's objects, one after the other.
    std::vector<uint32_t> ends, objects;
    uint32_t end = 0;
    for (const ChunkObject& object : chunk.objects) {
      ends.push_back(end += 2 * object.width * object.height);
      objects.push_back(object_of.at(object.id));
    }
    for (size_t r = 0; r < chunk.rays.size(); ++r) {
      const uint32_t ray = chunk.rays[r];
      uint32_t& element = out.elements_[p * out.count_ + r];
      if (ray == RelightChunk::kSky || ray == RelightChunk::kDead) {
        element = ray == RelightChunk::kSky ? out.sky_ : out.sky_ + 1;
        continue;
      }
      const size_t o = static_cast<size_t>(std::upper_bound(ends.begin(), ends.end(), ray) - ends.begin());
      element = plan.receivers.find(objects[o], ray - (o > 0 ? ends[o - 1] : 0));
      LL_CHECK(element != Receivers::kNone);
    }
  });
  if (!done) return absl::CancelledError("cancelled while tracing relight rays");
  return out;
}

void RelightRays::project(uint32_t probe, std::span<const Vec3> radiance, std::span<const float> weights, size_t stride,
                          std::span<float> out) const {
  LL_CHECK(stride % kLanes == 0 && weights.size() == count_ * stride && radiance.size() == sky_ + size_t{2} &&
           out.size() == 3 * stride);
  const std::span<const uint32_t> elements = of(probe);
  for (size_t k = 0; k < stride;) {
    const auto columns = [&]<size_t Groups>() {
      project_columns<Groups>(elements, radiance.data(), weights.data() + k, stride, out.data() + k);
      k += Groups * kLanes;
    };
    switch ((stride - k) / kLanes) {
      case 1:
        columns.template operator()<1>();
        break;
      case 2:
        columns.template operator()<2>();
        break;
      case 3:
        columns.template operator()<3>();
        break;
      case 4:
        columns.template operator()<4>();
        break;
      default:
        columns.template operator()<5>();
    }
  }
}

}  // namespace lightloom
