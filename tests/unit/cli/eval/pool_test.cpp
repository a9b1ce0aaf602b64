#include "cli/eval/pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cli/eval/report.h"

namespace lightloom::eval {
namespace {

using ::testing::HasSubstr;

Run run(const std::string& method, const std::string& label, double cost, double error) {
  Run r;
  r.method = method;
  r.label = label;
  r.facts.bytes = static_cast<uint64_t>(1000 * cost);
  Facts one;
  one.seconds = one.core_seconds = cost;
  r.add_times(one);
  if (method != "static") r.frame_ms = {cost};
  r.rigs = {{"a", error, 0, 0, 0, 0, 0}};
  return r;
}

Evaluation level(const std::string& name, double scale, const std::string& own_label) {
  Evaluation e;
  e.level = name;
  e.machine = "M";
  e.rigs = {{"a", 0, 64}};
  e.methods = {{"static", "fixed", ""}, {"default", "ours", ""}, {"other", "theirs", ""}};
  e.runs = {run("static", "64", 3 * scale, 0.3),
            run("default", "default", scale, 0.1 * scale),
            run("default", "spacing ×2", scale / 2, 0.2 * scale),
            run("default", own_label, 1, 1),
            run("other", own_label, 1, 1),
            run("other", "spacing ×2", 1, 1)};
  return e;
}

TEST(Pool, TakesGeometricMeansOfWhatAllLevelsHave) {
  const auto pooled = pool({level("a", 1, "error 1"), level("b", 4, "error 2")});
  ASSERT_TRUE(pooled.ok()) << pooled.status();
  EXPECT_EQ(pooled->pooled, (std::vector<std::string>{"a", "b"}));
  // Ours first; others' default is not on both levels, so they have none to be relative to.
  ASSERT_EQ(pooled->methods.size(), 2u);
  EXPECT_EQ(pooled->methods[0].name, "default");
  EXPECT_EQ(pooled->methods[1].name, "static");
  ASSERT_EQ(pooled->runs.size(), 3u);
  const auto& ours = pooled->runs[0];
  EXPECT_EQ(ours.label, "default");
  EXPECT_EQ(pooled->runs[1].label, "spacing ×2");
  EXPECT_NEAR(ours.error(), 0.2, 1e-12);  // √(0.1·0.4)
  EXPECT_NEAR(ours.worst(), 0.4, 1e-12);
  EXPECT_NEAR(ours.facts.seconds, 2, 1e-12);
  EXPECT_EQ(ours.facts.bytes, 2000u);
  EXPECT_NEAR(ours.frame(), 2, 1e-12);
  EXPECT_EQ(pooled->runs[2].frame(), 0);
}

TEST(Pool, ChartsAreMultiplesOfOurDefault) {
  const auto pooled = pool({level("a", 1, "x"), level("b", 4, "y")});
  ASSERT_TRUE(pooled.ok());
  const auto charts = make_charts(*pooled, nullptr);
  const auto& ours = charts[0].chart.series[0].points;
  ASSERT_EQ(ours.size(), 2u);
  EXPECT_NEAR(ours[0].x, 1, 1e-12);
  EXPECT_NEAR(ours[1].x, 0.5, 1e-12);
  EXPECT_NEAR(charts[0].chart.series[1].points[0].x, 3, 1e-12);
}

TEST(Pool, RefusesWhatCannotBeCompared) {
  const auto refused = [](const std::vector<Evaluation>& levels) {
    return std::string(pool(levels).status().message());
  };
  EXPECT_THAT(refused({}), HasSubstr("no level"));
  EXPECT_THAT(refused({level("a", 1, "x"), level("a", 2, "x")}), HasSubstr("is there twice"));
  Evaluation deeper = level("b", 1, "x");
  deeper.bounces = 8;
  EXPECT_THAT(refused({level("a", 1, "x"), deeper}), HasSubstr("8 bounces"));
  Evaluation without = level("b", 1, "x");
  std::erase_if(without.runs, [](const auto& r) { return r.method == "default"; });
  EXPECT_THAT(refused({level("a", 1, "x"), without}), HasSubstr("no run of our default"));
}

}  // namespace
}  // namespace lightloom::eval
