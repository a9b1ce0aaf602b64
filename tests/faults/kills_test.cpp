// Workers and coordinators that are killed at work, workers that are held up for longer than their leases, and one of two
// coordinators that dies.
#include <signal.h>

#include "tests/faults/kills.h"
#include "tests/support/postgres_server.h"

namespace lightloom::test {
namespace {

// More of each in many_kills_test.cpp.
TEST_F(Kills, Workers) { kill_workers(6, 2); }
TEST_F(Kills, Coordinators) { kill_servers(4, 2); }
TEST_F(Kills, BothAtOnce) { kill_both(3, 2); }

TEST_F(Kills, StoppedPastTheLeaseAndResumed) {
  std::string held;
  const RemoteJob job = submit(0);
  const RemoteJob ended = watch(job.id, [&](const RemoteJob&) {
    if (!held.empty()) return;
    const std::set<std::string> victims = busy();
    if (victims.empty()) return;
    held = *victims.begin();
    workers_.at(held)->signal(SIGSTOP);
    ++faults_;
  });
  EXPECT_EQ(ended.state, "done");
  ASSERT_NE(held, "");
  EXPECT_TRUE(any_event(job.id, "expired", held));
  // What it says late is heard, and it works on.
  workers_.at(held)->signal(SIGCONT);
  for (auto& [name, worker] : workers_) {
    if (name != held) worker->stop(SIGKILL);
  }
  const RemoteJob next = submit(1);
  EXPECT_EQ(watch(next.id).state, "done");
  expect_whole(job.id, 0);
  expect_whole(next.id, 1);
}

/// Two coordinators, A and B, on one PostgreSQL database; workers know B alone, clients A.
class TwoCoordinators : public BrokenFarm {
 protected:
  void SetUp() override {
    BrokenFarm::SetUp();
    static int databases = 0;
    database_ = PostgresServer::shared().database("faults_" + std::to_string(++databases));
    start_server();
    start_b("127.0.0.1:0");
    start_worker("a");
  }
  void start_b(const std::string& at) {
    b_ = std::make_unique<Process>(Words{QUICK_SERVER, (folder_.path() / "state").string(), at, database_});
    const std::string line = b_->line_with("listening on ");
    ASSERT_NE(line, "") << b_->output();
    worker_server_ = line.substr(line.rfind(' ') + 1);
  }

  std::unique_ptr<Process> b_;
};

TEST_F(TwoCoordinators, SubmitOnAWorkOnBCancelOnAKillB) {
  const RemoteJob job = submit(0);
  bool cancelled = false;
  EXPECT_EQ(watch(job.id,
                  [&](const RemoteJob& now) {
                    if (cancelled || now.running == 0 || now.done < 2) return;
                    FarmClient client(address_);
                    (void)value_or_die(client.cancel(job.id));
                    b_->stop(SIGKILL);
                    cancelled = true;
                    ++faults_;
                  })
                .state,
            "cancelled");
  ASSERT_TRUE(cancelled);
  // B is back, its worker with it; what was finished before counts.
  start_b(worker_server_);
  const RemoteJob next = submit(0);
  const RemoteJob ended = watch(next.id);
  EXPECT_EQ(ended.state, "done");
  EXPECT_GE(ended.reused, 2u);
  expect_whole(next.id, 0);
}

TEST_F(TwoCoordinators, BDiesAndAWorkerOfAFinishes) {
  const RemoteJob job = submit(0);
  bool died = false;
  EXPECT_EQ(watch(job.id,
                  [&](const RemoteJob& now) {
                    if (died || now.running == 0 || now.done < 2) return;
                    died = true;
                    ++faults_;
                    b_->stop(SIGKILL);
                    worker_server_.clear();
                    start_worker("b");
                  })
                .state,
            "done");
  EXPECT_TRUE(died);
  expect_whole(job.id, 0);
}

}  // namespace
}  // namespace lightloom::test
