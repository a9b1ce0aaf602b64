#include "core/receivers/atlas.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "tests/unit/receivers/shapes.h"
#include "tests/unit/receivers/uv_oracle.h"

namespace lightloom {
namespace {

struct Result {
  LightmapUv uv;
  AtlasStats stats;
};

Result atlas_of(const Object& object, float texels_per_metre) {
  AtlasOptions options;
  options.texels_per_metre = texels_per_metre;
  Result result;
  absl::StatusOr<LightmapUv> uv = generate_atlas(object, options, &result.stats);
  EXPECT_TRUE(uv.ok()) << uv.status();
  if (uv.ok()) result.uv = *std::move(uv);
  return result;
}

struct Typical {
  const char* name;
  Object object;
  float texels_per_metre;
  double min_density, max_density;  // of the wanted; projection shrinks curved charts, by 0.7 at most
  int max_charts;
};

std::vector<Typical> typical() {
  return {
      {"cube", shapes::box({0, 0, 0}, {1, 1, 1}), 8, 0.999, 1.001, 6},
      {"box", shapes::box({-1, 0, 4}, {2, 1.3f, 4.7f}), 20, 0.9, 1.1, 6},
      {"plane", shapes::plane(7, 3), 8, 0.999, 1.001, 1},
      {"coarse sphere", shapes::sphere(1, 16), 8, 0.75, 1, 30},
      {"sphere", shapes::sphere(1, 16), 40, 0.75, 1, 30},
      {"fine sphere", shapes::sphere(2, 64), 16, 0.75, 1, 30},
      {"column", shapes::column(0.4f, 3, 24), 10, 0.8, 1.1, 8},
      {"fine column", shapes::column(0.4f, 3, 24), 40, 0.8, 1.1, 8},
      {"room", shapes::l_room(), 8, 0.999, 1.001, 9},
      {"ramp", shapes::ramp(3), 8, 0.9, 1.1, 8},
  };
}

TEST(Atlas, TypicalObjectsAreLaidOutWell) {
  for (const Typical& t : typical()) {
    SCOPED_TRACE(t.name);
    const Result r = atlas_of(t.object, t.texels_per_metre);
    EXPECT_EQ(oracle::defects(t.object, r.uv), "");
    EXPECT_GE(r.stats.utilisation, 0.6f);
    EXPECT_LE(r.stats.utilisation, 1.0f);
    EXPECT_GE(r.stats.charts, 1);
    EXPECT_LE(r.stats.charts, t.max_charts);
    const double wanted = double{t.texels_per_metre} * t.texels_per_metre;
    EXPECT_GE(oracle::density(t.object, r.uv), t.min_density * wanted);
    EXPECT_LE(oracle::density(t.object, r.uv), t.max_density * wanted);
    EXPECT_LT(std::max(r.uv.width, r.uv.height), 4 * std::min(r.uv.width, r.uv.height));
  }
}

TEST(Atlas, UtilisationCountsCoveredTexelsAndTheirGutter) {
  for (const Typical& t : typical()) {
    SCOPED_TRACE(t.name);
    const Result r = atlas_of(t.object, t.texels_per_metre);
    std::set<std::pair<int, int>> used;
    for (const auto& corners : r.uv.corners) {
      oracle::for_each_texel(r.uv, corners, [&](int x, int y) {
        if (!oracle::inside(corners, x + 0.5, y + 0.5)) return;
        for (int k = 0; k < 9; ++k) used.insert({x - 1 + k % 3, y - 1 + k / 3});
      });
    }
    // Centres on an edge between two triangles are strictly inside neither: these may be missing here.
    EXPECT_NEAR(static_cast<double>(used.size()) / (r.uv.width * r.uv.height), r.stats.utilisation, 0.02);
  }
}

TEST(Atlas, AFlatRectangleFillsItsTexelsExactly) {
  const Result r = atlas_of(shapes::plane(1, 1), 8);
  EXPECT_EQ(r.uv.width, 10);
  EXPECT_EQ(r.uv.height, 10);
  EXPECT_FLOAT_EQ(r.stats.utilisation, 1);
  std::set<std::pair<float, float>> corners;
  for (const auto& t : r.uv.corners) {
    for (Vec2 p : t) corners.insert({p.x, p.y});
  }
  EXPECT_EQ(corners, (std::set<std::pair<float, float>>{{1, 1}, {1, 9}, {9, 1}, {9, 9}}));
}

TEST(Atlas, ATurnedRectangleFillsItsTexelsToo) {
  // 5 m × 10 m turned by the 3-4-5 triangle.
  Object o;
  shapes::add_quad(&o, {0, 0, 0}, {3, 0, 4}, {11, 0, -2}, {8, 0, -6});
  const Result r = atlas_of(o, 4);
  EXPECT_EQ(r.uv.width, 42);
  EXPECT_EQ(r.uv.height, 22);
  EXPECT_NEAR(oracle::density(o, r.uv), 16, 1e-4);
}

TEST(Atlas, TexelScaleMultipliesDensity) {
  Object o = shapes::plane(2, 2);
  o.texel_scale = 0.5f;
  EXPECT_EQ(atlas_of(o, 8).uv.width, 10);
}

TEST(Atlas, GutterIsAsAsked) {
  AtlasOptions options;
  options.gutter = 3;
  const auto uv = generate_atlas(shapes::plane(1, 1), options);
  ASSERT_TRUE(uv.ok());
  EXPECT_EQ(uv->width, 8 + 6);
}

TEST(Atlas, SameBytesTwice) {
  for (const Typical& t : typical()) {
    SCOPED_TRACE(t.name);
    const Result a = atlas_of(t.object, t.texels_per_metre), b = atlas_of(t.object, t.texels_per_metre);
    EXPECT_EQ(a.uv.width, b.uv.width);
    EXPECT_EQ(a.uv.height, b.uv.height);
    EXPECT_EQ(a.uv.corners, b.uv.corners);
  }
}

TEST(Atlas, IndexingDoesNotMatter) {
  // The same cube with shared corners: adjacency comes from positions.
  const Object separate = shapes::box({0, 0, 0}, {1, 1, 1});
  Object shared = separate;
  shared.positions.clear();
  for (Triangle& t : shared.triangles) {
    for (uint32_t& v : t.v) {
      const Vec3 p = separate.positions[v];
      const auto it = std::find(shared.positions.begin(), shared.positions.end(), p);
      v = static_cast<uint32_t>(it - shared.positions.begin());
      if (it == shared.positions.end()) shared.positions.push_back(p);
    }
  }
  ASSERT_EQ(shared.positions.size(), 8u);
  EXPECT_EQ(atlas_of(shared, 8).uv.corners, atlas_of(separate, 8).uv.corners);
}

TEST(Atlas, ARampOverItselfIsSplitByTurns) {
  const Object o = shapes::ramp(8);
  const Result r = atlas_of(o, 8);
  EXPECT_GE(r.stats.charts, 8);
  EXPECT_LE(r.stats.charts, 16);
  EXPECT_EQ(oracle::defects(o, r.uv), "");
}

TEST(Atlas, CoincidentTrianglesGetChartsOfTheirOwn) {
  Object o;
  for (int i = 0; i < 20; ++i) shapes::add_triangle(&o, {0, 0, 0}, {1, 0, 0}, {0, 0, 1});
  const Result r = atlas_of(o, 8);
  EXPECT_EQ(r.stats.charts, 20);
  EXPECT_EQ(oracle::defects(o, r.uv), "");
}

TEST(Atlas, AFoldedSheetIsSplit) {
  // Two leaves joined by a steep strip: the upper leaf hangs over the lower one.
  Object o;
  shapes::add_quad(&o, {0, 0, 0}, {0, 0, 2}, {2, 0, 2}, {2, 0, 0});
  shapes::add_quad(&o, {2, 0, 0}, {2, 0, 2}, {1, 0.3f, 2}, {1, 0.3f, 0});
  const Result r = atlas_of(o, 8);
  EXPECT_EQ(r.stats.charts, 2);
  EXPECT_EQ(oracle::defects(o, r.uv), "");
}

TEST(Atlas, ASparseChartIsCut) {
  // A thin L, 20 m each way, fills 1/10 of its square; in two pieces it fits ten times less.
  Object o;
  for (int i = 0; i < 20; ++i) {
    const float f = static_cast<float>(i);
    shapes::add_slab(&o, {f, 0}, {f + 1, 1}, 0, true);
    if (i > 0) shapes::add_slab(&o, {0, f}, {1, f + 1}, 0, true);
  }
  const Result r = atlas_of(o, 8);
  EXPECT_EQ(oracle::defects(o, r.uv), "");
  EXPECT_GE(r.stats.utilisation, 0.6f);
  EXPECT_LE(r.stats.charts, 4);
}

TEST(Atlas, TinyTrianglesGetATexelEach) {
  // A fan of unconnected specks, far below a texel, each facing its own way.
  Object o;
  for (int i = 0; i < 500; ++i) {
    const Vec2 c = shapes::circle(i, 37);
    const Vec3 p{static_cast<float>(i), 0, 0};
    shapes::add_triangle(&o, p, p + Vec3{0.004f * c.x, 0.004f * c.y, 0}, p + Vec3{0, 0.003f * c.x, 0.005f});
  }
  const Result r = atlas_of(o, 4);
  EXPECT_EQ(r.stats.charts, 500);
  EXPECT_EQ(oracle::defects(o, r.uv), "");
  EXPECT_LE(r.uv.width * r.uv.height, 500 * 4 * 5 / 4);
  for (const auto& t : r.uv.corners) {
    int centres = 0;
    oracle::for_each_texel(r.uv, t, [&](int x, int y) { centres += oracle::inside(t, x + 0.5, y + 0.5); });
    EXPECT_GE(centres, 1);
  }
}

TEST(Atlas, DegenerateTrianglesLieInsideAndDisturbNothing) {
  Object o = shapes::box({0, 0, 0}, {1, 1, 1});
  const Result clean = atlas_of(o, 8);
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  shapes::add_triangle(&o, {0, 0, 0}, {0, 0, 0}, {1, 1, 1});
  shapes::add_triangle(&o, {0, 0, 0}, {0.5f, 0.5f, 0.5f}, {1, 1, 1});
  shapes::add_triangle(&o, {0, nan, 0}, {1, 0, 0}, {0, 1, 0});
  shapes::add_triangle(&o, {0, 0, 0}, {inf, 0, 0}, {0, 1, 0});
  const Result r = atlas_of(o, 8);
  EXPECT_EQ(r.stats.charts, 6);
  EXPECT_EQ(oracle::defects(o, r.uv), "");
  EXPECT_TRUE(std::equal(clean.uv.corners.begin(), clean.uv.corners.end(), r.uv.corners.begin()));
}

TEST(Atlas, NothingButDegenerateTrianglesIsALightmapOfOneTexel) {
  Object o;
  shapes::add_triangle(&o, {1, 2, 3}, {1, 2, 3}, {1, 2, 3});
  const Result r = atlas_of(o, 8);
  EXPECT_EQ(r.stats.charts, 0);
  EXPECT_EQ(r.uv.width, 3);
  EXPECT_EQ(r.uv.height, 3);
  EXPECT_EQ(oracle::defects(o, r.uv), "");
}

TEST(Atlas, ManyTrianglesOnOneEdge) {
  Object o;
  for (int i = 0; i < 64; ++i) {
    const Vec2 c = shapes::circle(i, 64);
    shapes::add_triangle(&o, {0, 0, 0}, {0, 1, 0}, {c.x, 0.5f, c.y});
  }
  EXPECT_EQ(oracle::defects(o, atlas_of(o, 16).uv), "");
}

TEST(Atlas, WrongArgumentsAreErrors) {
  const Object plane = shapes::plane(1, 1);
  EXPECT_FALSE(generate_atlas(Object{}, {}).ok());
  for (const float bad :
       {0.0f, -1.0f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    AtlasOptions options;
    options.texels_per_metre = bad;
    EXPECT_FALSE(generate_atlas(plane, options).ok()) << bad;
  }
  AtlasOptions options;
  options.texels_per_metre = 1e6f;
  const absl::Status too_large = generate_atlas(plane, options).status();
  EXPECT_EQ(too_large.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(too_large.message().find("plane"), std::string::npos) << too_large;
  Object broken = plane;
  broken.triangles[0].v[1] = 6;
  EXPECT_FALSE(generate_atlas(broken, {}).ok());
}

TEST(Atlas, HugeCoordinatesAreErrorsNotCrashes) {
  Object o;
  shapes::add_triangle(&o, {0, 0, 0}, {3e38f, 0, 0}, {0, 3e38f, 0});
  shapes::add_triangle(&o, {0, 0, 0}, {1e30f, 0, 0}, {0, 0, 1e-6f});
  EXPECT_FALSE(generate_atlas(o, {}).ok());
}

}  // namespace
}  // namespace lightloom
