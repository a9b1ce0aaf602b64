#include "core/receivers/texels.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "core/base/rng.h"
#include "core/scene/shapes.h"

namespace lightloom {
namespace {

struct Mapped {
  Object object;
  LightmapUv uv;
};

Vec2 uv_at(const LightmapUv& uv, uint32_t triangle, float b1, float b2) {
  const auto& c = uv.corners[triangle];
  return c[0] * (1 - b1 - b2) + c[1] * b1 + c[2] * b2;
}

/// A quad of 2 m × 1 m over texels [x0, x1] × [y0, y1].
Mapped quad(int width, int height, float x0, float y0, float x1, float y1) {
  Mapped m;
  add_quad(&m.object, {0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}, 0);
  m.uv = {width, height, {{{{x0, y0}, {x1, y0}, {x1, y1}}}, {{{x0, y0}, {x1, y1}, {x0, y1}}}}};
  return m;
}

double triangle_area(const Object& object, uint32_t t) {
  const auto& v = object.triangles[t].v;
  return static_cast<double>(length(
             cross(object.positions[v[1]] - object.positions[v[0]], object.positions[v[2]] - object.positions[v[0]]))) /
         2;
}

double world_area(const Object& object) {
  double sum = 0;
  for (uint32_t t = 0; t < object.triangles.size(); ++t) sum += triangle_area(object, t);
  return sum;
}

/// A height field over all of a width × height lightmap, its inner vertices moved at random: no uv triangle
/// is like another, they cover every texel once, and area per texel differs from triangle to triangle.
Mapped random_patchwork(int width, int height, int cells, Rng* rng) {
  Mapped m;
  m.uv.width = width;
  m.uv.height = height;
  std::vector<Vec2> vertices;
  std::vector<Vec3> positions;
  const auto at = [&](int i, int j) { return static_cast<size_t>(j * (cells + 1) + i); };
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i) {
      const auto along = [&](int k) {
        const float jitter = k == 0 || k == cells ? 0 : 0.6f * (rng->next_float() - 0.5f);
        return (static_cast<float>(k) + jitter) / static_cast<float>(cells);
      };
      vertices.push_back({along(i) * static_cast<float>(width), along(j) * static_cast<float>(height)});
      positions.push_back({static_cast<float>(i), rng->next_float(), static_cast<float>(j)});
    }
  }
  for (int j = 0; j < cells; ++j) {
    for (int i = 0; i < cells; ++i) {
      const size_t a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
      for (const std::array<size_t, 3>& t : {std::array{a, b, c}, std::array{a, c, d}}) {
        add_triangle(&m.object, positions[t[0]], positions[t[1]], positions[t[2]], 0);
        m.uv.corners.push_back({vertices[t[0]], vertices[t[1]], vertices[t[2]]});
      }
    }
  }
  return m;
}

/// Independent of the code under test: signs of three edge functions. NaN-free; edges count as inside.
bool inside(const std::array<Vec2, 3>& c, double x, double y) {
  int positive = 0, negative = 0;
  for (size_t i = 0; i < 3; ++i) {
    const Vec2 a = c[i], b = c[(i + 1) % 3];
    const double e = (double{b.x} - a.x) * (y - double{a.y}) - (double{b.y} - a.y) * (x - double{a.x});
    positive += e > 0;
    negative += e < 0;
  }
  return (positive == 0 || negative == 0) && positive + negative > 0;
}

TEST(Rasterise, QuadOnWholeTexels) {
  const Mapped m = quad(8, 6, 2, 1, 6, 4);
  const TexelGrid grid = rasterise(m.object, m.uv);
  EXPECT_EQ(grid.width, 8);
  EXPECT_EQ(grid.height, 6);
  ASSERT_EQ(grid.texels.size(), 12u);
  size_t i = 0;
  for (uint32_t y = 1; y < 4; ++y) {  // in row order
    for (uint32_t x = 2; x < 6; ++x, ++i) {
      const Texel& texel = grid.texels[i];
      EXPECT_EQ(texel.x, x);
      EXPECT_EQ(texel.y, y);
      EXPECT_TRUE(texel.centre_covered);
      EXPECT_NEAR(texel.area, 2.0f / 12, 1e-5f);
      const Vec2 point = uv_at(m.uv, texel.triangle, texel.b1, texel.b2);
      EXPECT_NEAR(point.x, static_cast<float>(x) + 0.5f, 1e-5f);
      EXPECT_NEAR(point.y, static_cast<float>(y) + 0.5f, 1e-5f);
    }
  }
}

TEST(Rasterise, HalfCoveredBorder) {
  // Columns 1 and 4 are covered by a quarter: kept, without their centres. The centroid stands for them.
  const Mapped m = quad(6, 2, 1.75f, 0, 4.25f, 2);
  const TexelGrid grid = rasterise(m.object, m.uv);
  ASSERT_EQ(grid.texels.size(), 8u);
  for (const Texel& texel : grid.texels) {
    const bool border = texel.x == 1 || texel.x == 4;
    EXPECT_EQ(texel.centre_covered, !border);
    EXPECT_NEAR(texel.area, (border ? 0.25f : 1.0f) * 2 / 5, 1e-5f);
    const Vec2 point = uv_at(m.uv, texel.triangle, texel.b1, texel.b2);
    EXPECT_GE(point.x, 1.75f);
    EXPECT_LE(point.x, 4.25f);
    EXPECT_EQ(std::floor(point.x), static_cast<float>(texel.x));
    EXPECT_EQ(std::floor(point.y), static_cast<float>(texel.y));
  }
}

TEST(Rasterise, DropsSlivers) {
  // A thirty-second of columns 0 and 3.
  const Mapped m = quad(4, 1, 0.96875f, 0, 3.03125f, 1);
  const TexelGrid grid = rasterise(m.object, m.uv);
  ASSERT_EQ(grid.texels.size(), 2u);
  EXPECT_EQ(grid.texels[0].x, 1u);
  EXPECT_EQ(grid.texels[1].x, 2u);
}

TEST(Rasterise, AreasAddUp) {
  Rng rng(1);
  for (int round = 0; round < 12; ++round) {
    const Mapped m = random_patchwork(5 + 7 * (round % 4), 9 + 5 * (round % 3), 2 + 3 * round, &rng);
    const TexelGrid grid = rasterise(m.object, m.uv);
    EXPECT_EQ(grid.texels.size(), static_cast<size_t>(m.uv.width * m.uv.height)) << "all texels are covered";
    const double expected = world_area(m.object);
    double texels = 0, fragments = 0;
    std::map<uint32_t, double> by_triangle;
    for (const Texel& texel : grid.texels) texels += static_cast<double>(texel.area);
    for (const Fragment& f : grid.fragments) {
      fragments += static_cast<double>(f.area);
      by_triangle[f.triangle] += static_cast<double>(f.area);
    }
    EXPECT_NEAR(texels, expected, 1e-4 * expected);
    EXPECT_NEAR(fragments, expected, 1e-4 * expected);
    for (const auto& [t, area] : by_triangle) EXPECT_NEAR(area, triangle_area(m.object, t), 1e-4 * (area + 0.01)) << t;
    EXPECT_EQ(by_triangle.size(), m.object.triangles.size());
  }
}

TEST(Rasterise, KnowsWhichCentresAreCovered) {
  Rng rng(2);
  for (int round = 0; round < 50; ++round) {
    // A few loose triangles, some sharing texels.
    Mapped m;
    m.uv.width = m.uv.height = 16;
    for (int t = 0; t < 3; ++t) {
      const auto random = [&] { return Vec2{rng.next_float() * 16, rng.next_float() * 16}; };
      add_triangle(&m.object, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0);
      m.uv.corners.push_back({random(), random(), random()});
    }
    const TexelGrid grid = rasterise(m.object, m.uv);
    std::map<std::pair<uint32_t, uint32_t>, const Texel*> found;
    for (const Texel& texel : grid.texels) found[{texel.x, texel.y}] = &texel;
    for (uint32_t y = 0; y < 16; ++y) {
      for (uint32_t x = 0; x < 16; ++x) {
        bool covered = false;
        for (const auto& c : m.uv.corners) covered |= inside(c, x + 0.5, y + 0.5);
        const auto it = found.find({x, y});
        EXPECT_EQ(it != found.end() && it->second->centre_covered, covered) << x << ' ' << y;
        if (it == found.end() || !covered) continue;
        EXPECT_TRUE(inside(m.uv.corners[it->second->triangle], x + 0.5, y + 0.5)) << "the centre's own triangle";
      }
    }
  }
}

TEST(Rasterise, TinyTrianglesHaveATexel) {
  Rng rng(3);
  Mapped m;
  m.uv.width = m.uv.height = 32;
  for (int t = 0; t < 200; ++t) {
    const Vec2 p{rng.next_float() * 31.9f, rng.next_float() * 31.9f};
    const float size = t % 4 == 0 ? 0 : 0.05f * rng.next_float();  // each fourth is a point
    add_triangle(&m.object, {0, 0, 0}, {0.1f, 0, 0}, {0, 0.1f, 0}, 0);
    m.uv.corners.push_back({p, p + Vec2{size, 0}, p + Vec2{0, size}});
  }
  const TexelGrid grid = rasterise(m.object, m.uv);
  std::vector<bool> owned(200, false);
  for (const Texel& texel : grid.texels) {
    ASSERT_LE(texel.first_fragment + texel.fragments, grid.fragments.size());
    for (uint32_t f = 0; f < texel.fragments; ++f) {
      const uint32_t t = grid.fragments[texel.first_fragment + f].triangle;
      const Vec2 p = m.uv.corners[t][0];
      // Those that cross into the next texel lie in either.
      if (std::abs(std::floor(p.x) - static_cast<float>(texel.x)) <= 1 &&
          std::abs(std::floor(p.y) - static_cast<float>(texel.y)) <= 1) {
        owned[t] = true;
      }
    }
  }
  for (size_t t = 0; t < owned.size(); ++t) EXPECT_TRUE(owned[t]) << t;
}

TEST(Rasterise, KeepsWhatLiesOnTheLastEdge) {
  Mapped m;
  m.uv.width = m.uv.height = 4;
  add_triangle(&m.object, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0);
  m.uv.corners.push_back({Vec2{4, 4}, {4, 4}, {4, 4}});
  const TexelGrid grid = rasterise(m.object, m.uv);
  ASSERT_EQ(grid.texels.size(), 1u);
  EXPECT_EQ(grid.texels[0].x, 3u);
  EXPECT_EQ(grid.texels[0].y, 3u);
}

struct Moments {
  double x = 0, y = 0, xx = 0, yy = 0;
};

/// Mean position, in texels, of many samples of a texel; checks that each lies in it.
Moments sample_many(const Mapped& m, const TexelGrid& grid, const Texel& texel, Footprint footprint) {
  constexpr uint32_t kSide = 64;
  Rng rng(5);
  Moments sum;
  for (uint32_t i = 0; i < kSide * kSide; ++i) {
    const SurfacePoint s = sample_texel(m.object, m.uv, grid, texel, stratified(i, kSide, &rng), footprint);
    EXPECT_GE(s.b1, 0);
    EXPECT_GE(s.b2, 0);
    EXPECT_LE(s.b1 + s.b2, 1.000001f);
    const Vec2 p = uv_at(m.uv, s.triangle, s.b1, s.b2);
    if (footprint == Footprint::kTexel) {
      EXPECT_GE(p.x, static_cast<float>(texel.x) - 1e-4f);
      EXPECT_LE(p.x, static_cast<float>(texel.x) + 1 + 1e-4f);
      EXPECT_GE(p.y, static_cast<float>(texel.y) - 1e-4f);
      EXPECT_LE(p.y, static_cast<float>(texel.y) + 1 + 1e-4f);
    } else {
      EXPECT_EQ(s.triangle, texel.triangle);
    }
    sum.x += static_cast<double>(p.x);
    sum.y += static_cast<double>(p.y);
    sum.xx += static_cast<double>(p.x) * static_cast<double>(p.x);
    sum.yy += static_cast<double>(p.y) * static_cast<double>(p.y);
  }
  for (double* s : {&sum.x, &sum.y, &sum.xx, &sum.yy}) *s /= kSide * kSide;
  sum.xx -= sum.x * sum.x;
  sum.yy -= sum.y * sum.y;
  return sum;
}

TEST(SampleTexel, UniformOverAWholeTexel) {
  const Mapped m = quad(8, 6, 2, 1, 6, 4);  // the diagonal cuts texels
  const TexelGrid grid = rasterise(m.object, m.uv);
  for (const Texel& texel : grid.texels) {
    const Moments mean = sample_many(m, grid, texel, Footprint::kTexel);
    EXPECT_NEAR(mean.x, texel.x + 0.5, 2e-3);
    EXPECT_NEAR(mean.y, texel.y + 0.5, 2e-3);
    EXPECT_NEAR(mean.xx, 1.0 / 12, 2e-3);
    EXPECT_NEAR(mean.yy, 1.0 / 12, 2e-3);
  }
}

TEST(SampleTexel, UniformOverThePartThatIsCovered) {
  // One texel, its lower left half: the centroid of the triangle.
  Mapped m;
  add_triangle(&m.object, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0);
  m.uv = {1, 1, {{{{0, 0}, {1, 0}, {0, 1}}}}};
  const TexelGrid grid = rasterise(m.object, m.uv);
  ASSERT_EQ(grid.texels.size(), 1u);
  EXPECT_NEAR(grid.texels[0].area, 0.5f, 1e-6f);
  const Moments mean = sample_many(m, grid, grid.texels[0], Footprint::kTexel);
  EXPECT_NEAR(mean.x, 1.0 / 3, 0.01);
  EXPECT_NEAR(mean.y, 1.0 / 3, 0.01);
  EXPECT_NEAR(mean.xx, 1.0 / 18, 0.005);
}

TEST(SampleTexel, StaysInEachTexelOfAPatchwork) {
  Rng rng(6);
  const Mapped m = random_patchwork(6, 5, 9, &rng);
  const TexelGrid grid = rasterise(m.object, m.uv);
  for (const Texel& texel : grid.texels) sample_many(m, grid, texel, Footprint::kTexel);
}

TEST(SampleTexel, KeepsToItsOwnSurface) {
  // Two walls of a corner share a texel; its point lies on the larger part.
  Mapped m;
  add_triangle(&m.object, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0);
  add_triangle(&m.object, {0, 0, 0}, {0, 0, 1}, {0, 1, 0}, 0);
  m.uv = {1, 1, {{{{0, 0}, {1, 0}, {0, 1}}}, {{{1, 1}, {0.4f, 1}, {1, 0.4f}}}}};
  const TexelGrid grid = rasterise(m.object, m.uv);
  ASSERT_EQ(grid.texels.size(), 1u);
  ASSERT_EQ(grid.texels[0].triangle, 0u);
  Rng rng(8);
  for (uint32_t i = 0; i < 1024; ++i) {
    const Sample2 jitter = stratified(i, 32, &rng);
    EXPECT_EQ(sample_texel(m.object, m.uv, grid, grid.texels[0], jitter).triangle, 0u);
  }
}

TEST(SampleTexel, AsCycles) {
  // Well inside a triangle: the middle half of the texel, uniformly.
  Mapped m;
  add_triangle(&m.object, {0, 0, 0}, {16, 0, 0}, {0, 16, 0}, 0);
  m.uv = {16, 16, {{{{0, 0}, {16, 0}, {0, 16}}}}};
  TexelGrid grid = rasterise(m.object, m.uv);
  for (const Texel& texel : grid.texels) {
    if (!texel.centre_covered) continue;
    const Moments mean = sample_many(m, grid, texel, Footprint::kCycles);
    if (texel.x + texel.y > 12) continue;  // cut by the hypotenuse: inside the triangle is all we ask
    EXPECT_NEAR(mean.x, texel.x + 0.5, 2e-3);
    EXPECT_NEAR(mean.y, texel.y + 0.5, 2e-3);
    EXPECT_NEAR(mean.xx, 1.0 / 48, 1e-3);
    EXPECT_NEAR(mean.yy, 1.0 / 48, 1e-3);
  }

  Rng rng(9);
  const Mapped patchwork = random_patchwork(6, 5, 9, &rng);
  grid = rasterise(patchwork.object, patchwork.uv);
  for (const Texel& texel : grid.texels) {
    if (texel.centre_covered) sample_many(patchwork, grid, texel, Footprint::kCycles);
  }
}

TEST(GeometricNormal, FollowsTheWinding) {
  Object object;
  add_triangle(&object, {0, 0, 0}, {2, 0, 0}, {0, 3, 0}, 0);
  add_triangle(&object, {0, 0, 0}, {0, 3, 0}, {2, 0, 0}, 0);
  EXPECT_EQ(geometric_normal(object, 0), (Vec3{0, 0, 1}));
  EXPECT_EQ(geometric_normal(object, 1), (Vec3{0, 0, -1}));
}

}  // namespace
}  // namespace lightloom
