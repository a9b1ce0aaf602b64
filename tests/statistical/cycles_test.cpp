#include "tests/statistical/against_cycles.h"

#include "core/receivers/receivers.h"
#include "core/scene/rig.h"

namespace lightloom {
namespace {

class AgainstCycles : public testing::TestWithParam<test::CyclesCase> {};

TEST_P(AgainstCycles, Agrees) { test::check_against_cycles(GetParam()); }

INSTANTIATE_TEST_SUITE_P(
    Bakes, AgainstCycles,
    testing::Values(test::CyclesCase{"cornell", 1, 128, 1024, 0.01}, test::CyclesCase{"cornell", 32, 128, 2048, 0.01},
                    test::CyclesCase{"rooms", 1, 128, 1024, 0.01}, test::CyclesCase{"rooms", 32, 128, 1024, 0.01},
                    test::CyclesCase{"city", 1, 256, 128, 0.03}, test::CyclesCase{"maze", 1, 128, 512, 0.03}),
    test::case_name);

// The room over x in [8.12, 12.1], z in [-4, 0] of `rooms` has no opening.
class SealedRoom : public testing::Test {
 protected:
  void SetUp() override {
    const std::filesystem::path folder = test::scenes_folder() / "rooms";
    if (!std::filesystem::exists(folder / "scene.glb") || !std::filesystem::exists(folder / "lights.json")) {
      GTEST_SKIP() << "no rooms/scene.glb and rooms/lights.json: set LIGHTLOOM_SCENES to the folder of the "
                      "test scenes";
    }
    auto scene = load_gltf(folder / "scene.glb");
    ASSERT_TRUE(scene.ok()) << scene.status();
    scene_ = *std::move(scene);
    const auto rigs = load_rigs(folder / "lights.json");
    ASSERT_TRUE(rigs.ok()) << rigs.status();
    rigs_ = *rigs;
  }

  struct Light {
    int texels = 0, lit = 0;
    float largest = 0;
    double mean = 0;
  };
  /// Indirect light on the inside of the room.
  Light inside() {
    Light light;
    const auto tracer = RayTracer::create(scene_);
    LayoutOptions layout_options;
    layout_options.lightmap_size = 128;
    const auto layout = make_layout(scene_, layout_options);
    EXPECT_TRUE(tracer.ok() && layout.ok());
    if (!tracer.ok() || !layout.ok()) return light;
    ReferenceOptions options;
    options.bounces = 8;
    options.samples = 128;
    const auto reference = reference_lightmap(**tracer, *layout, options);
    const auto receivers = find_receivers(**tracer, *layout, {});
    EXPECT_TRUE(reference.ok() && receivers.ok());
    if (!reference.ok() || !receivers.ok()) return light;
    for (const Receiver& r : receivers->all) {
      const Texel& texel = receivers->grids[r.object].texels[r.texel];
      const Vec3 p = r.point.position;
      if (r.back || !texel.centre_covered) continue;
      if (!(p.x > 8.12f && p.x < 12.1f && p.y > 0 && p.y < 2.7f && p.z > -4 && p.z < 0)) continue;
      const Placement at = layout->placements[r.object];
      const Vec3 e = reference->image.rgb(at.x + static_cast<int>(texel.x), at.y + static_cast<int>(texel.y));
      const float brightest = std::max({e.x, e.y, e.z});
      ++light.texels;
      light.lit += brightest > 0;
      light.largest = std::max(light.largest, brightest);
      light.mean += (e.x + e.y + e.z) / 3;
    }
    light.mean /= std::max(1, light.texels);
    std::printf("sealed room: %d texels, %d lit, largest %g, mean %g W/m²\n", light.texels, light.lit, light.largest,
                light.mean);
    return light;
  }

  Scene scene_;
  std::vector<Rig> rigs_;
};

TEST_F(SealedRoom, GetsNothingFromTheLampOutside) {
  const Light light = inside();
  EXPECT_GT(light.texels, 500);
  EXPECT_EQ(light.lit, 0);
  EXPECT_EQ(light.largest, 0);
}

TEST_F(SealedRoom, IsLitByALampInside) {
  const auto rig = find_rig(rigs_, "point2");
  ASSERT_TRUE(rig.ok()) << rig.status();
  ASSERT_TRUE(apply_rig(*rig, &scene_).ok());
  const Light light = inside();
  EXPECT_GT(light.texels, 500);
  EXPECT_EQ(light.lit, light.texels);
  EXPECT_GT(light.mean, 0.1);
}

}  // namespace
}  // namespace lightloom
