// What is chosen for small levels. How near the estimates are to the truth: docs/eval.md.
#include "core/tuning/tune.h"

#include <gtest/gtest.h>

#include "core/bake/bake.h"
#include "core/scene/builtin.h"
#include "tests/support/baked_level.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using test::value_or_die;

struct Level {
  explicit Level(Scene s) : scene(std::move(s)), tracer(value_or_die(RayTracer::create(scene))) {}
  Scene scene;
  std::unique_ptr<RayTracer> tracer;

  Tuning tuned(const TuneTarget& target, int threads = 0) const {
    BakeParams request;
    request.texels_per_metre = 4;
    BakeControl control;
    control.threads = threads;
    return value_or_die(tune(*tracer, request, target, control));
  }
};

Level cornell() { return Level(value_or_die(builtin_scene("cornell"))); }

TEST(Tune, AnEmptyBoxGetsATrivialModel) {
  const Tuning t = Level(test::closed_box({4, 3, 4})).tuned({0.1, 0});
  EXPECT_TRUE(t.met);
  EXPECT_LE(t.chosen.probes, 32u);  // the default spacing gives it 200
  EXPECT_LE(t.chosen.parts.total(), 0.1);
}

TEST(Tune, ASmallerErrorTakesMore) {
  const Level level = cornell();
  double before = 0;
  for (const double error : {0.4, 0.2, 0.12}) {
    const Tuning t = level.tuned({error, 0});
    ASSERT_TRUE(t.met) << error;
    EXPECT_LE(t.chosen.parts.total(), error);
    EXPECT_GT(t.chosen.bytes, before) << error;
    before = t.chosen.bytes;
  }
}

TEST(Tune, NoPartIsModelledFinerThanTheOthersLetShow) {
  const Tuning t = cornell().tuned({0.15, 0});
  const ErrorParts& p = t.chosen.parts;
  EXPECT_GE(p.total(), 0.5 * 0.15);  // not far below what was asked for
  EXPECT_GT(p.bandlimit, p.truncation);
  EXPECT_GT(p.truncation, 0.05 * p.total());
  EXPECT_LT(p.fp16, 0.1 * p.total());
}

TEST(Tune, AnErrorOutOfReachEndsAtTheKnee) {
  const Tuning t = cornell().tuned({0.001, 0});
  EXPECT_FALSE(t.met);
  EXPECT_GT(t.chosen.parts.total(), 0.001);
  ASSERT_TRUE(t.next);  // one step more: dearer, and little better
  EXPECT_GT(t.next->bytes, t.chosen.bytes);
  EXPECT_GT(t.next->parts.total(), 0.75 * t.chosen.parts.total());
}

TEST(Tune, ABudgetIsKept) {
  const Level level = cornell();
  double before = 1;
  for (const uint64_t bytes : {400'000u, 1'500'000u}) {
    const Tuning t = level.tuned({0, bytes});
    EXPECT_LE(t.chosen.bytes, static_cast<double>(bytes));
    EXPECT_LT(t.chosen.parts.total(), before);
    before = t.chosen.parts.total();
  }
}

TEST(Tune, TheEstimateIsWhatABakeGives) {
  const Level level = cornell();
  for (const TuneTarget& target : {TuneTarget{0.15, 0}, TuneTarget{0, 1'000'000}}) {
    const Tuning t = level.tuned(target);
    const test::TemporaryFolder folder;
    const BakeReport baked = value_or_die(bake(*level.tracer, t.chosen.params, folder.path() / "a.loom", {}));
    EXPECT_NEAR(static_cast<double>(baked.bytes_total), t.chosen.bytes, 0.1 * t.chosen.bytes);
    EXPECT_TRUE(target.bytes == 0 || baked.bytes_total <= target.bytes) << baked.bytes_total;
  }
}

TEST(Tune, ABudgetThatNothingFitsSaysWhatWould) {
  const Level level = cornell();
  BakeParams request;
  request.texels_per_metre = 4;
  const auto t = tune(*level.tracer, request, {0, 1000}, {});
  EXPECT_EQ(t.status().code(), absl::StatusCode::kInvalidArgument);
  const std::string message(t.status().message()), before = "the least model of this level takes about ";
  ASSERT_NE(message.find(before), std::string::npos) << message;
  const uint64_t named = std::stoull(message.substr(message.find(before) + before.size()));
  EXPECT_LE(level.tuned({0, named}).chosen.bytes, static_cast<double>(named));
}

TEST(Tune, DependsOnNeitherThreadsNorTheLevelsLights) {
  Level level = cornell();
  const Tuning one = level.tuned({0.12, 0}, 1);
  level.scene.lights.clear();
  const Tuning four = level.tuned({0.12, 0}, 4);
  EXPECT_TRUE(one.chosen.params == four.chosen.params);
  EXPECT_EQ(one.chosen.parts.total(), four.chosen.parts.total());
  EXPECT_EQ(one.chosen.bytes, four.chosen.bytes);
}

TEST(Tune, StopsWhenCancelledInAnyStage) {
  const Level level = cornell();
  BakeParams request;
  request.texels_per_metre = 3;
  for (const std::string when : {"", "parameters: truth", "parameters: probes", "parameters: rank"}) {
    CancelFlag cancel;
    BakeControl control;
    control.cancel = &cancel;
    control.progress = [&](const std::string& stage, uint64_t, uint64_t, uint64_t) {
      if (stage == when) cancel.cancel();
    };
    if (when.empty()) cancel.cancel();
    EXPECT_EQ(tune(*level.tracer, request, {0.15, 0}, control).status().code(), absl::StatusCode::kCancelled) << when;
  }
}

}  // namespace
}  // namespace lightloom
