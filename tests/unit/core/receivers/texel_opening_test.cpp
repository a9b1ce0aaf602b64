#include "core/receivers/texel_opening.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "core/receivers/layout.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

/// Area of the part of a texel of the crate room's floor, ÷ that of the texel, for which `contains` is true; checks each
/// sample against the crate's footprint.
struct Share {
  double open = 0, found = 0;
  int wrong = 0;
};

class CrateRoom : public testing::Test {
 protected:
  void SetUp() override {
    scene_ = test::room_with_crate();
    auto tracer = RayTracer::create(scene_);
    ASSERT_TRUE(tracer.ok());
    tracer_ = *std::move(tracer);
    LayoutOptions options;
    options.texels_per_metre = 1.75f;  // the crate's edges fall inside texels
    auto layout = make_layout(scene_, options);
    ASSERT_TRUE(layout.ok()) << layout.status();
    layout_ = *std::move(layout);
  }

  Share share(uint32_t object, const TexelGrid& grid, const Texel& texel) const {
    const Object& o = scene_.objects[object];
    const LightmapUv& uv = layout_.uv[object];
    const TexelOpening opening(*tracer_, o, uv, grid, texel, false, 7);
    constexpr uint32_t kSide = 24;
    Rng rng(3);
    Share out;
    for (uint32_t i = 0; i < kSide * kSide; ++i) {
      const SurfacePoint s = sample_texel(o, uv, grid, texel, stratified(i, kSide, &rng));
      const Vec3 p = interpolate(o.positions, o.triangles[s.triangle], s.b1, s.b2);
      const float outside = std::max(std::abs(p.x - 1.75f), std::abs(p.z - 1.75f)) - 0.75f;  // metres from the crate
      out.open += outside > 0;
      out.found += opening.contains(s);
      out.wrong += std::abs(outside) > 1e-3f && opening.contains(s) != (outside > 0);
    }
    out.open /= kSide * kSide;
    out.found /= kSide * kSide;
    return out;
  }

  Scene scene_;
  std::unique_ptr<RayTracer> tracer_;
  AtlasLayout layout_;
};

TEST_F(CrateRoom, FloorUnderTheCrateIsLeftOut) {
  const uint32_t floor = test::object_named(scene_, "floor");
  const TexelGrid grid = rasterise(scene_.objects[floor], layout_.uv[floor]);
  int cut = 0;
  for (const Texel& texel : grid.texels) {
    const Share s = share(floor, grid, texel);
    // Slivers thinner than half of the parts that are tested are not found; then the texel counts whole.
    if (s.open < 0.13) continue;
    EXPECT_EQ(s.wrong, 0) << texel.x << ", " << texel.y << ": open " << s.open << ", found " << s.found;
    cut += s.open < 1;
  }
  EXPECT_GE(cut, 8);
}

TEST_F(CrateRoom, WallsCountWhole) {
  const uint32_t wall = test::object_named(scene_, "north");
  const TexelGrid grid = rasterise(scene_.objects[wall], layout_.uv[wall]);
  for (const Texel& texel : grid.texels) {
    EXPECT_TRUE(TexelOpening(*tracer_, scene_.objects[wall], layout_.uv[wall], grid, texel, false, 7).whole());
  }
}

// Found by fuzzing: such texels are longer than numbers go, and rays along them are none.
TEST(TexelOpening, ChartsSqueezedToAlmostNothing) {
  for (const float height : {1e-6f, 1e-20f, 1e-36f, 1e-44f}) {
    const Scene scene = test::facing_plates(1, 1);
    const Object& plate = scene.objects[test::object_named(scene, "target")];
    LightmapUv uv;
    uv.width = uv.height = 4;
    for (const Triangle& t : plate.triangles) {
      auto& corners = uv.corners.emplace_back();
      for (size_t k = 0; k < 3; ++k) corners[k] = {4 * plate.uv1[t.v[k]].x, height * plate.uv1[t.v[k]].y};
    }
    const auto tracer = RayTracer::create(scene);
    ASSERT_TRUE(tracer.ok());
    const TexelGrid grid = rasterise(plate, uv);
    for (const Texel& texel : grid.texels) {
      const TexelOpening opening(**tracer, plate, uv, grid, texel, false, 7);
      EXPECT_TRUE(is_finite(opening.middle().position)) << height;
    }
    EXPECT_FALSE(grid.texels.empty()) << height;
  }
}

}  // namespace
}  // namespace lightloom
