#include "cli/eval/run.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/base/file.h"
#include "tests/support/baked_level.h"

namespace lightloom::eval {
namespace {

Run example() {
  Run run;
  run.key = "k";
  run.method = "default";
  run.label = "spacing ×2, \"odd\"";
  run.settings = {{"spacing", 2.0}};
  run.facts.bytes = 1000;
  run.facts.frame_bytes = 900;
  run.facts.probes = 7;
  for (const double seconds : {3.0, 1.0, 2.0}) {
    Facts one = run.facts;
    one.seconds = seconds;
    one.core_seconds = 2 * seconds;
    run.add_times(one);
  }
  run.frame_ms = {4, 1, 2, 3};
  run.machines = {"M, 2 threads"};
  run.rigs = {{"a", 0.05, 0.03, 0.01, 0.1, 0.2, 0.3}, {"b,c", 0.16, 0, 0, 0, 0, 0}};
  return run;
}

TEST(Run, TheTruthsNoiseIsTakenOutOfTheError) {
  const auto run = example();
  EXPECT_NEAR(run.rigs[0].error(), 0.04, 1e-12);
  EXPECT_NEAR(run.error(), std::sqrt(0.04 * 0.16), 1e-12);
  EXPECT_NEAR(run.worst(), 0.16, 1e-12);
  const RigError buried{"", 0.02, 0.03, 0, 0, 0, 0};  // below the noise: all that is known is that it is small
  EXPECT_NEAR(buried.error(), 0.0075, 1e-12);
}

TEST(Run, TimesAreMedians) {
  const auto run = example();
  EXPECT_EQ(run.facts.seconds, 2);
  EXPECT_EQ(run.facts.core_seconds, 4);
  EXPECT_EQ(run.frame(), 2.5);
  EXPECT_EQ(median({}), 0);
}

TEST(Run, ComesBackFromDiskWhereItFits) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "run.json";
  EXPECT_FALSE(load_run(path, "k"));
  ASSERT_TRUE(save(example(), path).ok());
  const auto back = load_run(path, "k");
  ASSERT_TRUE(back);
  EXPECT_EQ(results_csv("x", {*back}), results_csv("x", {example()}));
  EXPECT_EQ(rigs_csv("x", {*back}), rigs_csv("x", {example()}));
  EXPECT_EQ(back->machines, example().machines);
  EXPECT_FALSE(load_run(path, "another"));
  ASSERT_TRUE(write_file_atomic(path, "{\"key\": \"k\"").ok());
  EXPECT_FALSE(load_run(path, "k"));
  ASSERT_TRUE(write_file_atomic(path, "{\"key\": \"k\", \"method\": 3}").ok());
  EXPECT_FALSE(load_run(path, "k"));
}

TEST(Run, CsvQuotesWhatItMust) {
  const std::string rigs = rigs_csv("le,vel", {example()});
  EXPECT_NE(rigs.find("\"le,vel\",default,\"spacing ×2, \"\"odd\"\"\",\"b,c\",0.16,0,0.16,"), std::string::npos)
      << rigs;
}

}  // namespace
}  // namespace lightloom::eval
