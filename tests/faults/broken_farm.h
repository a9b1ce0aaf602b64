// A farm of real programs that a test breaks while it works, and what clients were told of it meanwhile.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "cli/farm_client.h"
#include "core/base/file.h"
#include "core/scene/builtin.h"
#include "core/scene/gltf.h"
#include "tests/support/baked_level.h"
#include "tests/support/process.h"

namespace lightloom::test {

class BrokenFarm : public testing::Test {
 protected:
  using Words = std::vector<std::string>;
  using Files = std::map<std::string, std::vector<uint8_t>>;

  void SetUp() override {
    scene_path_ = folder_.path() / "level.glb";
    ASSERT_TRUE(save_gltf(value_or_die(builtin_scene("cornell")), scene_path_).ok());
    scene_ = value_or_die(read_file(scene_path_));
  }
  /// A fault counts only if its victim was at work.
  void TearDown() override {
    std::printf("%d faults injected, %d finished clusters lost, %zu jobs\n", faults_, lost_, told_.size());
    EXPECT_EQ(lost_, 0);
  }

  /// On the same address each time; the first time on a free port of `host`.
  void start_server(const std::string& host = "127.0.0.1", const Words& prefix = {}) {
    Words command = prefix;
    for (const std::string& word : {std::string(QUICK_SERVER), (folder_.path() / "state").string(),
                                    address_.empty() ? host + ":0" : address_, database_}) {
      if (!word.empty()) command.push_back(word);
    }
    server_ = std::make_unique<Process>(command);
    const std::string line = server_->line_with("listening on ");
    ASSERT_NE(line, "") << server_->output();
    address_ = line.substr(line.rfind(' ') + 1);
  }
  /// Of one thread; it has joined.
  void start_worker(const std::string& name, const Words& prefix = {}) {
    auto& worker = workers_[name];
    worker.reset();
    Words command = prefix;
    for (const char* word : {LIGHTLOOM_WORKER, "--threads", "1", "--timeout", "60", "--server"})
      command.push_back(word);
    command.insert(command.end(), {worker_server_.empty() ? address_ : worker_server_, "--name", name});
    worker = std::make_unique<Process>(command);
    ASSERT_NE(worker->line_with(name + " joined"), "") << worker->output();
  }

  /// Each `variant` is another bake.
  static BakeParams params(int variant) {
    BakeParams p;
    p.texels_per_metre = 3;
    p.rays = 256 + variant;
    p.relight_rays = 256;
    p.cell_receivers = 64;
    return p;
  }
  RemoteJob submit(int variant) {
    FarmClient client(address_);
    const RemoteJob job = value_or_die(client.submit(scene_, params(variant), nullptr, "level", 0, [](uint64_t) {}));
    told_[job.id] = job.done;
    return job;
  }
  /// Until it ends. `changed` may break things.
  RemoteJob watch(
      uint64_t id, const std::function<void(const RemoteJob&)>& changed = [](const RemoteJob&) {}) {
    FarmClient client(address_);
    const CancelFlag never;
    return value_or_die(client.watch(id, never, [&](const RemoteJob& job) {
      note(job);
      changed(job);
    }));
  }
  /// What was said to be done must stay done.
  void note(const RemoteJob& job) {
    uint64_t& told = told_[job.id];
    if (job.done < told) lost_ += static_cast<int>(told - job.done);
    told = job.done;
  }
  void note_all() {
    FarmClient client(address_);
    for (const RemoteJob& job : value_or_die(client.jobs())) note(job);
  }
  /// Those that have tasks now.
  std::set<std::string> busy() {
    FarmClient client(address_);
    std::set<std::string> out;
    for (const RemoteWorker& worker : value_or_die(client.workers())) {
      if (worker.running > 0) out.insert(worker.id);
    }
    return out;
  }
  bool any_event(uint64_t job, const std::string& what, const std::string& worker = "") {
    FarmClient client(address_);
    for (const RemoteEvent& e : value_or_die(client.events(job))) {
      if (e.what.starts_with(what) && (worker.empty() || e.worker == worker)) return true;
    }
    return false;
  }

  static Files files_of(const std::filesystem::path& loom) {
    Files out;
    for (const auto& file : std::filesystem::recursive_directory_iterator(loom)) {
      if (file.is_regular_file())
        out[std::filesystem::relative(file.path(), loom)] = value_or_die(read_file(file.path()));
    }
    return out;
  }
  static std::set<std::string> names_of(const Files& files) {
    std::set<std::string> out;
    for (const auto& [name, bytes] : files) out.insert(name);
    return out;
  }
  absl::Status fetch(uint64_t job, const std::string& address = "") {
    FarmClient client(address.empty() ? address_ : address);
    const CancelFlag never;
    return client.fetch(job, folder_.path() / ("fetched" + std::to_string(job)), never, [](uint64_t, uint64_t) {})
        .status();
  }
  /// It has the bytes of a bake without a farm, each task was done once, and nobody gave other bytes.
  void expect_whole(uint64_t job, int variant) {
    const absl::Status fetched = fetch(job);
    ASSERT_TRUE(fetched.ok()) << fetched;
    if (!baked_.contains(variant)) {
      const std::filesystem::path loom = folder_.path() / ("baked" + std::to_string(variant));
      const Scene scene = value_or_die(load_gltf(scene_path_));
      const auto tracer = value_or_die(RayTracer::create(scene));
      value_or_die(bake(*tracer, params(variant), loom, {}));
      baked_[variant] = files_of(loom);
    }
    const Files files = files_of(folder_.path() / ("fetched" + std::to_string(job)));
    EXPECT_EQ(names_of(files), names_of(baked_[variant]));
    for (const auto& [name, bytes] : files) {
      EXPECT_TRUE(bytes == baked_[variant][name]) << "job " << job << ", " << name;
    }
    FarmClient client(address_);
    std::map<std::string, int> completed;
    for (const RemoteEvent& e : value_or_die(client.events(job))) {
      EXPECT_NE(e.what, "mismatch");
      if (e.what == "completed") ++completed[e.task];
    }
    for (const auto& [task, times] : completed) EXPECT_EQ(times, 1) << "task " << task;
  }

  TemporaryFolder folder_;
  std::filesystem::path scene_path_;
  std::vector<uint8_t> scene_;
  std::string address_, database_;  // PostgreSQL's; empty: SQLite
  std::string worker_server_;       // what workers are told; empty: the server's
  std::unique_ptr<Process> server_;
  std::map<std::string, std::unique_ptr<Process>> workers_;
  std::map<uint64_t, uint64_t> told_;  // tasks done, by job
  std::map<int, Files> baked_;
  int faults_ = 0, lost_ = 0;
};

}  // namespace lightloom::test
