#include "core/probes/links.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/rng.h"

namespace lightloom {
namespace {

using Cell = std::array<int32_t, 3>;

Cell cell_of(Vec3 p, float spacing) {
  Cell c;
  for (int a = 0; a < 3; ++a)
    c[static_cast<size_t>(a)] = static_cast<int32_t>(std::floor(static_cast<double>(p[a]) / spacing));
  return c;
}

void sort_by_key(std::vector<Probe>* probes) {
  std::sort(probes->begin(), probes->end(), [](const Probe& a, const Probe& b) { return a.name() < b.name(); });
}

std::vector<ProbeGrid::Near> brute_force(const std::vector<Probe>& probes, float spacing, Vec3 p, int count) {
  const Cell home = cell_of(p, spacing);
  std::vector<ProbeGrid::Near> all;
  for (uint32_t i = 0; i < probes.size(); ++i) {
    int far = 0;
    for (size_t a = 0; a < 3; ++a) far = std::max(far, std::abs(probes[i].cell[a] - home[a]));
    const Vec3 d = probes[i].position - p;
    if (far <= ProbeGrid::kReach) all.push_back({dot(d, d), i});
  }
  std::sort(all.begin(), all.end());
  if (all.size() > static_cast<size_t>(count)) all.resize(static_cast<size_t>(count));
  return all;
}

void expect_equal(const std::vector<ProbeGrid::Near>& a, const std::vector<ProbeGrid::Near>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].probe, b[i].probe) << i;
    ASSERT_EQ(a[i].distance2, b[i].distance2) << i;
  }
}

/// `count` probes in a box of `side` metres about the origin, several per cell.
std::vector<Probe> random_probes(size_t count, float side, float spacing, uint64_t seed) {
  Rng rng(seed);
  std::vector<Probe> probes;
  for (uint32_t i = 0; i < count; ++i) {
    Probe p;
    for (int a = 0; a < 3; ++a) p.position[a] = (rng.next_float() - 0.5f) * side;
    p.cell = cell_of(p.position, spacing);
    p.slot = i;  // keys differ
    probes.push_back(p);
  }
  sort_by_key(&probes);
  return probes;
}

Vec3 random_point(Rng* rng, float side) {
  Vec3 p;
  for (int a = 0; a < 3; ++a) p[a] = (rng->next_float() - 0.5f) * side;
  return p;
}

TEST(ProbeGrid, NearestEqualsBruteForce) {
  Rng rng(1);
  for (const float spacing : {0.3f, 1.0f, 2.5f}) {
    for (const size_t count : {1u, 5u, 60u, 800u}) {
      const auto probes = random_probes(count, 12, spacing, count);
      const ProbeGrid grid(probes, spacing);
      for (int i = 0; i < 60; ++i) {
        const Vec3 p = random_point(&rng, 14);
        for (const int wanted : {1, 7, 22})
          expect_equal(grid.nearest(p, wanted), brute_force(probes, spacing, p, wanted));
      }
    }
  }
}

TEST(ProbeGrid, TiesGoByIndex) {
  // A lattice: from its points and corners, six and eight probes are equally far.
  std::vector<Probe> probes;
  for (int x = -4; x < 4; ++x) {
    for (int y = -4; y < 4; ++y) {
      for (int z = -4; z < 4; ++z) {
        const auto centre = [](int i) { return static_cast<float>(i) + 0.5f; };
        probes.push_back({{centre(x), centre(y), centre(z)}, {x, y, z}, 0});
      }
    }
  }
  const ProbeGrid grid(probes, 1);
  for (const Vec3 p : {Vec3{0, 0, 0}, Vec3{0.5f, 0.5f, 0.5f}, Vec3{1, 0.5f, -1}, Vec3{-4, -4, -4}, Vec3{4, 4, 4}}) {
    for (int count = 1; count <= 40; ++count) expect_equal(grid.nearest(p, count), brute_force(probes, 1, p, count));
  }
}

TEST(ProbeGrid, ProbesAtOnePlace) {
  std::vector<Probe> probes;
  for (uint32_t i = 0; i < 5; ++i) probes.push_back({{0.5f, 0.5f, 0.5f}, {0, 0, 0}, i});
  const ProbeGrid grid(probes, 1);
  const auto near = grid.nearest({0.1f, 0.1f, 0.1f}, 3);
  ASSERT_EQ(near.size(), 3u);
  for (uint32_t i = 0; i < 3; ++i) EXPECT_EQ(near[i].probe, i);
}

TEST(ProbeGrid, FewProbesAreAllFound) {
  const auto probes = random_probes(3, 4, 1, 2);
  EXPECT_EQ(ProbeGrid(probes, 1).nearest({}, 22).size(), 3u);
  EXPECT_TRUE(ProbeGrid({}, 1).nearest({}, 22).empty());
}

TEST(ProbeGrid, ReachEndsAfterEightCells) {
  const std::vector<Probe> probes = {{{8.5f, 0.5f, 0.5f}, {8, 0, 0}, 0}};
  const ProbeGrid grid(probes, 1);
  EXPECT_EQ(grid.nearest({0.5f, 0.5f, 0.5f}, 1).size(), 1u);
  EXPECT_TRUE(grid.nearest({-0.5f, 0.5f, 0.5f}, 1).empty());
}

TEST(ProbeGrid, FarAwayFindsNothing) {
  const auto probes = random_probes(100, 10, 1, 3);
  const ProbeGrid grid(probes, 1);
  for (const float far : {1e3f, 1e6f, 1e9f}) {
    EXPECT_TRUE(grid.nearest({far, 0, 0}, 7).empty());
    EXPECT_TRUE(grid.nearest({0, -far, far}, 7).empty());
  }
}

TEST(ProbeGrid, ALevelFarFromTheOrigin) {
  std::vector<Probe> probes = random_probes(200, 10, 1, 4);
  for (Probe& p : probes) {
    p.position += {-5000, 300, 70000};
    p.cell = cell_of(p.position, 1);
  }
  sort_by_key(&probes);
  const ProbeGrid grid(probes, 1);
  Rng rng(5);
  for (int i = 0; i < 100; ++i) {
    const Vec3 p = random_point(&rng, 10) + Vec3{-5000, 300, 70000};
    expect_equal(grid.nearest(p, 7), brute_force(probes, 1, p, 7));
  }
}

TEST(SpatialWeight, FallsSmoothlyFromOneToZero) {  // SL17 Eq. 10
  EXPECT_EQ(spatial_weight(0), 1);
  EXPECT_EQ(spatial_weight(0.25f), 0.84375f);  // 2/64 − 3/16 + 1
  EXPECT_EQ(spatial_weight(0.5f), 0.5f);
  EXPECT_EQ(spatial_weight(0.75f), 0.15625f);
  EXPECT_EQ(spatial_weight(1), 0);
  EXPECT_EQ(spatial_weight(1.5f), 0);
  for (int i = 0; i < 1000; ++i) {
    const float t = static_cast<float>(i) / 1000;
    EXPECT_GE(spatial_weight(t), spatial_weight(t + 0.001f) - 1e-6f) << t;
    EXPECT_GE(spatial_weight(t), 0) << t;
  }
}

}  // namespace
}  // namespace lightloom
