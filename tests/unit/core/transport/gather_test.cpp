#include "core/transport/gather.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "core/base/sampling.h"
#include "core/probes/links.h"
#include "tests/unit/core/transport/gather_level.h"

namespace lightloom {
namespace {

using test::crate_level;
using test::GatherLevel;
using test::kInfinity;

std::vector<float> row_of(const GatherLevel& level, VisibilityCache* cache, const GatherPoint& point,
                          const GatherOptions& options, GatherStats* stats = nullptr) {
  std::vector<float> row(level.probes.size() * static_cast<size_t>(sh_count(options.order)), 0.0f);
  Gatherer gatherer(*level.tracer, cache, nullptr, {level.probes, level.ids}, options);
  const GatherStats s = gatherer.add_row(point, row);
  if (stats != nullptr) *stats = s;
  return row;
}

TEST(Gather, RaysOfOneStartAreSpreadOverDirections) {
  GatherPoint x;
  for (int i = 0; i < 16; ++i) {
    x.from.push_back({});
    x.from.back().position = {static_cast<float>(i), 0, 0};
    x.from.back().normal = x.from.back().geometric = {0, 1, 0};
  }
  const Strata strata{16, 16};
  Rng rng(1);
  std::vector<std::set<int>> heights(16);
  for (uint32_t r = 0; r < 256; ++r) {
    const GatherRay ray = gather_ray(x, r, strata, &rng);
    EXPECT_GT(ray.direction.y, 0);
    // cos²θ is uniform; each start has one ray in each sixteenth of it, or its neighbour in the mapping of the square.
    heights[static_cast<size_t>(ray.origin.x)].insert(static_cast<int>(16 * ray.direction.y * ray.direction.y));
  }
  for (const auto& h : heights) EXPECT_GE(h.size(), 8u);
}

/// SL17 Eqs. 4 and 7 as they stand, ray by ray, in double.
std::vector<double> row_by_the_book(const GatherLevel& level, const GatherPoint& x, const GatherOptions& options) {
  const size_t J = static_cast<size_t>(sh_count(options.order));
  std::vector<double> row(level.probes.size() * J, 0);
  const Strata strata = strata_of(static_cast<uint32_t>(options.rays));
  Rng rng(x.seed);
  for (uint32_t r = 0; r < static_cast<uint32_t>(options.rays); ++r) {
    const auto [origin, omega] = gather_ray(x, r, strata, &rng);
    const Hit hit = level.tracer->closest(origin, omega);
    ShadingPoint y;
    if (hit) {
      const Object& object = level.scene.objects[hit.object];
      if (hit.back && !level.scene.materials[object.triangles[hit.triangle].material].double_sided) continue;
      y = shading_point(object, hit.triangle, hit.b1, hit.b2, hit.back);
    }
    std::vector<double> weight(level.probes.size(), 0);
    double sum = 0;
    const auto sees = [&, omega = omega](uint32_t i) {  // clang 14 captures no structured binding by itself
      return hit ? level.tracer->visible(y.position, level.probes[i])
                 : !level.tracer->occluded(level.probes[i], omega, kInfinity);
    };
    for (uint32_t n = 0; n < x.links; ++n) {
      const Vec3 p = level.probes[x.near[n]];
      const float distance = length(p - x.point.position);
      double w = x.radius > 0 ? static_cast<double>(spatial_weight(distance / x.radius)) : 1;
      if (!sees(x.near[n])) continue;
      if (options.weigh_by_resolution && hit) {
        const Vec3 d = p - y.position;
        w *= std::max(0.05, static_cast<double>(dot(normalize(d), y.geometric))) / static_cast<double>(dot(d, d));
      }
      weight[x.near[n]] = w;
      sum += w;
    }
    for (uint32_t n = x.links; n < x.near.size() && sum == 0; ++n) {
      if (sees(x.near[n])) weight[x.near[n]] = sum = 1;
    }
    if (sum == 0) continue;
    for (uint32_t i = 0; i < level.probes.size(); ++i) {
      if (weight[i] == 0) continue;
      std::vector<float> basis(J);
      sh_evaluate(options.order, hit ? normalize(y.position - level.probes[i]) : omega, basis);
      for (size_t j = 0; j < J; ++j) {
        row[i * J + j] += static_cast<double>(kPi) / options.rays * weight[i] / sum * static_cast<double>(basis[j]);
      }
    }
  }
  return row;
}

double distance_of(const std::vector<float>& a, const std::vector<double>& b) {
  double d = 0, norm = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    d += (static_cast<double>(a[i]) - b[i]) * (static_cast<double>(a[i]) - b[i]);
    norm += b[i] * b[i];
  }
  return norm > 0 ? std::sqrt(d / norm) : std::sqrt(d);
}

TEST(Gather, AsByTheBook) {
  const GatherLevel level = crate_level();
  for (const bool resolution : {false, true}) {
    for (const uint32_t links : {1u, 3u, 4u}) {
      for (uint32_t r = 0; r < level.receivers.all.size(); r += 37) {
        const GatherOptions options{4, 72, resolution};
        const GatherPoint point = level.point(r, links, links == 3 ? 0.0f : 4.0f);
        const auto expected = row_by_the_book(level, point, options);
        ASSERT_LT(distance_of(row_of(level, nullptr, point, options), expected), 1e-5) << r << " " << links;
      }
    }
  }
}

TEST(Gather, OpenSkyAsByTheBook) {
  Scene scene = test::open_plane(2, {1, 1, 1});
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  test::add_wall_object(&scene, "fence", {0.5f, 0, -1}, {0.5f, 0, 1}, {0.5f, 1, 1}, {0.5f, 1, -1}, grey);
  test::identify(&scene);
  const GatherLevel level(std::move(scene), {{-0.5f, 0.5f, 0}, {0.8f, 0.3f, 0.2f}, {0, 2, 0}});
  for (uint32_t r = 0; r < level.receivers.all.size(); r += 11) {
    const GatherPoint point = level.point(r, 2, 3);
    const GatherOptions options{3, 64, true};
    ASSERT_LT(distance_of(row_of(level, nullptr, point, options), row_by_the_book(level, point, options)), 1e-5) << r;
  }
}

TEST(Gather, TheCacheChangesLittle) {
  const GatherLevel level = crate_level();
  const auto cache = level.cache();
  const GatherOptions options{7, 256, true};
  double different = 0, all = 0, traced = 0, traced_with_cache = 0;
  for (uint32_t r = 0; r < level.receivers.all.size(); ++r) {
    const GatherPoint point = level.point(r, 3, 4);
    GatherStats exact, cached;
    const auto a = row_of(level, nullptr, point, options, &exact),
               b = row_of(level, cache.get(), point, options, &cached);
    for (size_t i = 0; i < a.size(); ++i) {
      different += static_cast<double>((a[i] - b[i]) * (a[i] - b[i]));
      all += static_cast<double>(a[i] * a[i]);
    }
    traced += static_cast<double>(exact.visibility_rays);
    traced_with_cache += static_cast<double>(cached.visibility_rays);
    EXPECT_EQ(exact.gather_rays, 256u);
    EXPECT_EQ(cached.gather_rays, 256u);
  }
  EXPECT_LT(std::sqrt(different / all), 0.005);
  EXPECT_LT(traced_with_cache, 0.2 * traced);
}

TEST(Gather, SameBitsWhateverTheCacheHolds) {
  const GatherLevel level = crate_level();
  const auto fresh = level.cache(), used = level.cache(), none = level.cache(0);
  const GatherOptions options{5, 100, true};
  for (uint32_t r = 0; r < level.receivers.all.size(); r += 3) row_of(level, used.get(), level.point(r, 2, 3), options);
  for (uint32_t r = 0; r < level.receivers.all.size(); r += 41) {
    const GatherPoint point = level.point(r, 3, 4);
    const auto expected = row_of(level, fresh.get(), point, options);
    EXPECT_EQ(row_of(level, used.get(), point, options), expected);
    EXPECT_EQ(row_of(level, none.get(), point, options), expected);
  }
}

TEST(Gather, AClosedRoomOfUniformRadianceGivesPi) {
  const GatherLevel level(test::closed_box({3, 2, 4}), {{1, 1, 1}, {2, 1, 3}});
  const auto cache = level.cache();
  for (uint32_t r = 0; r < level.receivers.all.size(); r += 13) {
    GatherStats stats;
    const auto row = row_of(level, cache.get(), level.point(r, 2, 0), {2, 128, true}, &stats);
    EXPECT_NEAR(static_cast<double>((row[0] + row[9]) * kShUniform), static_cast<double>(kPi), 1e-5);
    EXPECT_EQ(stats.unseen, 0u);
  }
}

TEST(Gather, AddsToTheRowAndStartsAnew) {
  const GatherLevel level = crate_level();
  const GatherOptions options{2, 36, true};
  Gatherer gatherer(*level.tracer, nullptr, nullptr, {level.probes, level.ids}, options);
  std::vector<float> first(4 * 9, 0.0f), again(4 * 9, 0.0f);
  gatherer.add_row(level.point(50, 3, 4), first);
  gatherer.add_row(level.point(90, 4, 0), again);
  std::fill(again.begin(), again.end(), 0.0f);
  gatherer.add_row(level.point(50, 3, 4), again);
  EXPECT_EQ(first, again);
}

TEST(Gather, RingsAddUpToWhatSmallerNearFieldsLeave) {
  const GatherLevel level = crate_level();
  const ReceiverSearch surfaces(*level.tracer, level.layout, level.receivers);
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  constexpr float kReach[] = {0, 0.2f, 0.6f, kInfinity};
  for (uint32_t r = 0; r < level.receivers.all.size(); r += 7) {
    const GatherPoint point = level.point(r, 4, 0);
    Gatherer rings(*level.tracer, nullptr, &surfaces, {level.probes, level.ids}, {2, 256, true, 0.6f, true});
    rings.shoot(point);
    std::vector<float> sum(4 * 9, 0.0f);
    std::vector<NearTexel> nearest;
    for (const size_t k : {2, 1, 0}) {
      rings.add_ring(kReach[k], kReach[k + 1], sum);
      Gatherer whole(*level.tracer, nullptr, &surfaces, {level.probes, level.ids}, {2, 256, true, kReach[k]});
      std::vector<float> row(4 * 9, 0.0f);
      whole.add_row(point, row);
      for (size_t i = 0; i < row.size(); ++i) EXPECT_NEAR(sum[i], row[i], 1e-5f) << "reach " << kReach[k];
      if (k == 1) nearest.assign(whole.near().begin(), whole.near().end());
    }
    ASSERT_EQ(rings.near().size(), nearest.size());
    for (size_t i = 0; i < nearest.size(); ++i) {
      EXPECT_EQ(rings.near()[i].receiver, nearest[i].receiver);
      EXPECT_EQ(rings.near()[i].rays, nearest[i].rays);
    }
  }
}

TEST(Gather, WhatIsNearIsReadFromItsOwnTexel) {
  const GatherLevel level = crate_level();
  const ReceiverSearch surfaces(*level.tracer, level.layout, level.receivers);
  const GatherOptions far{2, 256, true}, near{2, 256, true, 0.5f};
  uint64_t near_rays = 0;
  for (uint32_t r = 0; r < level.receivers.all.size(); r += 7) {
    const GatherPoint point = level.point(r, 4, 0);
    Gatherer gatherer(*level.tracer, nullptr, &surfaces, {level.probes, level.ids}, near);
    std::vector<float> row(4 * 9, 0.0f);
    const GatherStats stats = gatherer.add_row(point, row);

    // Its rays again, by hand.
    std::map<uint32_t, uint32_t> expected;
    Rng rng(point.seed);
    uint64_t rays = 0;
    for (uint32_t i = 0; i < 256; ++i) {
      const GatherRay ray = gather_ray(point, i, strata_of(256), &rng);
      const Hit hit = level.tracer->closest(ray.origin, ray.direction);
      if (!hit || hit.t >= 0.5f) continue;
      const uint32_t texel = surfaces.locate(hit);
      ASSERT_NE(texel, Receivers::kNone);
      ++expected[texel];
      ++rays;
    }
    ASSERT_EQ(gatherer.near().size(), expected.size());
    for (const NearTexel& n : gatherer.near()) EXPECT_EQ(n.rays, expected.at(n.receiver));
    near_rays += rays;

    // The uniform field 1: what is not near comes from the probes.
    double uniform = 0;
    for (size_t p = 0; p < 4; ++p) uniform += static_cast<double>(row[p * 9] * kShUniform);
    const double seen = 1 - static_cast<double>(rays + stats.unseen) / 256;
    EXPECT_NEAR(uniform, static_cast<double>(kPi) * seen, 1e-5);
    if (rays == 0) {
      EXPECT_EQ(row, row_of(level, nullptr, point, far));
    }
  }
  EXPECT_GT(near_rays, 100u);
}

TEST(Gather, WhatNoProbeSeesIsCounted) {
  // The only probe is outside.
  const GatherLevel level(test::closed_box({2, 2, 2}), {{9, 9, 9}});
  GatherStats stats;
  const auto row = row_of(level, nullptr, level.point(5, 1, 0), {1, 64, true}, &stats);
  EXPECT_EQ(stats.unseen, 64u);
  EXPECT_EQ(row, std::vector<float>(4, 0.0f));
}

}  // namespace
}  // namespace lightloom
