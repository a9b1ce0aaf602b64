// A whole farm in one process: real server, workers and client, over gRPC's in-process channel and over TCP, on a real
// state folder. Whatever happens on the way, the asset has the bytes of a bake without a farm.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "cli/earlier_bake.h"
#include "tests/cluster/farm_fixture.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using test::FarmTest;
using test::RunningWorker;
using test::value_or_die;
using ::testing::HasSubstr;

TEST_F(FarmTest, OneTwoAndFourWorkersGiveTheSameBytes) {
  for (const int workers : {1, 2, 4}) {
    std::vector<std::unique_ptr<RunningWorker>> running;
    for (int i = 0; i < workers; ++i) {
      // Some dial in, some live in the server's process.
      running.push_back(std::make_unique<RunningWorker>(i % 2 == 0 ? dial(address()) : server_->in_process_channel(),
                                                        "worker-" + std::to_string(i)));
    }
    const RemoteJob job = watch(submit().id);
    ASSERT_EQ(job.state, "done") << job.error;
    EXPECT_EQ(job.done, job.tasks);
    EXPECT_EQ(job.reused, 0u);
    expect_fetched_as_baked(job.id);
    // What is known would not be baked again.
    running.clear();
    stop_server();
    fs::remove_all(folder_.path() / "state");
    start_server("127.0.0.1:0");
  }
}

TEST_F(FarmTest, WhatAnEarlierJobBakedIsNotBakedAgain) {
  RemoteJob first = submit();
  FarmClient client(address());
  {
    const RunningWorker worker(dial(address()), "worker");
    first = watch(first.id, [&](const RemoteJob& now) {
      if (now.done >= 5) (void)client.cancel(first.id);
    });
    ASSERT_EQ(first.state, "cancelled");
    const RemoteJob second = watch(submit().id);
    ASSERT_EQ(second.state, "done") << second.error;
    EXPECT_GE(second.reused, 5u);
    EXPECT_LT(second.reused, second.tasks);
    expect_fetched_as_baked(second.id);
  }
  const RemoteJob third = submit();
  EXPECT_EQ(third.state, "done") << "at once, and without a worker";
  EXPECT_EQ(third.reused, third.tasks);
  expect_fetched_as_baked(third.id);
}

TEST_F(FarmTest, AnEditIsBakedFromAnEarlierAsset) {
  const fs::path loom = folder_.path() / "earlier.loom";
  Scene scene = value_or_die(builtin_scene("flat"));  // several rooms
  params_.texels_per_metre = 1;
  params_.rays = 16;
  (void)value_or_die(bake(*value_or_die(RayTracer::create(scene)), params_, loom, {}));
  const auto earlier = find_earlier_bake(loom);
  ASSERT_TRUE(earlier.has_value());
  ASSERT_EQ(earlier->why_not, "");
  params_ = earlier->manifest.params;

  Object& moved = *std::find_if(scene.objects.begin(), scene.objects.end(),
                                [](const Object& o) { return o.name == "crate small"; });
  moved.transform[12] += 0.03;
  for (Vec3& p : moved.positions) p.x += 0.03f;
  ASSERT_TRUE(save_gltf(scene, scene_path_).ok());
  scene_ = value_or_die(read_file(scene_path_));

  // The farm has never seen the earlier asset, and its workers are not asked for what holds of it.
  const RunningWorker worker(dial(address()), "worker");
  FarmClient client(address());
  const RemoteJob whole = watch(submit().id);
  const RemoteJob job = watch(value_or_die(client.submit(scene_, params_, &*earlier, "edit", 0, [](uint64_t) {})).id);
  ASSERT_EQ(job.state, "done") << job.error;
  const auto cells = [&](uint64_t id) {
    const std::vector<RemoteEvent> events = value_or_die(client.events(id));
    return std::count_if(events.begin(), events.end(),
                         [](const RemoteEvent& e) { return e.task.starts_with("cell ") && e.what == "completed"; });
  };
  EXPECT_GT(cells(whole.id), 10);
  EXPECT_GT(cells(job.id), 0);
  EXPECT_LT(cells(job.id), cells(whole.id));
  const CancelFlag never;
  for (const uint64_t id : {whole.id, job.id}) {
    value_or_die(client.fetch(id, folder_.path() / std::to_string(id), never, [](uint64_t, uint64_t) {}));
  }
  EXPECT_EQ(value_or_die(read_file(folder_.path() / std::to_string(job.id) / "manifest")),
            value_or_die(read_file(folder_.path() / std::to_string(whole.id) / "manifest")));
  EXPECT_EQ(verify_asset(folder_.path() / std::to_string(job.id)), absl::OkStatus());
}

TEST_F(FarmTest, WorkersLeaveAndJoinOnTheWay) {
  const RemoteJob job = submit();
  auto first = std::make_unique<RunningWorker>(dial(address()), "first");
  auto second = std::make_unique<RunningWorker>(dial(address()), "second");
  std::unique_ptr<RunningWorker> third;
  int step = 0;
  const RemoteJob end = watch(job.id, [&](const RemoteJob& now) {
    if (step == 0 && now.done >= 2) {
      first.reset();  // hands back what it has
      ++step;
    } else if (step == 1 && now.done >= 4) {
      third = std::make_unique<RunningWorker>(dial(address()), "third");
      ++step;
    } else if (step == 2 && now.done >= 6) {
      EXPECT_TRUE(second->drain().ok());
      ++step;
    }
  });
  EXPECT_EQ(step, 3);
  ASSERT_EQ(end.state, "done") << end.error;
  expect_fetched_as_baked(job.id);
}

TEST_F(FarmTest, AServerThatRestartsLosesNothing) {
  const RemoteJob job = submit();
  const std::string at = address();
  const RunningWorker worker(dial(at), "worker");
  std::atomic<bool> begun{false};
  std::thread watcher([&] {
    FarmClient client(at);
    const CancelFlag never;
    const auto end = client.watch(job.id, never, [&](const RemoteJob& now) { begun = begun || now.done >= 3; });
    ASSERT_TRUE(end.ok()) << end.status();
    EXPECT_EQ(end->state, "done") << end->error;
  });
  while (!begun) std::this_thread::yield();
  stop_server();
  start_server(at);
  watcher.join();
  expect_fetched_as_baked(job.id);
}

TEST_F(FarmTest, AJobWithoutWorkersWaitsAndIsThereAfterARestart) {
  const RemoteJob job = submit();
  const std::string at = address();
  stop_server();
  start_server(at);
  FarmClient client(at);
  EXPECT_EQ(value_or_die(client.job(job.id)).state, "running");
  EXPECT_EQ(value_or_die(client.jobs()).size(), 1u);
  const RunningWorker worker(dial(at), "worker");
  EXPECT_EQ(watch(job.id).state, "done");
  expect_fetched_as_baked(job.id);
}

TEST_F(FarmTest, CancelFreesTheWorkers) {
  params_.rays = 4096;
  const RemoteJob job = submit();
  const RunningWorker worker(dial(address()), "worker", 2);
  FarmClient client(address());
  bool cancelled = false;
  const RemoteJob end = watch(job.id, [&](const RemoteJob& now) {
    if (!cancelled && now.done >= 1 && now.running > 0) {
      cancelled = true;
      EXPECT_EQ(value_or_die(client.cancel(job.id)).state, "cancelled");
    }
  });
  EXPECT_EQ(end.state, "cancelled");
  EXPECT_LT(end.done, end.tasks);
  EXPECT_EQ(value_or_die(client.cancel(job.id)).state, "cancelled");
  // The worker goes on with what comes next.
  params_.rays = 16;
  EXPECT_EQ(watch(submit().id).state, "done");
}

TEST_F(FarmTest, ALevelThatCannotBeBakedFailsWithTheReason) {
  scene_.resize(scene_.size() / 2);
  const RemoteJob job = submit();
  const RunningWorker worker(dial(address()), "worker");
  const RemoteJob end = watch(job.id);
  EXPECT_EQ(end.state, "failed");
  EXPECT_THAT(end.error, HasSubstr("level.glb"));
  FarmClient client(address());
  const CancelFlag never;
  const auto fetched = client.fetch(job.id, folder_.path() / "x.loom", never, [](uint64_t, uint64_t) {});
  EXPECT_THAT(std::string(fetched.status().message()), HasSubstr("is failed"));
  EXPECT_FALSE(fs::exists(folder_.path() / "x.loom"));
  const auto events = value_or_die(client.events(job.id));
  EXPECT_EQ(
      std::count_if(events.begin(), events.end(), [](const RemoteEvent& e) { return e.what.starts_with("failed"); }),
      3);
}

TEST_F(FarmTest, ErrorsSayWhatIsWrong) {
  FarmClient client(address());
  const CancelFlag never;
  EXPECT_EQ(client.job(77).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(client.cancel(77).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(client.watch(77, never, [](const RemoteJob&) {}).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(client.events(77).status().code(), absl::StatusCode::kNotFound);
  const auto unfinished = client.fetch(submit().id, folder_.path() / "x.loom", never, [](uint64_t, uint64_t) {});
  EXPECT_THAT(std::string(unfinished.status().message()), HasSubstr("is running"));
  const auto second = Farm::open(folder_.path() / "state");
  ASSERT_FALSE(second.ok());
  EXPECT_THAT(std::string(second.status().message()), HasSubstr((folder_.path() / "state").string()));
}

TEST_F(FarmTest, AWorkerOfAnotherMethodIsTurnedAway) {
  Introduction other = introduce_this_machine(1);
  other.method_version = "none";
  LocalExecutor executor(dial(address()), 1, 0);
  Worker worker(dial(address()), &executor, {"worker", other});
  EXPECT_EQ(worker.run().code(), absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace lightloom
