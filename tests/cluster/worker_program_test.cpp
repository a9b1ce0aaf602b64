// The program lightloom-worker with its child, and signals to either.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <fstream>

#include "bake-worker/child_process.h"
#include "tests/cluster/farm_fixture.h"

namespace lightloom {
namespace {

using test::FarmTest;
using test::RunningWorker;
using test::value_or_die;

/// Process ids, from /proc.
std::vector<pid_t> children_of(pid_t parent) {
  std::vector<pid_t> out;
  for (const auto& folder : std::filesystem::directory_iterator("/proc")) {
    std::ifstream in(folder.path() / "stat");
    std::string line;
    if (!std::getline(in, line)) continue;
    // PID (NAME) STATE PARENT ...; the name may hold anything.
    pid_t of = 0;
    if (std::sscanf(line.c_str() + line.rfind(')'), ") %*c %d", &of) == 1 && of == parent)
      out.push_back(std::stoi(line));
  }
  return out;
}

class WorkerProgramTest : public FarmTest {
 protected:
  std::unique_ptr<ChildProcess> start_worker() {
    return value_or_die(
        ChildProcess::start({LIGHTLOOM_WORKER, "--server", address(), "--threads", "2", "--name", "program"}));
  }
};

TEST_F(WorkerProgramTest, AKilledSupervisorTakesItsChildAlong) {
  const auto worker = start_worker();
  int executor = -1;  // keeps naming the process when it is gone
  const RemoteJob job = submit();
  watch(job.id, [&](const RemoteJob& now) {
    if (executor >= 0 || now.done < 1) return;
    const auto children = children_of(worker->pid());
    ASSERT_EQ(children.size(), 1u);
    executor = static_cast<int>(::syscall(SYS_pidfd_open, children.front(), 0));
    ASSERT_GE(executor, 0);
    worker->kill();
    FarmClient client(address());
    value_or_die(client.cancel(job.id));
  });
  EXPECT_EQ(worker->wait().how, "SIGKILL");
  pollfd ended{executor, POLLIN, 0};
  EXPECT_EQ(::poll(&ended, 1, -1), 1);
  ::close(executor);
}

TEST_F(WorkerProgramTest, CtrlCReachesBothAndTheWorkerFinishesWhatItHas) {
  const auto worker = start_worker();
  const RemoteJob job = submit();
  std::unique_ptr<RunningWorker> second;
  const RemoteJob end = watch(job.id, [&](const RemoteJob& now) {
    if (second != nullptr || now.done < 2) return;
    ASSERT_THAT(children_of(worker->pid()).size(), 1u);
    ::kill(children_of(worker->pid()).front(), SIGINT);  // a terminal sends it to the whole group
    ::kill(worker->pid(), SIGINT);
    EXPECT_EQ(worker->wait().how, "exit code 0");
    second = std::make_unique<RunningWorker>(dial(address()), "second");
  });
  ASSERT_EQ(end.state, "done") << end.error;
  expect_fetched_as_baked(job.id);
  FarmClient client(address());
  for (const RemoteEvent& event : value_or_die(client.events(job.id))) {
    EXPECT_FALSE(event.what.starts_with("failed")) << event.what;
  }
}

TEST(WorkerProgram, AnExecutorWithoutASupervisorEndsAtOnce) {
  const auto child = value_or_die(ChildProcess::start({LIGHTLOOM_WORKER, "executor"}));
  ASSERT_TRUE(child->frames().write("no message of ours").ok());
  EXPECT_EQ(child->wait().how, "exit code 2");
}

TEST(WorkerProgram, ItsNameIsCheckedBeforeAnyServerIsAsked) {
  const auto child = value_or_die(ChildProcess::start({LIGHTLOOM_WORKER, "--server", "x", "--name", "a b"}));
  EXPECT_EQ(child->wait().how, "exit code 2");
}

TEST(WorkerProgram, SizesAreChecked) {
  for (const char* memory : {"8X", "100M", "575M"}) {
    const auto child =
        value_or_die(ChildProcess::start({LIGHTLOOM_WORKER, "--server", "x", "--threads", "2", "--memory", memory}));
    EXPECT_EQ(child->wait().how, "exit code 2") << memory;
  }
}

}  // namespace
}  // namespace lightloom
