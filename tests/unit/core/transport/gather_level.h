// A level with receivers and a few probes, for the tests of the transport.
#pragma once

#include <limits>
#include <memory>
#include <vector>

#include "core/receivers/receivers.h"
#include "core/transport/gather.h"
#include "tests/support/baked_level.h"
#include "tests/support/test_scenes.h"

namespace lightloom::test {

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct GatherLevel {
  GatherLevel(Scene s, std::vector<Vec3> p) : scene(std::move(s)), probes(std::move(p)) {
    tracer = value_or_die(RayTracer::create(scene));
    LayoutOptions options;
    options.texels_per_metre = 4;
    layout = value_or_die(make_layout(scene, options));
    receivers = value_or_die(find_receivers(*tracer, layout, {}));
    for (uint32_t i = 0; i < probes.size(); ++i) ids.push_back(i);
  }
  std::unique_ptr<VisibilityCache> cache(uint64_t budget = VisibilityCache::kDefaultBudget) const {
    return std::make_unique<VisibilityCache>(*tracer, layout, receivers.grids, probes, budget);
  }
  /// All probes; the first `links` of them blended.
  GatherPoint point(uint32_t receiver, uint32_t links, float radius) const {
    GatherPoint p;
    p.point = receivers.all[receiver].point;
    p.from = {p.point, receivers.all[(receiver + 1) % receivers.all.size()].point};
    p.seed = receivers.all[receiver].seed;
    p.near = ids;
    p.links = links;
    p.radius = radius;
    return p;
  }

  Scene scene;
  std::unique_ptr<RayTracer> tracer;
  AtlasLayout layout;
  Receivers receivers;
  std::vector<Vec3> probes;
  std::vector<uint32_t> ids;
};

/// Probes that see each other's surroundings only in part.
inline GatherLevel crate_level() {
  return GatherLevel(room_with_crate(), {{0.5f, 0.5f, 0.5f}, {3.4f, 0.6f, 3.3f}, {2, 2.2f, 2}, {3.3f, 2.5f, 0.6f}});
}

}  // namespace lightloom::test
