// A bake task by task, by several workers in any order, is the bake.
#include "core/bake/task_runner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <optional>
#include <random>
#include <thread>

#include "core/bake/bake.h"
#include "core/base/file.h"
#include "core/scene/builtin.h"
#include "core/scene/gltf.h"
#include "tests/support/baked_level.h"

namespace lightloom {
namespace {

using test::value_or_die;
using ::testing::HasSubstr;

class MapBlobs : public BlobAccess {
 public:
  absl::StatusOr<std::vector<uint8_t>> get(const Digest& digest) override {
    const std::lock_guard lock(mutex_);
    ++gets[digest];
    const auto it = blobs.find(digest);
    if (it == blobs.end()) return absl::NotFoundError("there is no such blob");
    return it->second;
  }
  absl::Status put(const std::vector<std::vector<uint8_t>>& many) override {
    const std::lock_guard lock(mutex_);
    for (const std::vector<uint8_t>& bytes : many) blobs[sha256(bytes)] = bytes;
    ++puts;
    return absl::OkStatus();
  }
  Digest put_one(const std::vector<uint8_t>& bytes) {
    EXPECT_TRUE(put({bytes}).ok());
    return sha256(bytes);
  }

  std::map<Digest, std::vector<uint8_t>> blobs;
  std::map<Digest, int> gets;
  int puts = 0;

 private:
  std::mutex mutex_;
};

BakeParams tiny() {
  BakeParams p;
  p.order = 2;
  p.spacing = 0.4f;
  p.rays = 16;
  p.relight_rays = 64;
  p.texels_per_metre = 4;
  p.cell_receivers = 64;
  return p;
}

class TaskRunnerTest : public ::testing::Test {
 protected:
  TaskRunnerTest() {
    EXPECT_TRUE(save_gltf(value_or_die(builtin_scene("cornell")), folder_.path() / "cornell.glb").ok());
    glb_ = value_or_die(read_file(folder_.path() / "cornell.glb"));
    scene_ = blobs_.put_one(glb_);
  }

  BakeTask task(const SpawnedTask& spawned, const BakeParams& params = tiny()) const {
    return {spawned.kind, encode_payload({scene_, params}), spawned.argument, inputs_};
  }
  TaskOutput plan(const BakeParams& params = tiny()) { return value_or_die(runner_.run(task(first_task(), params))); }
  /// The first task of that kind.
  static SpawnedTask find(const TaskOutput& plan, const std::string& kind) {
    return *std::find_if(plan.spawned.begin(), plan.spawned.end(), [&](const auto& t) { return t.kind == kind; });
  }
  /// The error's message, which must be one line.
  std::string error(const BakeTask& task, absl::StatusCode code) {
    const auto result = runner_.run(task);
    EXPECT_EQ(result.status().code(), code) << result.status();
    const std::string message(result.status().message());
    EXPECT_EQ(message.find('\n'), message.npos) << message;
    return message;
  }

  test::TemporaryFolder folder_;
  std::vector<uint8_t> glb_;
  MapBlobs blobs_;
  Digest scene_, inputs_;
  TaskRunner runner_{&blobs_};
};

TEST_F(TaskRunnerTest, ShuffledOverTwoRunnersIsTheBakeByteForByte) {
  const Scene scene = value_or_die(load_gltf(folder_.path() / "cornell.glb"));
  const auto tracer = value_or_die(RayTracer::create(scene));
  const std::filesystem::path loom = folder_.path() / "cornell.loom";
  const BakeReport report = value_or_die(bake(*tracer, tiny(), loom, {}));

  const TaskOutput planned = plan();
  const PlanSummary summary = value_or_die(decode_plan_summary(value_or_die(blobs_.get(planned.outputs.front()))));
  EXPECT_EQ(summary.cells, report.cells);
  EXPECT_GT(summary.cells, 8u);
  EXPECT_GT(summary.probes, kRelightProbes);
  EXPECT_EQ(summary.receivers, report.receivers);

  std::vector<SpawnedTask> spawned = planned.spawned;
  ASSERT_EQ(spawned.back().kind, "assemble");
  ASSERT_EQ(spawned.back().stage, 2u);
  const SpawnedTask last = spawned.back();
  spawned.pop_back();
  std::shuffle(spawned.begin(), spawned.end(), std::mt19937(7));
  TaskRunner other(&blobs_);
  std::vector<FinishedTask> finished(spawned.size() + 1);
  finished.back() = {"plan", {}, planned.outputs};
  Parallel two;
  two.threads = 2;
  ASSERT_TRUE(parallel_for(spawned.size(), two, [&](uint64_t i) {
    EXPECT_EQ(spawned[i].stage, 1u);
    TaskRunner& runner = i % 2 == 0 ? runner_ : other;
    finished[i] = {spawned[i].kind, spawned[i].argument, value_or_die(runner.run(task(spawned[i]))).outputs};
  }));
  EXPECT_EQ(blobs_.gets[scene_], 2) << "each runner plans once";

  inputs_ = blobs_.put_one(encode_task_list(finished));
  const TaskOutput assembled = value_or_die(other.run(task(last)));
  ASSERT_EQ(assembled.outputs.size(), 2u);
  const auto manifest_bytes = value_or_die(blobs_.get(assembled.outputs.front()));
  EXPECT_EQ(manifest_bytes, value_or_die(read_file(loom / "manifest")));

  const ChunkStore store = chunk_store(loom);
  const Manifest manifest = value_or_die(decode_manifest(manifest_bytes));
  EXPECT_EQ(value_or_die(blobs_.get(assembled.outputs.back())), value_or_die(read_traces(loom, manifest)));
  for (const ChunkRef& ref : chunks_of(manifest)) {
    EXPECT_EQ(value_or_die(blobs_.get(ref.digest)), value_or_die(store.get(ref)));
  }
}

TEST_F(TaskRunnerTest, AnEditRunsFewerTasksForTheSameManifest) {
  BakeParams quick = tiny();
  quick.rays = 4;
  quick.max_rank = 1;
  // All tasks of a plan; the manifest's blob and that of the traces.
  const auto bake_all = [&](const SpawnedTask& first, size_t* tasks) {
    const TaskOutput planned = value_or_die(runner_.run(task(first, quick)));
    std::vector<FinishedTask> finished{{"plan", first.argument, planned.outputs}};
    for (const SpawnedTask& t : planned.spawned) {
      if (t.stage == 2) inputs_ = blobs_.put_one(encode_task_list(finished));
      finished.push_back({t.kind, t.argument, value_or_die(runner_.run(task(t, quick))).outputs});
    }
    *tasks = finished.size();
    return finished.back().outputs;
  };
  size_t all = 0, none = 0, some = 0, anew = 0;
  const auto before = bake_all(first_task(), &all);
  const EarlierResults earlier{before[1]};
  EXPECT_EQ(bake_all(first_task(&earlier), &none), before);
  EXPECT_LT(none, all / 2) << "plan, surfaces, assembly, and probes that no cell reads: of those nothing is kept";

  Scene scene = value_or_die(load_gltf(folder_.path() / "cornell.glb"));
  Object& moved = scene.objects.back();
  moved.transform[12] += 0.05;
  for (Vec3& p : moved.positions) p.x += 0.05f;
  ASSERT_TRUE(save_gltf(scene, folder_.path() / "edited.glb").ok());
  scene_ = blobs_.put_one(value_or_die(read_file(folder_.path() / "edited.glb")));
  const auto rebaked = bake_all(first_task(&earlier), &some);
  EXPECT_EQ(rebaked[0], bake_all(first_task(), &anew)[0]);
  EXPECT_NE(rebaked[0], before[0]);
  EXPECT_LE(some, anew);

  // What is kept stale is on record, and done anew by who tolerates less.
  size_t tolerant = 0, finishing = 0;
  const EarlierResults lenient{before[1], 1};
  const auto stale = bake_all(first_task(&lenient), &tolerant);
  EXPECT_LT(tolerant, some);
  EXPECT_GT(report_of(value_or_die(decode_manifest(value_or_die(blobs_.get(stale[0]))))).stale, 0);
  const EarlierResults from_stale{stale[1]};
  EXPECT_EQ(bake_all(first_task(&from_stale), &finishing)[0], rebaked[0]);
  EXPECT_GT(finishing, 3u);
}

TEST_F(TaskRunnerTest, WhatATaskMakesGoesOutTogether) {
  const TaskOutput planned = plan();
  for (const char* kind : {"cell", "relight", "surfaces"}) {
    blobs_.puts = 0;
    EXPECT_GT(value_or_die(runner_.run(task(find(planned, kind)))).outputs.size(), 1u);
    EXPECT_EQ(blobs_.puts, 1) << kind;
  }
}

TEST_F(TaskRunnerTest, RepeatedTasksGiveEqualOutputs) {
  const TaskOutput planned = plan();
  for (const char* kind : {"cell", "relight", "surfaces"}) {
    const BakeTask repeated = task(find(planned, kind));
    const TaskOutput first = value_or_die(runner_.run(repeated));
    EXPECT_EQ(value_or_die(runner_.run(repeated)).outputs, first.outputs) << kind;
    for (const Digest& d : first.outputs) EXPECT_TRUE(blobs_.get(d).ok()) << kind;
  }
  EXPECT_EQ(plan().outputs, planned.outputs);
}

TEST_F(TaskRunnerTest, SessionsThatDropOutComeBack) {
  TaskRunner one(&blobs_, 1);
  BakeParams other = tiny();
  other.order = 1;
  const BakeTask a = task(find(plan(), "cell")), b = task(find(plan(other), "cell"), other);
  blobs_.gets.clear();
  const TaskOutput first = value_or_die(one.run(a));
  EXPECT_NE(value_or_die(one.run(b)).outputs, first.outputs);
  EXPECT_EQ(value_or_die(one.run(b)).outputs, value_or_die(runner_.run(b)).outputs);
  EXPECT_EQ(value_or_die(one.run(a)).outputs, first.outputs);
  EXPECT_EQ(blobs_.gets[scene_], 3) << "a, b and a again";
}

TEST_F(TaskRunnerTest, SessionsStayWarmWithinTheLimit) {
  BakeParams other = tiny();
  other.order = 1;
  const BakeTask a = task(find(plan(), "cell")), b = task(find(plan(other), "cell"), other);
  TaskRunner both(&blobs_, uint64_t{1} << 30);
  blobs_.gets.clear();
  for (const BakeTask& t : {a, b, a, b}) value_or_die(both.run(t));
  EXPECT_EQ(blobs_.gets[scene_], 2);
}

TEST_F(TaskRunnerTest, SessionsKnowWhatTheyTake) {
  const auto session = value_or_die(BakeSession::create(value_or_die(builtin_scene("cornell")), tiny(), {}));
  const uint64_t before = session->bytes();
  EXPECT_GT(before, session->plan().receivers.all.size() * sizeof(Receiver));
  const ChunkSink sink = [&](std::span<const uint8_t> bytes) -> absl::StatusOr<ChunkRef> {
    return ChunkRef{sha256(bytes), bytes.size()};
  };
  value_or_die(session->cell(0, sink));
  EXPECT_GT(session->bytes(), before) << "it remembers what it saw";
  EXPECT_LT(session->bytes(), uint64_t{1} << 30);
}

TEST_F(TaskRunnerTest, CancelStopsATaskAndOnlyThat) {
  CancelFlag cancel;
  BakeControl control;
  control.cancel = &cancel;
  std::vector<std::string> stages;
  control.progress = [&](const std::string& stage, uint64_t, uint64_t, uint64_t) {
    stages.push_back(stage);
    if (stage == "probes") cancel.cancel();
  };
  const BakeTask first = task(first_task());
  EXPECT_EQ(runner_.run(first, control).status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(stages.back(), "probes");
  const TaskOutput planned = value_or_die(runner_.run(first));
  control.progress = nullptr;
  for (const char* kind : {"cell", "relight", "surfaces"}) {
    EXPECT_EQ(runner_.run(task(find(planned, kind)), control).status().code(), absl::StatusCode::kCancelled) << kind;
  }
}

TEST_F(TaskRunnerTest, WhoWaitsOutlivesACancelledPlanner) {
  CancelFlag cancel;
  BakeControl control;
  control.cancel = &cancel;
  std::optional<std::jthread> waiting;
  absl::StatusOr<TaskOutput> waited = absl::UnknownError("did not run");
  control.progress = [&](const std::string&, uint64_t, uint64_t, uint64_t) {
    if (!waiting) waiting.emplace([&] { waited = runner_.run(task(first_task())); });
    cancel.cancel();
  };
  EXPECT_EQ(runner_.run(task(first_task()), control).status().code(), absl::StatusCode::kCancelled);
  ASSERT_TRUE(waiting.has_value());
  waiting->join();
  EXPECT_TRUE(waited.ok()) << waited.status();
}

// Else those who wait could hold all the cores that the one who plans waits for.
TEST_F(TaskRunnerTest, WhoWaitsForAnothersPlanStandsAside) {
  std::atomic<bool> stands_aside = false;
  TaskRunner runner(&blobs_, uint64_t{1} << 30, [&](const std::function<void()>& wait) {
    stands_aside = true;
    stands_aside.notify_all();
    wait();
  });
  std::optional<std::jthread> waiting;
  absl::StatusOr<TaskOutput> waited = absl::UnknownError("did not run");
  BakeControl control;
  control.progress = [&](const std::string&, uint64_t, uint64_t, uint64_t) {
    if (!waiting) waiting.emplace([&] { waited = runner.run(task(first_task())); });
    stands_aside.wait(false);
  };
  EXPECT_TRUE(runner.run(task(first_task()), control).ok());
  ASSERT_TRUE(waiting.has_value());
  waiting->join();
  EXPECT_TRUE(waited.ok()) << waited.status();
}

TEST_F(TaskRunnerTest, RefusesWhatItCannotRun) {
  using enum absl::StatusCode;
  const TaskOutput planned = plan();
  const Digest digest = value_or_die(decode_plan_summary(value_or_die(blobs_.get(planned.outputs.front())))).plan;

  EXPECT_THAT(error(task({"dance\n", 0, {}, 0}), kInvalidArgument), HasSubstr("kind 'dance\\n' is unknown"));
  BakeParams bad = tiny();
  bad.order = 77;
  EXPECT_THAT(error(task(first_task(), bad), kInvalidArgument), HasSubstr("payload: --order"));
  EXPECT_THAT(error({"plan", {1, 2, 3}, {}, {}}, kInvalidArgument), HasSubstr("payload is corrupt"));
  EXPECT_THAT(error({"plan", encode_payload({sha256("no"), tiny()}), {}, {}}, kNotFound),
              HasSubstr("the level, blob " + sha256("no").hex()));
  const Digest garbage = blobs_.put_one(std::vector<uint8_t>(64, 'x'));
  EXPECT_THAT(error({"plan", encode_payload({garbage, tiny()}), {}, {}}, kInvalidArgument), HasSubstr("level.glb"));
  blobs_.blobs[sha256("other")] = glb_;
  EXPECT_THAT(error({"plan", encode_payload({sha256("other"), tiny()}), {}, {}}, kDataLoss),
              HasSubstr("has other bytes"));

  const auto with_argument = [&](const char* kind, uint32_t first, uint32_t count, const Digest& of) {
    return task({kind, 1, encode_argument({of, first, count}), 0});
  };
  EXPECT_THAT(error(with_argument("cell", 1u << 30, 1, digest), kOutOfRange), HasSubstr("there is no cell 1073741824"));
  EXPECT_THAT(error(with_argument("relight", 4000000000u, 4000000000u, digest), kOutOfRange), HasSubstr("no probe"));
  EXPECT_THAT(error(with_argument("surfaces", 99, 1, digest), kOutOfRange), HasSubstr("no object 99"));
  EXPECT_THAT(error(with_argument("cell", 0, 1, sha256("another")), kFailedPrecondition), HasSubstr("plans the bake"));
  EXPECT_THAT(error(task({"cell", 1, {}, 0}), kInvalidArgument), HasSubstr("task argument is corrupt"));
  EXPECT_THAT(error(task({"plan", 0, {1}, 0}), kInvalidArgument), HasSubstr("argument of plan is corrupt"));
}

TEST_F(TaskRunnerTest, AssembleRefusesListsThatDoNotFit) {
  using enum absl::StatusCode;
  const TaskOutput planned = plan();
  const SpawnedTask cell = find(planned, "cell"), relight = find(planned, "relight"), last = planned.spawned.back();
  const auto run = [&](const SpawnedTask& t) {
    return FinishedTask{t.kind, t.argument, value_or_die(runner_.run(task(t))).outputs};
  };
  const FinishedTask cell_0 = run(cell), relight_0 = run(relight);
  const auto assemble = [&](const std::vector<FinishedTask>& list, absl::StatusCode code) {
    inputs_ = blobs_.put_one(encode_task_list(list));
    return error(task(last), code);
  };
  EXPECT_THAT(error(task(last), kNotFound), HasSubstr("the task list"));
  EXPECT_THAT(assemble({}, kInvalidArgument), HasSubstr("lacks cell 0"));
  EXPECT_THAT(assemble({cell_0, relight_0}, kInvalidArgument), HasSubstr("lacks cell 1"));
  EXPECT_THAT(assemble({cell_0, cell_0}, kInvalidArgument), HasSubstr("cell 0 twice"));
  EXPECT_THAT(assemble({{"cell", cell.argument, {}}}, kInvalidArgument), HasSubstr("no outputs"));
  EXPECT_THAT(assemble({{"cell", cell.argument, {sha256("gone")}}}, kNotFound), HasSubstr("what 'cell' gave"));
  EXPECT_THAT(assemble({{"cell", cell.argument, relight_0.outputs}}, kDataLoss), HasSubstr("cell record is corrupt"));
  EXPECT_THAT(assemble({{"relight", cell.argument, relight_0.outputs}}, kInvalidArgument), HasSubstr("does not fit"));
  EXPECT_THAT(assemble({{"surfaces", cell.argument, relight_0.outputs}}, kInvalidArgument),
              HasSubstr("chunk list is corrupt"));
  EXPECT_THAT(assemble({{"dance", relight.argument, relight_0.outputs}}, kInvalidArgument), HasSubstr("unknown kind"));
}

}  // namespace
}  // namespace lightloom
