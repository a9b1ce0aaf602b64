// A whole farm in one process: real server, workers and client, over gRPC's in-process channel and over TCP, on a real
// state folder. Whatever happens on the way, the asset has the bytes of a bake without a farm.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "bake-server/grpc/server.h"
#include "bake-worker/worker.h"
#include "cli/farm_client.h"
#include "core/asset/asset.h"
#include "core/base/file.h"
#include "core/base/version.h"
#include "core/scene/builtin.h"
#include "core/scene/gltf.h"
#include "proto/client.h"
#include "proto/protocol_version.h"
#include "tests/support/baked_level.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using test::value_or_die;
using ::testing::HasSubstr;

ServerInfo this_release() { return {std::string(kVersion), kProtocolVersion, std::string(kMethodVersion)}; }

/// A worker with its thread.
class RunningWorker {
 public:
  RunningWorker(std::shared_ptr<grpc::Channel> channel, const std::string& name, uint32_t threads = 1)
      : worker_(std::move(channel), {name, introduce_this_machine(threads), 1}),
        thread_([this] { status_ = worker_.run(); }) {}
  ~RunningWorker() {
    worker_.stop();
    if (thread_.joinable()) thread_.join();
  }
  /// Finishes what it has and leaves.
  absl::Status drain() {
    worker_.drain();
    thread_.join();
    return status_;
  }
  /// Until it ends by itself.
  absl::Status wait() {
    thread_.join();
    return status_;
  }

 private:
  Worker worker_;
  absl::Status status_;
  std::thread thread_;
};

class FarmTest : public testing::Test {
 protected:
  void SetUp() override {
    params_.texels_per_metre = 3;
    params_.rays = 64;
    params_.relight_rays = 256;
    params_.cell_receivers = 128;
    scene_path_ = folder_.path() / "level.glb";
    ASSERT_TRUE(save_gltf(value_or_die(builtin_scene("cornell")), scene_path_).ok());
    scene_ = value_or_die(read_file(scene_path_));
    start_server("127.0.0.1:0");
  }
  void start_server(const std::string& address) {
    CoordinatorOptions options;
    options.lease_ms = 5'000;
    farm_ = value_or_die(Farm::open(folder_.path() / "state", options));
    server_ = value_or_die(Server::start(address, this_release(), farm_.get()));
  }
  /// As if the power went: nothing is said to anyone but by closed connections.
  void stop_server() {
    server_.reset();
    farm_.reset();
  }
  std::string address() const { return server_->address(); }

  RemoteJob submit(int priority = 0) {
    FarmClient client(address());
    return value_or_die(client.submit(scene_, params_, "cornell", priority, [](uint64_t) {}));
  }
  RemoteJob watch(
      uint64_t id, const std::function<void(const RemoteJob&)>& changed = [](const RemoteJob&) {}) {
    FarmClient client(address());
    const CancelFlag never;
    return value_or_die(client.watch(id, never, changed));
  }
  /// What a bake without a farm has under each name.
  std::map<std::string, std::vector<uint8_t>> files_of(const fs::path& loom) {
    std::map<std::string, std::vector<uint8_t>> out;
    for (const auto& file : fs::recursive_directory_iterator(loom)) {
      if (file.is_regular_file()) out[fs::relative(file.path(), loom)] = value_or_die(read_file(file.path()));
    }
    return out;
  }
  void expect_fetched_as_baked(uint64_t job) {
    FarmClient client(address());
    const CancelFlag never;
    const fs::path fetched = folder_.path() / ("fetched" + std::to_string(job));
    value_or_die(client.fetch(job, fetched, never, [](uint64_t, uint64_t) {}));
    if (baked_.empty()) {
      const Scene scene = value_or_die(load_gltf(scene_path_));
      const auto tracer = value_or_die(RayTracer::create(scene));
      value_or_die(bake(*tracer, params_, folder_.path() / "baked", {}));
      baked_ = files_of(folder_.path() / "baked");
    }
    EXPECT_EQ(files_of(fetched), baked_);
    EXPECT_TRUE(verify_asset(fetched).ok());
  }

  test::TemporaryFolder folder_;
  fs::path scene_path_;
  std::vector<uint8_t> scene_;
  BakeParams params_;
  std::map<std::string, std::vector<uint8_t>> baked_;
  std::unique_ptr<Farm> farm_;
  std::unique_ptr<Server> server_;  // before the farm it works on
};

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
    expect_fetched_as_baked(job.id);
  }
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
  Worker worker(dial(address()), {"worker", other, 1});
  EXPECT_EQ(worker.run().code(), absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace lightloom
