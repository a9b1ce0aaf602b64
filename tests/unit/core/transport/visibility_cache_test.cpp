#include "core/transport/visibility_cache.h"

#include <gtest/gtest.h>

#include <map>
#include <thread>

#include "core/base/sampling.h"
#include "tests/unit/core/transport/gather_level.h"

namespace lightloom {
namespace {

using test::crate_level;
using test::GatherLevel;
using test::kInfinity;

struct Found {
  Hit hit;
  ShadingPoint point;
};

/// What rays from the first probe hit.
std::vector<Found> hits_of(const GatherLevel& level, uint32_t count) {
  std::vector<Found> out;
  for (uint32_t i = 0; i < count; ++i) {
    const Hit hit = level.tracer->closest(level.probes[0], sphere_direction(i, count));
    if (!hit) continue;
    out.push_back({hit, shading_point(level.scene.objects[hit.object], hit.triangle, hit.b1, hit.b2, hit.back)});
  }
  return out;
}

TEST(VisibilityCache, AgreesWithRays) {
  const GatherLevel level = crate_level();
  const auto cache = level.cache();
  std::map<VisibilityCache::Verdict, int> verdicts;
  int wrong = 0;
  uint64_t rays = 0;
  for (const Found& f : hits_of(level, 6000)) {
    const VisibilityCache::Patch patch = cache->patch_of(f.hit, f.point);
    if (patch == VisibilityCache::kNoPatch) continue;
    for (uint32_t p = 0; p < level.probes.size(); ++p) {
      const auto verdict = cache->find(patch, p, &rays);
      ++verdicts[verdict];
      const bool seen = level.tracer->visible(f.point.position, level.probes[p]);
      wrong += verdict != VisibilityCache::kSplit && seen != (verdict == VisibilityCache::kSeen);
    }
  }
  EXPECT_EQ(verdicts[VisibilityCache::kUnknown], 0);
  EXPECT_GT(verdicts[VisibilityCache::kSeen], 10000);
  EXPECT_GT(verdicts[VisibilityCache::kHidden], 500);
  EXPECT_GT(verdicts[VisibilityCache::kSplit], 100);
  EXPECT_LT(verdicts[VisibilityCache::kSplit], 2000);
  EXPECT_LT(wrong, 24000 * 0.002);
  EXPECT_GT(rays, 1000u);
}

TEST(VisibilityCache, PatchesAreTexels) {
  // Walls of whole texels, four a metre.
  const GatherLevel level(test::closed_box({2, 2, 2}), {{1, 1, 1}});
  const auto cache = level.cache();
  std::map<VisibilityCache::Patch, std::array<int, 4>> texel_of;
  int missed = 0;
  const auto hits = hits_of(level, 5000);
  for (const Found& f : hits) {
    const auto patch = cache->patch_of(f.hit, f.point);
    if (patch == VisibilityCache::kNoPatch) {
      ++missed;
      continue;
    }
    const Vec3 p = level.tracer->position(f.hit);
    const auto cell = [](float x) { return static_cast<int>(std::min(7.0f, std::max(0.0f, x * 4))); };
    const std::array<int, 4> texel{static_cast<int>(f.hit.object), cell(p.x), cell(p.y), cell(p.z)};
    EXPECT_EQ(texel_of.try_emplace(patch, texel).first->second, texel);
  }
  EXPECT_EQ(texel_of.size(), 6u * 8 * 8);
  EXPECT_LT(missed, 50);
}

TEST(VisibilityCache, SidesHaveTheirOwnPatches) {
  const GatherLevel level(test::open_plane(2, {1, 1, 1}), {{0.1f, 1, 0.1f}, {0.1f, -1, 0.1f}});
  const auto cache = level.cache();
  const auto patch = [&](Vec3 from, Vec3 direction) {
    const Hit hit = level.tracer->closest(from, direction);
    return cache->patch_of(hit, shading_point(level.scene.objects[hit.object], hit.triangle, hit.b1, hit.b2, hit.back));
  };
  const auto front = patch({0.1f, 1, 0.1f}, {0, -1, 0}), back = patch({0.1f, -1, 0.1f}, {0, 1, 0});
  ASSERT_NE(front, VisibilityCache::kNoPatch);
  ASSERT_NE(back, VisibilityCache::kNoPatch);
  EXPECT_NE(front, back);
  uint64_t rays = 0;
  EXPECT_EQ(cache->find(front, 0, &rays), VisibilityCache::kSeen);
  EXPECT_EQ(cache->find(front, 1, &rays), VisibilityCache::kHidden);
  EXPECT_EQ(cache->find(back, 0, &rays), VisibilityCache::kHidden);
  EXPECT_EQ(cache->find(back, 1, &rays), VisibilityCache::kSeen);
}

TEST(VisibilityCache, AnswersAreRememberedAndCountedOnce) {
  const GatherLevel level = crate_level();
  const auto cache = level.cache();
  const auto hits = hits_of(level, 10);
  const auto patch = cache->patch_of(hits[0].hit, hits[0].point);
  ASSERT_NE(patch, VisibilityCache::kNoPatch);
  uint64_t rays = 0;
  const auto verdict = cache->find(patch, 0, &rays);
  EXPECT_GE(rays, 2u);
  EXPECT_LE(rays, 4u);
  const uint64_t first = rays;
  EXPECT_EQ(cache->find(patch, 0, &rays), verdict);
  EXPECT_EQ(rays, first);
}

TEST(VisibilityCache, TheSkyAgreesWithRays) {
  Scene scene = test::open_plane(8, {1, 1, 1});
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  test::add_wall_object(&scene, "fence", {1, 0, -4}, {1, 0, 4}, {1, 3, 4}, {1, 3, -4}, grey);
  test::identify(&scene);
  const GatherLevel level(std::move(scene), {{0, 1, 0}, {2, 0.5f, 1}});
  const auto cache = level.cache();
  int wrong = 0, split = 0, seen = 0;
  uint64_t rays = 0;
  constexpr uint32_t kDirections = 20000;
  for (uint32_t i = 0; i < kDirections; ++i) {
    const Vec3 d = sphere_direction(i, kDirections);
    for (uint32_t p = 0; p < 2; ++p) {
      const auto verdict = cache->find_sky(d, p, &rays);
      const bool open = !level.tracer->occluded(level.probes[p], d, kInfinity);
      split += verdict == VisibilityCache::kSplit;
      seen += verdict == VisibilityCache::kSeen;
      wrong += verdict != VisibilityCache::kSplit && open != (verdict == VisibilityCache::kSeen);
    }
  }
  EXPECT_GT(seen, 10000);
  EXPECT_GT(split, 200);
  EXPECT_LT(split, 3000);
  EXPECT_LT(wrong, 40000 * 0.005);
  EXPECT_LE(rays, 2u * 64 * 64 * 4);
}

TEST(VisibilityCache, KeepsItsBudget) {
  const GatherLevel level = crate_level();
  const auto all = level.cache(), some = level.cache(20000);
  uint64_t rays = 0;
  for (const Found& f : hits_of(level, 3000)) {
    const auto patch = all->patch_of(f.hit, f.point);
    ASSERT_EQ(some->patch_of(f.hit, f.point), patch);
    if (patch == VisibilityCache::kNoPatch) continue;
    for (uint32_t p = 0; p < level.probes.size(); ++p) {
      ASSERT_EQ(some->find(patch, p, &rays), all->find(patch, p, &rays));
    }
    ASSERT_EQ(some->find_sky({0, 1, 0}, 2, &rays), all->find_sky({0, 1, 0}, 2, &rays));
  }
  EXPECT_LE(some->bytes(), 20000u);
  EXPECT_GT(all->bytes(), 40000u);
}

TEST(VisibilityCache, ThreadsFindTheSame) {
  const GatherLevel level = crate_level();
  const auto shared = level.cache(), alone = level.cache();
  const auto hits = hits_of(level, 2000);
  std::vector<std::vector<int>> verdicts(3);
  std::vector<uint64_t> rays(3, 0);
  const auto ask = [&](VisibilityCache* cache, size_t n) {
    for (const Found& f : hits) {
      const auto patch = cache->patch_of(f.hit, f.point);
      for (uint32_t p = 0; p < level.probes.size(); ++p) {
        verdicts[n].push_back(patch == VisibilityCache::kNoPatch ? -1
                                                                 : static_cast<int>(cache->find(patch, p, &rays[n])));
      }
    }
  };
  std::thread one(ask, shared.get(), 0), two(ask, shared.get(), 1);
  one.join();
  two.join();
  ask(alone.get(), 2);
  EXPECT_EQ(verdicts[0], verdicts[2]);
  EXPECT_EQ(verdicts[1], verdicts[2]);
  EXPECT_EQ(rays[0] + rays[1], rays[2]);
}

}  // namespace
}  // namespace lightloom
