// What a farm makes of its workers while some of them fail all they get, and others die: tests/bench/simulated_farm.h, small.
#include <gtest/gtest.h>

#include "tests/bench/simulated_farm.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::bench {
namespace {

TEST(FarmSimulation, WorkersIdleForATwentiethAtMostWhileOthersFail) {
  FarmOptions options;
  options.workers = 15;
  options.tasks = 3'000;
  options.plan_seconds = 1;
  options.task_seconds = read_task_seconds(LIGHTLOOM_SOURCE_DIR "/tests/bench/task_seconds.csv");
  options.charge_seconds = 1e-3;
  const test::TemporaryFolder folder;
  const FarmReport report = simulate(options, folder.path());

  EXPECT_GE(report.strict_share, 0.95) << report.seconds << " s";
  EXPECT_LE(report.strict_share, 1);
  EXPECT_EQ(report.done, 3'002u);
  EXPECT_EQ(report.failed, 0u);
  EXPECT_EQ(report.on_record_twice, 0u);
  EXPECT_GT(report.failed_attempts, 10u);
  EXPECT_GE(report.deaths_with_tasks, 1u);
  EXPECT_GE(report.expired, 1u);
}

TEST(FarmSimulation, IsTheSameEachTime) {
  FarmOptions options;
  options.workers = 10;
  options.tasks = 100;
  options.task_seconds = {0.05, 0.3, 2};
  options.charge_seconds = 1e-3;
  const test::TemporaryFolder a, b;
  const FarmReport first = simulate(options, a.path()), second = simulate(options, b.path());
  EXPECT_EQ(first.seconds, second.seconds);
  EXPECT_EQ(first.coordinator.syncs, second.coordinator.syncs);
  EXPECT_EQ(first.leases, second.leases);
}

}  // namespace
}  // namespace lightloom::bench
