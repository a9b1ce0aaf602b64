// Where a level lies, how large it is and how it is turned must not show: scaled with its parameters, moved by cells of the
// probe grid, rotated.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"

namespace lightloom::stability {
namespace {

constexpr float kCell = 1.5f;  // of probes, metres
constexpr float kTexels =
    5.1f;  // a metre; not a whole number of texels on any wall, which rounding might make one more

Scene room() {
  Scene scene = test::room_with_crate();
  test::add_point_light(&scene, {3, 2, 3}, 10);
  return scene;
}

/// The scene with all points p·scale + shift. Object ids stay those of `room`, so that receivers have the same random
/// numbers: what is measured is what the transform does, not noise.
Scene placed(float scale, Vec3 shift) {
  Scene scene = room();
  for (Object& o : scene.objects) {
    for (Vec3& p : o.positions) p = p * scale + shift;
  }
  for (Light& light : scene.lights) {
    light.position = light.position * scale + shift;
    light.intensity *= scale * scale;
  }
  return scene;
}

struct Lit {
  std::unique_ptr<BakedLevel> level;
  Field e;
};

BakeParams params_of(float scale, int max_rank) {
  BakeParams params;
  params.spacing = kCell * scale;
  params.texels_per_metre = kTexels / scale;
  params.max_rank = max_rank;
  return params;
}

Lit lit(Scene scene, float scale = 1, int max_rank = BakeParams{}.max_rank) {
  Lit out;
  out.level = bake_level(std::move(scene), params_of(scale, max_rank));
  out.e = relight(*out.level, 8);
  return out;
}

/// `no_worse`: see Row.
void check_same(const std::string& what, const Lit& original, const Lit& placed, double no_worse) {
  ASSERT_EQ(placed.e.size(), original.e.size()) << what;
  check({Case::kTransforms, "difference of E, " + what, difference(*original.level, placed.e, original.e), 0.01,
         no_worse},
        [&] { return beside(*original.level, placed.e, original.e); });
}

// Cells of probes and of the bake are scaled along. What is left is rounding; by 1024 there is none.
TEST(StabilityTransforms, ScaledWithItsParameters) {
  const Lit original = lit(placed(1, {})), finer = lit(placed(1, {}), 1, 64);
  const std::pair<float, const char*> scales[] = {
      {1e-3f, "scaled by 0.001"}, {0.1f, "scaled by 0.1"}, {10.0f, "scaled by 10"}, {1e3f, "scaled by 1000"}};
  for (const auto& [scale, what] : scales) {
    check_same(what, original, lit(placed(scale, {}), scale), 0);
    check_same(std::string(what) + ", --max-rank 64", finer, lit(placed(scale, {}), scale, 64), 0);
  }
  check_same("scaled by 1024", original, lit(placed(1024, {}), 1024), 0);
}

// Probes move along. Bake cells, which are some probe cells wide, do if the level is moved by a multiple of theirs.
TEST(StabilityTransforms, MovedByCells) {
  const Lit original = lit(placed(1, {}));
  check_same("moved by 1.5 m", original, lit(placed(1, {1.5f, 0, 1.5f})), 0);
  check_same("moved by 150 m", original, lit(placed(1, {150, 0, 150})), 0);
  check_same("moved by 999 m", original, lit(placed(1, {999, 0, 999})), 0.02);
  // Farther away floats are too coarse: a clear error, and no picture.
  for (const float metres : {9999.0f, 99999.0f}) {
    const Scene scene = placed(1, {metres, 0, metres});
    const auto tracer = value_or_die(RayTracer::create(scene));
    const test::TemporaryFolder folder;
    const absl::Status refused = bake(*tracer, params_of(1, 32), folder.path() / "far.loom", {}).status();
    EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(refused.message()), ::testing::HasSubstr("move the level to the origin"));
    check({Case::kTransforms, "difference of E, moved by " + std::to_string(std::lround(metres)) + " m: refused", 1,
           0.01, 1});
  }
}

// Rotated about two axes, so that no wall lies along the grid.
TEST(StabilityTransforms, RotatedOffTheGrid) {
  const auto error_of = [](const BakedLevel& level, const Field& e) {
    return error(level, e, trace_truth(level, 8, 512)).rel_rmse;
  };
  const Lit original = lit(room());
  const double straight = error_of(*original.level, original.e);
  double worst = 0;
  for (const float degrees : {17.0f, 30.0f, 45.0f}) {
    Scene scene = room();
    const float a = degrees * kPi / 180, c = std::cos(a), s = std::sin(a);
    const auto turn = [&](Vec3 p) {
      p = {c * p.x + s * p.z, p.y, -s * p.x + c * p.z};
      return Vec3{p.x, c * p.y - s * p.z, s * p.y + c * p.z};
    };
    for (Object& o : scene.objects) {
      for (Vec3& p : o.positions) p = turn(p);
      for (Vec3& n : o.normals) n = turn(n);
    }
    for (Light& light : scene.lights) light.position = turn(light.position);
    const Lit turned = lit(std::move(scene));
    const double rel_rmse = error_of(*turned.level, turned.e);
    std::printf("rotated by %.0f: rel_rmse %.4f, unrotated %.4f\n", static_cast<double>(degrees), rel_rmse, straight);
    worst = std::max(worst, rel_rmse);
  }
  check({Case::kTransforms, "worst error to the truth, rotated ÷ unrotated", worst / straight, 1.2});
}

}  // namespace
}  // namespace lightloom::stability
