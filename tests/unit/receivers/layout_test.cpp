#include "core/receivers/layout.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/unit/receivers/shapes.h"

namespace lightloom {
namespace {

/// A square of the given side with TEXCOORD_1 filling [lo, hi]².
Object square(float side, Vec2 lo, Vec2 hi) {
  Object o = shapes::plane(side, side);
  for (const Vec3& p : o.positions) {
    o.uv1.push_back({lo.x + (hi.x - lo.x) * p.x / side, lo.y + (hi.y - lo.y) * p.z / side});
  }
  return o;
}

Scene scene_of(std::vector<Object> objects) {
  Scene scene;
  for (size_t i = 0; i < objects.size(); ++i) {
    objects[i].name = "object " + std::to_string(i);
    objects[i].id = sha256(objects[i].name);
  }
  scene.objects = std::move(objects);
  return scene;
}

Scene boxes(int count) {
  std::vector<Object> objects;
  for (int i = 0; i < count; ++i) {
    objects.push_back(
        shapes::box({0, 0, 0}, {1 + 0.25f * static_cast<float>(i % 5), 1, 1 + 0.5f * static_cast<float>(i % 3)}));
  }
  return scene_of(std::move(objects));
}

AtlasLayout layout_of(const Scene& scene, const LayoutOptions& options) {
  absl::StatusOr<AtlasLayout> layout = make_layout(scene, options);
  EXPECT_TRUE(layout.ok()) << layout.status();
  return layout.ok() ? *std::move(layout) : AtlasLayout{};
}

LayoutOptions at_density(float texels_per_metre) {
  LayoutOptions options;
  options.texels_per_metre = texels_per_metre;
  return options;
}

/// Options that continue `layout`.
LayoutOptions after(const Scene& scene, const AtlasLayout& layout) {
  LayoutOptions options = at_density(layout.texels_per_metre);
  for (size_t i = 0; i < scene.objects.size(); ++i) {
    if (layout.uv[i].width == 0) continue;
    options.earlier[scene.objects[i].id] = {layout.placements[i], layout.uv[i].width, layout.uv[i].height};
  }
  options.earlier_width = layout.width;
  options.earlier_height = layout.height;
  return options;
}

/// Lightmaps lie in the image, at least a texel apart.
void expect_disjoint(const AtlasLayout& l) {
  for (size_t i = 0; i < l.uv.size(); ++i) {
    if (l.uv[i].width == 0) continue;
    const Placement p = l.placements[i];
    EXPECT_GE(p.x, 0);
    EXPECT_GE(p.y, 0);
    EXPECT_LE(p.x + l.uv[i].width, l.width);
    EXPECT_LE(p.y + l.uv[i].height, l.height);
    for (size_t k = 0; k < i; ++k) {
      if (l.uv[k].width == 0) continue;
      const Placement q = l.placements[k];
      EXPECT_TRUE(p.x > q.x + l.uv[k].width || q.x > p.x + l.uv[i].width || p.y > q.y + l.uv[k].height ||
                  q.y > p.y + l.uv[i].height)
          << i << " and " << k;
    }
  }
}

TEST(Layout, ACommonAtlasIsUsedAsItIs) {
  const Scene scene =
      scene_of({square(1, {0, 0}, {0.5f, 0.5f}), square(1, {0.5f, 0}, {1, 0.5f}), square(1, {0, 0.5f}, {0.5f, 1})});
  LayoutOptions options;
  options.lightmap_size = 100;
  const AtlasLayout l = layout_of(scene, options);
  EXPECT_EQ(l.mode, LayoutMode::kScene);
  EXPECT_EQ(l.width, 100);
  EXPECT_EQ(l.height, 100);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(l.placements[i], (Placement{0, 0}));
    ASSERT_EQ(l.uv[i].corners.size(), 2u);
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(l.uv[i].corners[0][k], scene.objects[i].uv1[scene.objects[i].triangles[0].v[k]] * 100);
    }
  }
}

TEST(Layout, SizeOfACommonAtlasFollowsDensity) {
  // 2 × 16 m² in half of [0,1]²: 32 · 15² texels in half the image make a side of 120, so 128.
  const Scene scene = scene_of({square(4, {0, 0}, {0.5f, 0.5f}), square(4, {0.5f, 0.5f}, {1, 1})});
  const AtlasLayout l = layout_of(scene, at_density(15));
  EXPECT_EQ(l.mode, LayoutMode::kScene);
  EXPECT_EQ(l.width, 128);
  EXPECT_EQ(l.height, 128);
}

TEST(Layout, DefaultDensityMakesAboutTwoToSixteenTexels) {
  const AtlasLayout l = layout_of(scene_of({square(10, {0, 0}, {1, 1})}), {});
  EXPECT_NEAR(l.texels_per_metre, 25.6f, 25.6f / 8);
  // A small edit does not change it.
  EXPECT_EQ(layout_of(scene_of({square(10.1f, {0, 0}, {1, 1})}), {}).texels_per_metre, l.texels_per_metre);
}

TEST(Layout, ObjectsThatShareTexelsGetTheirOwn) {
  const Scene scene = scene_of({square(1, {0, 0}, {1, 1}), square(2, {0, 0}, {1, 1})});
  const AtlasLayout l = layout_of(scene, at_density(8));
  EXPECT_EQ(l.mode, LayoutMode::kPerObject);
  expect_disjoint(l);
  // Their own TEXCOORD_1 at the wanted density.
  EXPECT_EQ(l.uv[0].width, 8);
  EXPECT_EQ(l.uv[0].height, 8);
  EXPECT_EQ(l.uv[1].width, 16);
  EXPECT_EQ(l.uv[0].corners[0][1], scene.objects[0].uv1[1] * 8);
}

TEST(Layout, ATouchInOneTexelOfAThousandIsForgiven) {
  // At 64 texels: two halves, and a third object over one texel of the 4096.
  const float t = 1.0f / 64;
  std::vector<Object> objects{square(1, {0, 0}, {0.5f, 1}), square(1, {0.5f, 0}, {1, 1}), square(1, {0, 0}, {t, t})};
  LayoutOptions options;
  options.lightmap_size = 64;
  EXPECT_EQ(layout_of(scene_of(objects), options).mode, LayoutMode::kScene);
  objects[2] = square(1, {0, 0}, {8 * t, t});
  EXPECT_EQ(layout_of(scene_of(objects), options).mode, LayoutMode::kPerObject);
}

TEST(Layout, OwnTexcoordKeepsAspectAndIsCropped) {
  // 4 m × 1 m mapped to a corner of [0,1]², stretched threefold in v.
  Object strip = shapes::plane(4, 1);
  for (const Vec3& p : strip.positions) strip.uv1.push_back({0.5f + p.x / 16, 0.25f + 3 * p.z / 16});
  const AtlasLayout l = layout_of(scene_of({strip, shapes::plane(1, 1)}), at_density(16));
  EXPECT_EQ(l.mode, LayoutMode::kPerObject);
  EXPECT_NEAR(l.uv[0].width, 64, 1);
  EXPECT_NEAR(l.uv[0].height, 16, 1);
}

TEST(Layout, MissingOutsideOrSelfOverlappingTexcoordIsGenerated) {
  Object outside = square(1, {0, 0}, {1.5f, 1});
  Object folded = square(1, {0, 0}, {1, 1});
  for (uint32_t k = 0; k < 3; ++k) folded.uv1[folded.triangles[1].v[k]] = folded.uv1[folded.triangles[0].v[k]];
  Object flat = square(1, {0.5f, 0.5f}, {0.5f, 0.5f});
  Object not_finite = square(1, {0, 0}, {1, 1});
  not_finite.uv1[2].x = std::numeric_limits<float>::quiet_NaN();
  const Scene scene = scene_of({shapes::plane(1, 1), outside, folded, flat, not_finite});
  const AtlasLayout l = layout_of(scene, at_density(8));
  EXPECT_EQ(l.mode, LayoutMode::kPerObject);
  for (const LightmapUv& uv : l.uv) {
    EXPECT_EQ(uv.width, 10);  // 8 and a border, which an own TEXCOORD_1 does not get
    EXPECT_EQ(uv.height, 10);
  }
  expect_disjoint(l);
}

TEST(Layout, OnlyReceiversOfLightmapsGetOne) {
  std::vector<Object> objects(4, shapes::plane(1, 1));
  objects[0].is_static = false;
  objects[1].receive = Receive::kVolume;
  objects[2].receive = Receive::kNone;
  objects.push_back({});
  const AtlasLayout l = layout_of(scene_of(objects), at_density(8));
  ASSERT_EQ(l.uv.size(), 5u);
  ASSERT_EQ(l.placements.size(), 5u);
  for (size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(l.uv[i].corners.size(), i == 3 ? 2u : 0u);
    EXPECT_EQ(l.uv[i].width, i == 3 ? 10 : 0);
  }
  EXPECT_EQ(l.width, 10);
}

TEST(Layout, ASceneWithoutReceiversHasAnEmptyLayout) {
  const AtlasLayout l = layout_of(Scene{}, {});
  EXPECT_EQ(l.width, 0);
  EXPECT_EQ(l.height, 0);
}

TEST(Layout, PlacementsAreDisjointAndTheImageIsNotWasteful) {
  const AtlasLayout l = layout_of(boxes(40), at_density(8));
  expect_disjoint(l);
  int64_t texels = 0;
  for (const LightmapUv& uv : l.uv) texels += int64_t{uv.width} * uv.height;
  EXPECT_LT(int64_t{l.width} * l.height, texels * 5 / 4);
}

TEST(Layout, AnObjectsTexelsDoNotDependOnOthers) {
  const AtlasLayout few = layout_of(boxes(3), at_density(8)), many = layout_of(boxes(9), at_density(8));
  for (size_t i = 0; i < 3; ++i) EXPECT_EQ(few.uv[i].corners, many.uv[i].corners);
}

TEST(Layout, NothingMovesWhenNothingChanges) {
  const Scene scene = boxes(20);
  const AtlasLayout first = layout_of(scene, at_density(8));
  const AtlasLayout second = layout_of(scene, after(scene, first));
  EXPECT_EQ(second.placements, first.placements);
  EXPECT_EQ(second.width, first.width);
  EXPECT_EQ(second.height, first.height);
  EXPECT_EQ(layout_of(scene, at_density(8)).placements, first.placements);
}

TEST(Layout, OthersStayWhenAnObjectIsAdded) {
  const Scene before = boxes(20), now = boxes(23);
  const AtlasLayout first = layout_of(before, at_density(8));
  const AtlasLayout second = layout_of(now, after(before, first));
  for (size_t i = 0; i < 20; ++i) EXPECT_EQ(second.placements[i], first.placements[i]);
  EXPECT_EQ(second.width, first.width);
  EXPECT_GT(second.height, first.height);
  expect_disjoint(second);
}

TEST(Layout, TheHoleOfARemovedObjectIsUsedAgain) {
  const Scene before = boxes(20);
  const AtlasLayout first = layout_of(before, at_density(8));
  Scene now = before;
  now.objects[7].name = "new";
  now.objects[7].id = sha256("new");
  const AtlasLayout second = layout_of(now, after(before, first));
  EXPECT_EQ(second.placements, first.placements);
  EXPECT_EQ(second.height, first.height);

  // Removed without a successor, the image keeps its size.
  now.objects.erase(now.objects.begin() + 7);
  const AtlasLayout third = layout_of(now, after(before, first));
  EXPECT_EQ(third.height, first.height);
  EXPECT_EQ(third.placements[7], first.placements[8]);
}

TEST(Layout, AnObjectThatChangedSizeFindsAnotherPlace) {
  const Scene before = boxes(20);
  const AtlasLayout first = layout_of(before, at_density(8));
  Scene now = before;
  now.objects[3].texel_scale = 2;
  const AtlasLayout second = layout_of(now, after(before, first));
  for (size_t i = 0; i < 20; ++i) {
    if (i == 3) continue;
    EXPECT_EQ(second.placements[i], first.placements[i]);
  }
  expect_disjoint(second);
}

TEST(Layout, ALightmapWiderThanTheEarlierImageIsAnError) {
  const Scene before = boxes(1);
  Scene now = boxes(2);
  now.objects[1].texel_scale = 20;
  const auto l = make_layout(now, after(before, layout_of(before, at_density(8))));
  EXPECT_EQ(l.status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST(Layout, EarlierPlacesThatCannotBeAreIgnored) {
  const Scene scene = boxes(4);
  LayoutOptions options = after(scene, layout_of(scene, at_density(8)));
  options.earlier[scene.objects[0].id].placement = {-5, 2};
  options.earlier[scene.objects[1].id].placement = options.earlier[scene.objects[2].id].placement;
  options.earlier[scene.objects[3].id].placement = {2147483647, 2147483647};
  expect_disjoint(layout_of(scene, options));
}

TEST(Layout, WrongArgumentsAreErrors) {
  const Scene scene = boxes(2);
  LayoutOptions options;
  options.lightmap_size = -1;
  EXPECT_FALSE(make_layout(scene, options).ok());
  options.lightmap_size = 100000;
  EXPECT_FALSE(make_layout(scene, options).ok());
  EXPECT_FALSE(make_layout(scene, at_density(std::numeric_limits<float>::quiet_NaN())).ok());
  EXPECT_FALSE(make_layout(scene, at_density(1e9f)).ok());
  EXPECT_FALSE(make_layout(scene_of({square(1, {0, 0}, {1, 1})}), at_density(1e5f)).ok());
  Scene broken = scene;
  broken.objects[1].triangles[0].v[0] = 1000;
  EXPECT_FALSE(make_layout(broken, {}).ok());
  broken = scene;
  broken.objects[0].texel_scale = 0;
  EXPECT_FALSE(make_layout(broken, {}).ok());
}

}  // namespace
}  // namespace lightloom
