// Surfaces that the base probes do not see: repair must find them, or their cells must say so.
#include <gtest/gtest.h>

#include <algorithm>

#include "cli/view/overlays.h"
#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"

namespace lightloom::stability {
namespace {

/// The share of gather rays that found no probe; receivers that are black though the truth is not, in cells that report
/// nothing; how far E is from the truth.
void check_seen(const BakedLevel& level, const std::string& what, double error_bound, const View& view = {}) {
  const Field e = relight(level, 16, 64);
  const Truth truth = trace_truth(level, 16, 256), other = trace_truth(level, 16, 256, 2);
  const Field traced = truth_field(level, truth, e), traced_too = truth_field(level, other, e);
  const auto owners = value_or_die(view::find_owners(level.loom(), level.manifest, *level.scene, level.elements));
  double unseen = 0, worst_cell = 0;
  for (const CellEntry& cell : level.manifest.cells) {
    unseen += static_cast<double>(cell.unseen) * cell.receivers / static_cast<double>(level.report.receivers);
    worst_cell = std::max(worst_cell, static_cast<double>(cell.unseen));
  }
  const double black = 0.01 * mean(level, traced);
  int by_accident = 0, dark = 0;
  for (size_t i = 0; i < e.size(); ++i) {
    // A rare bright path makes one of the two wrong, hardly both.
    const float true_e = std::min(traced[i].x, traced_too[i].x);
    if (static_cast<double>(true_e) < black || e[i].x > 0.1f * true_e) continue;
    ++dark;
    by_accident += level.manifest.cells[owners.cell[i]].unseen == 0;
  }
  const Comparison all = error(level, e, truth);
  std::printf(
      "%s: %zu receivers, %zu probes (%zu repairs), unseen %.5f (worst cell %.5f), %d dark, rel_rmse %.4f (noise "
      "%.4f)\n",
      what.c_str(), e.size(), level.manifest.probes.size(), static_cast<size_t>(level.report.repairs), unseen,
      worst_cell, dark, all.rel_rmse, truth.noise);
  check({Case::kUnseen, "share of rays that no probe sees, " + what, unseen, 0.005},
        [&] { return beside(level, e, traced, view); });
  check({Case::kUnseen, "black texels in cells that report nothing, " + what, static_cast<double>(by_accident), 0});
  check({Case::kUnseen, "rel_rmse, " + what, all.rel_rmse, error_bound});
}

TEST(StabilityUnseen, OneProbeRoom) {
  Scene scene = test::closed_box({3, 2.5f, 3});
  test::add_point_light(&scene, {1, 1.8f, 1.2f}, 10);
  const auto level = bake_at(std::move(scene), 4, 5);
  ASSERT_EQ(level->manifest.probes.size() - level->report.repairs, 1u);
  check_seen(*level, "one-probe room", 0.3);
}

// An S of five legs, 1 m wide and up to 9 m long, with probes every 4 m.
TEST(StabilityUnseen, LongCorridor) {
  Scene scene = test::closed_box({9, 2.4f, 9});
  const uint32_t wall = test::add_material(&scene, "wall", kGrey);
  test::add_solid_box(&scene, "first block", {1, -0.1f, 1}, {9.1f, 2.5f, 4}, wall);
  test::add_solid_box(&scene, "second block", {-0.1f, -0.1f, 5}, {8, 2.5f, 8}, wall);
  test::add_point_light(&scene, {8, 1.8f, 0.5f}, 20);
  test::add_point_light(&scene, {1, 1.8f, 8.5f}, 20);
  test::identify(&scene);
  const auto level = bake_at(std::move(scene), 4, 5);
  check_seen(*level, "corridor longer than the spacing", 0.3, {.direction = {0.1f, 1, 0.3f}});
}

// A slot of 12 cm between two cupboards, 1 m deep.
TEST(StabilityUnseen, Slot) {
  Scene scene = test::closed_box({4, 3, 4});
  const uint32_t wood = test::add_material(&scene, "wood", kGrey);
  test::add_solid_box(&scene, "left cupboard", {0.5f, -0.1f, -0.1f}, {1.9f, 2, 1}, wood);
  test::add_solid_box(&scene, "right cupboard", {2.02f, -0.1f, -0.1f}, {3.5f, 2, 1}, wood);
  test::add_point_light(&scene, {2, 2.5f, 3}, 20);
  test::identify(&scene);
  const auto level = bake_at(std::move(scene), 2, 5);
  check_seen(*level, "slot of 12 cm", 0.3);
}

// A chest without an opening, in a hall, with a lamp in it; the hall's probe of that cell stands outside.
TEST(StabilityUnseen, SealedChestLitFromInside) {
  Scene scene = test::closed_box({8, 4, 8});
  const uint32_t hall = test::add_material(&scene, "chest", kGrey);
  test::add_solid_box(&scene, "chest", {0.95f, -0.1f, 0.95f}, {2.05f, 1.05f, 2.05f}, hall);
  const uint32_t outside = static_cast<uint32_t>(scene.objects.size());
  Scene lining = test::closed_box({1, 1, 1});
  for (Object& wall : lining.objects) {
    for (Vec3& p : wall.positions) p += {1, 0.02f, 1};
    wall.name = "lining " + wall.name;
    for (Triangle& t : wall.triangles) t.material = hall;
    scene.objects.push_back(std::move(wall));
  }
  test::add_point_light(&scene, {1.4f, 0.7f, 1.4f}, 2);
  test::identify(&scene);
  const auto level = bake_at(std::move(scene), 4, 5);
  const Field e = relight(*level, 8);
  const double inside = mean(*level, e, [&](const Receiver& r) { return r.object >= outside; });
  const double hall_e = mean(*level, e, [&](const Receiver& r) { return r.object < outside; });
  ASSERT_GT(inside, 0.1);
  check({Case::kSealedRooms, "leak, out of a chest with walls of 3 to 5 cm", hall_e / inside, 1e-3});
  check_seen(*level, "sealed chest lit from inside", 0.3,
             {.inside = true, .from = {1.93f, 0.93f, 1.93f}, .to = {1.3f, 0.3f, 1.3f}});
}

}  // namespace
}  // namespace lightloom::stability
