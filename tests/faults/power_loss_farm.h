// A farm whose server's machine loses power while a job runs, and what it then has on record.
#pragma once

#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <future>
#include <mutex>

#include "bake-server/blobs/blob_layout.h"
#include "bake-server/store/sqlite_store.h"
#include "tests/cluster/farm_fixture.h"
#include "tests/faults/broken_farm.h"

namespace lightloom::test {

class PowerLossFarm : public BrokenFarm {
 protected:
  /// Between two tries nobody looks whether gRPC's next connection is there, but gRPC itself, every 5 s.
  static void SetUpTestSuite() { ::setenv("GRPC_CLIENT_CHANNEL_BACKUP_POLL_INTERVAL_MS", "50", 1); }
  void SetUp() override {
    BrokenFarm::SetUp();
    small_.texels_per_metre = 2;
    small_.rays = 16;
    small_.relight_rays = 64;
    small_.max_rank = 4;
    small_.cell_receivers = 128;
    const Scene scene = value_or_die(load_gltf(scene_path_));
    const auto tracer = value_or_die(RayTracer::create(scene));
    value_or_die(bake(*tracer, small_, folder_.path() / "baked", {}));
    baked_[0] = files_of(folder_.path() / "baked");
    start_server();  // takes a port
    EXPECT_EQ(server_->stop(SIGTERM), 0);
  }
  void TearDown() override {
    std::printf("%d power losses, %ld changes undone, %d acknowledged clusters lost\n", faults_, undone(), lost_);
    EXPECT_EQ(lost_, 0);
  }

  /// Losses at `places` places, spread over a job from the first change of files to the last. Each in a job of its own,
  /// which then goes on to its end.
  void lose_power_at(long places) {
    const long all = changes_of_a_job();
    ASSERT_GT(all, places);
    for (long p = 0; p < places; ++p) run_job(1 + (all - 1) * p / (places - 1));
    std::printf("%ld changes of files in a job\n", all);
    // No two runs make the same changes: the last places may lie behind the end of the job.
    EXPECT_GT(faults_, places * 3 / 4);
    EXPECT_GT(undone(), 0);
  }

 private:
  long changes_of_a_job() {
    run_job(0);
    std::ifstream in(folder_.path() / "counted");
    long most = 0;
    for (long n = 0; in >> n;) most = std::max(most, n);
    return most;
  }
  long undone() const {
    std::ifstream in(folder_.path() / "undone");
    long sum = 0;
    for (long n = 0; in >> n;) sum += n;
    return sum;
  }

  /// One job of a new farm, whose server loses power at its change of files number `at` (0: never) and starts again.
  void run_job(long at) {
    SCOPED_TRACE("power loss at change " + std::to_string(at));
    // Removed at the end of the test only: file systems are slow to give out anew what was removed just now.
    disk_ = folder_.path() / ("disk" + std::to_string(++disks_));
    std::filesystem::create_directory(disk_);
    told_.clear();
    over_ = false;
    const RunningWorker worker(dial(address_), "worker");
    auto client = std::async(std::launch::async, [this] {
      ask_for_a_job();
      const std::lock_guard lock(mutex_);
      over_ = true;
      end_server();
    });
    for (long next = at; serve(next) == -SIGKILL; next = 0) {
      ++faults_;
      check_what_is_left();
    }
    client.get();
  }
  /// What a client does: nothing that it was told may turn out to be wrong.
  void ask_for_a_job() {
    FarmClient client(address_);
    const auto job = client.submit(scene_, small_, nullptr, "level", 0, [](uint64_t) {});
    ASSERT_TRUE(job.ok()) << job.status();
    hear(*job);
    const CancelFlag never;
    const auto ended = client.watch(job->id, never, [this](const RemoteJob& now) { hear(now); });
    ASSERT_TRUE(ended.ok()) << ended.status();
    hear(*ended);
    EXPECT_EQ(ended->state, "done") << ended->error;
    const auto fetched = client.fetch(job->id, disk_ / "fetched", never, [](uint64_t, uint64_t) {});
    ASSERT_TRUE(fetched.ok()) << fetched.status();
    const Files files = files_of(disk_ / "fetched");
    EXPECT_EQ(names_of(files), names_of(baked_.at(0)));
    EXPECT_TRUE(files == baked_.at(0)) << "the asset has other bytes";
    EXPECT_FALSE(any_event(job->id, "mismatch"));
  }
  void hear(const RemoteJob& job) {
    const std::lock_guard lock(mutex_);
    note(job);
  }

  /// If it listens; else who starts it does so once it does. Needs mutex_.
  void end_server() {
    if (!listening_) return;
    LL_CHECK(server_->pid() > 0);  // -1 would be everybody
    server_->signal(SIGTERM);
  }
  /// A server that loses power at its change of files number `at`; 0: never. Until it ends: its exit code, or -signal.
  int serve(long at) {
    {
      const std::lock_guard lock(mutex_);
      Words command = losing_power_at(at);
      command.insert(command.end(), {QUICK_SERVER, state(), address_});
      server_ = std::make_unique<Process>(command);
    }
    const bool began = server_->line_with("listening on ") != "";
    {
      const std::lock_guard lock(mutex_);
      listening_ = began;
      if (over_) end_server();
    }
    siginfo_t how;
    // Who signals it must not meet another process of its number: it is a zombie until the lock is held.
    LL_CHECK(::waitid(P_PID, static_cast<id_t>(server_->pid()), &how, WEXITED | WNOWAIT) == 0);
    const std::lock_guard lock(mutex_);
    listening_ = false;
    const int code = server_->wait();
    // A loss ends it at work; else it ends as it should, and has found nothing to complain about.
    const std::string listening = "listening on " + address_ + "\n";
    if (code == -SIGKILL) {
      EXPECT_GT(at, 0);
      EXPECT_TRUE(server_->output().empty() || server_->output() == listening) << server_->output();
    } else {
      EXPECT_EQ(code, 0);
      EXPECT_EQ(server_->output(), listening);
    }
    return code;
  }
  Words losing_power_at(long change) const {
    return {"/usr/bin/env",
            "LD_PRELOAD=" LIGHTLOOM_FAULT_AT_A_FILE,
            "FILE_FAULT=power",
            "FAULT_AT_FILE_CHANGE=" + std::to_string(change),
            "POWER_LOSS_FOLDER=" + disk_.string(),
            "COUNTED_FILE_CHANGES=" + (folder_.path() / "counted").string(),
            "UNDONE_FILE_CHANGES=" + (folder_.path() / "undone").string()};
  }

  /// As another server finds it: what clients were told is on record, and so is each blob that is named.
  void check_what_is_left() {
    const std::lock_guard lock(mutex_);
    const std::filesystem::path copy = disk_ / "copy";  // who opens a database changes it
    std::filesystem::create_directory(copy);
    std::error_code none;
    for (const char* name : {"store.db", "store.db-wal", "store.db-journal"}) {
      std::filesystem::copy(state() + "/" + name, copy / name, none);
    }
    const auto store = open_sqlite_store(copy, Durability::kProcess);
    ASSERT_TRUE(store.ok()) << store.status();
    for (const auto& told : told_) {
      const auto job = (*store)->job(told.first);
      const uint64_t done = job.ok() ? job->done : 0;
      EXPECT_TRUE(job.ok()) << job.status();
      EXPECT_GE(done, told.second);
      lost_ += static_cast<int>(told.second - std::min(told.second, done));
    }
    const BlobLayout blobs(disk_ / "state/blobs");
    const absl::Status visited = (*store)->referenced([&](const Digest& digest) {
      const auto bytes = read_file(blobs.blob(digest));
      const bool right = bytes.ok() && sha256(*bytes) == digest;
      EXPECT_TRUE(right) << "blob " << digest.hex() << " is on record, but not on the disk: " << bytes.status();
      lost_ += !right;
      return true;
    });
    EXPECT_TRUE(visited.ok()) << visited;
  }
  std::string state() const { return (disk_ / "state").string(); }

  BakeParams small_;
  std::filesystem::path disk_;  // of the job's machine
  int disks_ = 0;
  std::mutex mutex_;  // guards server_ (not while serve() reads its number), told_, lost_ and all below
  bool over_ = false, listening_ = false;
};

}  // namespace lightloom::test
