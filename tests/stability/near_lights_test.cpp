// Light that is concentrated in less than a probe resolves: a lamp 2 cm from a wall, a small bright secondary source
// (SL17 Fig. 12). What errs there must stay there, and keep the energy.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"

namespace lightloom::stability {
namespace {

constexpr float kSpacing = 1;  // of the probes, metres

/// What is stated; see Row.
struct Errors {
  double rel_rmse = 0, no_worse_energy = 0;
};

/// One bounce, the hardest: no other light hides what errs.
void check_errors(const BakedLevel& level, const std::string& what, Vec3 source, const Errors& bounds) {
  const Field e = relight(level, 1, 1024);
  const Truth truth = trace_from_lamps(level, 16384);
  const Field traced = truth_field(level, truth, e);
  const Comparison all = error(level, e, truth);
  double far2 = 0, far_area = 0, worst = 0, brightest = 0;
  for (size_t i = 0; i < e.size(); ++i) {
    const double d = static_cast<double>(e[i].x - traced[i].x);
    worst = std::max(worst, std::abs(d));
    brightest = std::max(brightest, static_cast<double>(traced[i].x));
    if (length(level.elements.receivers.all[i].point.position - source) < 2 * kSpacing) continue;
    far2 += area(level, i) * d * d;
    far_area += area(level, i);
  }
  check({Case::kNearLights, "rel_rmse, " + what, all.rel_rmse, bounds.rel_rmse},
        [&] { return beside(level, e, traced); });
  check({Case::kNearLights, "rms error beyond two spacings ÷ brightest E, " + what,
         std::sqrt(far2 / far_area) / brightest, 0.05});
  check({Case::kNearLights, "largest error ÷ brightest E, " + what, worst / brightest, 1});
  check({Case::kNearLights, "|energy − 1|, " + what, std::abs(all.bias), 0.05, bounds.no_worse_energy});
}

TEST(StabilityNearLights, LampTwoCentimetresFromAWall) {
  Scene scene = test::closed_box({4, 3, 4});
  test::add_point_light(&scene, {0.02f, 1.5f, 2}, 10);
  const auto level = bake_at(std::move(scene), kSpacing, 6);
  check_errors(*level, "lamp 2 cm from a wall", {0, 1.5f, 2}, {0.25, 0});
}

// A white table of 30 cm, 20 cm from a wall, lit by a narrow spot: the brightest thing around is smaller than a probe's
// blur.
TEST(StabilityNearLights, SmallSecondarySource) {
  Scene scene = test::closed_box({4, 3, 4});
  const uint32_t white = test::add_material(&scene, "white", {0.9f, 0.9f, 0.9f});
  test::add_solid_box(&scene, "table", {0.2f, 0.7f, 1.85f}, {0.5f, 0.75f, 2.15f}, white);
  test::add_point_light(&scene, {0.35f, 2.5f, 2}, 50);
  Light& spot = scene.lights.back();
  spot.type = LightType::kSpot;
  spot.direction = {0, -1, 0};
  spot.inner_cone_angle = 0.06f;
  spot.outer_cone_angle = 0.08f;
  test::identify(&scene);
  const auto level = bake_at(std::move(scene), kSpacing, 6);
  check_errors(*level, "small bright secondary source", {0.35f, 0.75f, 2}, {0.8, 0.35});
}

}  // namespace
}  // namespace lightloom::stability
