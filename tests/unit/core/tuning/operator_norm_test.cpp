// Cases with a closed form. ⟨cosθ, ·⟩ has in band l the norm √((2l + 1)/4π)·A_l, with A = π, 2π/3, π/4, 0, −π/24, 0, π/64, 0,
// −π/128 (Ramamoorthi & Hanrahan 2001): bands 0 to 9 hold 0.9998 of √(2π/3).
#include "core/tuning/operator_norm.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "core/tuning/receiver_sample.h"
#include "tests/unit/core/baselines/planned_level.h"

namespace lightloom {
namespace {

using test::PlannedLevel;
using test::value_or_die;

/// The receiver whose place is nearest to `p`.
uint32_t receiver_at(const PlannedLevel& level, Vec3 p) {
  const auto& all = level.plan.receivers.all;
  const auto nearer = [&](const Receiver& a, const Receiver& b) {
    return length(a.point.position - p) < length(b.point.position - p);
  };
  return static_cast<uint32_t>(std::min_element(all.begin(), all.end(), nearer) - all.begin());
}

std::vector<double> norms(const PlannedLevel& level, const std::vector<uint32_t>& receivers, int threads = 0) {
  Parallel how;
  how.threads = threads;
  return value_or_die(operator_norms(*level.tracer, level.plan, receivers, how));
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

// The sky looks the same from everywhere, so all that is lost is what order n cannot tell: m_l = ∫ (cosθ − T_n cosθ) Y_l over the
// upper half, where T_n keeps the bands of the lobe that the probes have: T_0 = ¼, T_1 = ¼ + μ/2, T_2 = T_1 + 5/32·(3μ² − 1). For
// order 0 the function's own norm is √(2π·7/48), 0.661 of √(2π/3); its bands up to 9 have 0.6568. The other two likewise.
TEST(OperatorNorm, UnderAnOpenSkyIsWhatTheOrderCannotTell) {
  PlannedLevel level(test::open_plane(8, {1, 1, 1}), 4, 1);
  const uint32_t middle = receiver_at(level, {0, 0, 0});
  for (const auto& [order, expected] : std::vector<std::pair<int, double>>{{0, 0.6568}, {1, 0.2382}, {2, 0.0553}}) {
    level.plan.params.order = order;
    EXPECT_NEAR(norms(level, {middle})[0], expected, 0.006) << "order " << order;
  }
}

TEST(OperatorNorm, OfAProbeAtTheReceiverIsSmall) {
  PlannedLevel level(test::closed_box({4, 4, 4}), 8, 8);
  ASSERT_EQ(level.plan.placement.probes.size(), 1u);
  level.plan.params.near_field = 0;
  const uint32_t r = receiver_at(level, {2, 0, 2});
  const Receiver& receiver = level.plan.receivers.all[r];
  const double far = norms(level, {r})[0];
  level.plan.placement.probes[0].position = receiver.point.position + receiver.point.normal * 0.01f;
  const double near = norms(level, {r})[0];
  EXPECT_LT(near, 0.05);
  EXPECT_GT(far, 2 * near);
}

TEST(OperatorNorm, OfWhatNoProbeSeesIsOne) {
  PlannedLevel level(test::sealed_double_room(0.2f), 1.5f, 2);
  std::erase_if(level.plan.placement.probes, [](const Probe& p) { return p.position.x > 3; });
  ASSERT_FALSE(level.plan.placement.probes.empty());
  const std::vector<double> n =
      norms(level, {receiver_at(level, {4.5f, 0, 1.5f}), receiver_at(level, {1.5f, 0, 1.5f})});
  EXPECT_NEAR(n[0], 0.9998, 0.005);
  EXPECT_LT(n[1], 0.2);
}

TEST(OperatorNorm, FallsWithMoreProbesAndHigherOrders) {
  PlannedLevel coarse(test::room_with_crate(), 4, 2), fine(test::room_with_crate(), 1, 2);
  const auto of = [](PlannedLevel& level) {
    level.plan.params.near_field = 0.25f;
    return mean(norms(level, stratified(front_receivers(level.plan.receivers), 12, 1)));
  };
  const double many = of(fine), few = of(coarse);
  EXPECT_LT(many, 0.7 * few);
  coarse.plan.params.order = 2;
  EXPECT_GT(of(coarse), 1.2 * few);
}

TEST(OperatorNorm, DependsOnNeitherThreadsNorLights) {
  PlannedLevel level(test::room_with_crate(), 2, 2);
  const std::vector<uint32_t> some = stratified(front_receivers(level.plan.receivers), 8, 1);
  const std::vector<double> one = norms(level, some, 1);
  test::add_point_light(&level.scene, {2, 2, 2}, 100);
  EXPECT_EQ(norms(level, some, 4), one);
}

TEST(OperatorNorm, StopsWhenCancelled) {
  const PlannedLevel level(test::room_with_crate(), 4, 1);
  CancelFlag cancel;
  cancel.cancel();
  Parallel how;
  how.cancel = &cancel;
  EXPECT_EQ(operator_norms(*level.tracer, level.plan, std::vector<uint32_t>{0}, how).status().code(),
            absl::StatusCode::kCancelled);
}

TEST(ReceiverSample, TakesOneOfEachStretch) {
  std::vector<uint32_t> all(100);
  for (uint32_t i = 0; i < 100; ++i) all[i] = 10 * i;
  const std::vector<uint32_t> some = stratified(all, 10, 7);
  ASSERT_EQ(some.size(), 10u);
  for (size_t i = 0; i < 10; ++i) EXPECT_EQ(some[i] / 100, i);
  EXPECT_NE(some, stratified(all, 10, 8));
  EXPECT_EQ(stratified(all, 1000, 7), all);
}

}  // namespace
}  // namespace lightloom
