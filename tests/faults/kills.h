// Workers and coordinators that are killed at work.
#pragma once

#include <signal.h>

#include <functional>
#include <random>

#include "tests/faults/broken_farm.h"

namespace lightloom::test {

class Kills : public BrokenFarm {
 protected:
  void SetUp() override {
    BrokenFarm::SetUp();
    start_server();
    for (const char* name : {"a", "b", "c"}) start_worker(name);
  }
  /// Jobs, one after the other, until enough were hit and enough are done; `hit` may break things while one runs.
  void keep_busy(size_t jobs, const std::function<bool()>& enough, const std::function<void()>& hit) {
    for (int variant = 0; !enough() || told_.size() < jobs; ++variant) {
      const RemoteJob job = submit(variant);
      uint64_t done = 0;
      const RemoteJob ended = watch(job.id, [&](const RemoteJob& now) {
        if (enough() || now.running == 0 || now.done < done + 2) return;
        done = now.done;
        hit();
      });
      EXPECT_EQ(ended.state, "done") << ended.error;
      expect_whole(job.id, variant);
      ASSERT_LT(variant, 20) << "too few of the victims were at work";
    }
  }
  bool kill_worker() {
    const std::set<std::string> victims = busy();
    if (victims.empty()) return false;
    const std::string victim = *std::next(victims.begin(), static_cast<long>(random_() % victims.size()));
    workers_.at(victim)->stop(SIGKILL);
    ++faults_;
    start_worker(victim);
    return true;
  }
  void kill_server() {
    server_->stop(SIGKILL);
    ++faults_;
    start_server();
    note_all();
  }

  void kill_workers(int kills, size_t jobs) {
    keep_busy(
        jobs, [&] { return faults_ >= kills; }, [&] { kill_worker(); });
    EXPECT_GE(faults_, kills);
  }
  void kill_servers(int kills, size_t jobs) {
    keep_busy(
        jobs, [&] { return faults_ >= kills; }, [&] { kill_server(); });
    EXPECT_GE(faults_, kills);
  }
  void kill_both(int rounds, size_t jobs) {
    int done = 0;
    keep_busy(
        jobs, [&] { return done >= rounds; },
        [&] {
          const std::set<std::string> victims = busy();
          if (victims.empty()) return;
          ++done;
          faults_ += 2;
          workers_.at(*victims.begin())->signal(SIGKILL);
          server_->stop(SIGKILL);
          start_server();
          start_worker(*victims.begin());
          note_all();
        });
    EXPECT_EQ(done, rounds);
  }

  std::mt19937 random_{1};
};

}  // namespace lightloom::test
