// A farm in the test's process: real server, workers and client on a real state folder, and what a bake without a farm gives.
#pragma once

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "bake-server/grpc/server.h"
#include "bake-worker/local_executor.h"
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

namespace lightloom::test {

inline ServerInfo this_release() { return {std::string(kVersion), kProtocolVersion, std::string(kMethodVersion)}; }

/// A worker with its thread.
class RunningWorker {
 public:
  RunningWorker(const std::shared_ptr<grpc::Channel>& channel, const std::string& name, uint32_t threads = 1)
      : RunningWorker(channel, std::make_unique<LocalExecutor>(channel, threads, 0), name, threads) {}
  RunningWorker(const std::shared_ptr<grpc::Channel>& channel, std::unique_ptr<TaskExecutor> executor,
                const std::string& name, uint32_t threads)
      : executor_(std::move(executor)),
        worker_(channel, executor_.get(), {name, introduce_this_machine(threads)}),
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
  const std::unique_ptr<TaskExecutor> executor_;
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
    options.dispatch.lease_ms = 5'000;
    farm_ = value_or_die(Farm::open(folder_.path() / "state", options, Durability::kPowerLoss, {}, database_));
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
    return value_or_die(client.submit(scene_, params_, nullptr, "cornell", priority, [](uint64_t) {}));
  }
  RemoteJob watch(
      uint64_t id, const std::function<void(const RemoteJob&)>& changed = [](const RemoteJob&) {}) {
    FarmClient client(address());
    const CancelFlag never;
    return value_or_die(client.watch(id, never, changed));
  }
  /// What a bake without a farm has under each name.
  std::map<std::string, std::vector<uint8_t>> files_of(const std::filesystem::path& loom) {
    std::map<std::string, std::vector<uint8_t>> out;
    for (const auto& file : std::filesystem::recursive_directory_iterator(loom)) {
      if (file.is_regular_file())
        out[std::filesystem::relative(file.path(), loom)] = value_or_die(read_file(file.path()));
    }
    return out;
  }
  void expect_fetched_as_baked(uint64_t job) {
    FarmClient client(address());
    const CancelFlag never;
    const std::filesystem::path fetched = folder_.path() / ("fetched" + std::to_string(job));
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

  /// The server starts on what is there; the job has so many tasks done, and another worker finishes it.
  void expect_to_go_on(uint64_t job, uint64_t done) {
    start_server("127.0.0.1:0");
    FarmClient client(address());
    const RemoteJob there = value_or_die(client.job(job));
    EXPECT_EQ(there.state, "running");
    EXPECT_GE(there.done, done);
    const RunningWorker worker(dial(address()), "another");
    const RemoteJob end = watch(job);
    ASSERT_EQ(end.state, "done") << end.error;
    expect_fetched_as_baked(job);
  }

  TemporaryFolder folder_;
  std::filesystem::path scene_path_;
  std::vector<uint8_t> scene_;
  BakeParams params_;
  std::string database_;  // PostgreSQL's address; empty: SQLite
  std::map<std::string, std::vector<uint8_t>> baked_;
  std::unique_ptr<Farm> farm_;
  std::unique_ptr<Server> server_;  // before the farm it works on
};

}  // namespace lightloom::test
