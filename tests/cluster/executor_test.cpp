// Tasks in a child process: real children, which crash, exit, run out of memory and are killed.
#include "bake-worker/child_executor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <future>
#include <mutex>

#include "tests/cluster/farm_fixture.h"

namespace lightloom {
namespace {

using test::FarmTest;
using test::RunningWorker;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// What a ChildExecutor said of its children.
class Ends {
 public:
  std::function<void(const std::string&)> hear() {
    return [this](const std::string& what) {
      const std::lock_guard lock(mutex_);
      said_.push_back(what);
    };
  }
  std::vector<std::string> said() {
    const std::lock_guard lock(mutex_);
    return said_;
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> said_;
};

class ChildTest : public testing::Test {
 protected:
  ChildOptions options() {
    ChildOptions o;
    o.config.threads = 4;
    o.command = {FAULTY_EXECUTOR};
    o.on_end = ends_.hear();
    return o;
  }
  static absl::StatusOr<TaskOutput> run(ChildExecutor* executor, const std::string& kind,
                                        const std::string& argument = "") {
    return executor->run({kind, {}, {argument.begin(), argument.end()}, {}}, {});
  }
  static std::future<absl::StatusOr<TaskOutput>> begin(ChildExecutor* executor, const std::string& kind,
                                                       const std::string& argument) {
    return std::async(std::launch::async, [=] { return run(executor, kind, argument); });
  }
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  Ends ends_;
  test::TemporaryFolder folder_;
};

TEST_F(ChildTest, OneChildRunsAllTasks) {
  ChildExecutor executor(options());
  EXPECT_EQ(executor.child(), 0) << "none before there is work";
  EXPECT_EQ(run(&executor, "fine")->rays, 7u);
  const pid_t child = executor.child();
  EXPECT_GT(child, 0);
  EXPECT_EQ(run(&executor, "fine")->rays, 7u);
  EXPECT_EQ(executor.child(), child);
  EXPECT_THAT(ends_.said(), IsEmpty());
}

TEST_F(ChildTest, ATaskThatEndsTheChildFailsWithTheReason) {
  ChildExecutor executor(options());
  for (const auto& [kind, how] : {std::pair("crash", "SIGSEGV"), std::pair("exit", "exit code 3")}) {
    const auto ended = run(&executor, kind);
    EXPECT_EQ(ended.status().code(), absl::StatusCode::kInternal);
    EXPECT_EQ(ended.status().message(), "task '" + std::string(kind) + "' ended its executor: " + how);
    EXPECT_EQ(run(&executor, "fine")->rays, 7u) << "a new child is there";
  }
  EXPECT_TRUE(executor.health().ok());
}

TEST_F(ChildTest, SuspectsAreRunAgainAlone) {
  ChildExecutor executor(options());
  const std::string met = path("met");
  auto first = begin(&executor, "meet 3", met), guilty = begin(&executor, "crash 3", met),
       last = begin(&executor, "meet 3", met);
  EXPECT_EQ(first.get()->rays, 7u);
  EXPECT_EQ(last.get()->rays, 7u);
  EXPECT_THAT(std::string(guilty.get().status().message()), HasSubstr("'crash 3' ended its executor: SIGSEGV"));
  EXPECT_THAT(ends_.said(), ElementsAre(HasSubstr("while 3 tasks ran: SIGSEGV; each is run again alone"),
                                        HasSubstr("task 'crash 3' ended its executor: SIGSEGV")));
  EXPECT_EQ(run(&executor, "fine")->rays, 7u);
}

TEST_F(ChildTest, CancelReachesATaskInTheChild) {
  ChildExecutor executor(options());
  CancelFlag cancel;
  BakeControl control;
  control.cancel = &cancel;
  control.progress = [&](const std::string&, uint64_t, uint64_t, uint64_t rays) {
    EXPECT_EQ(rays, 1u);
    cancel.cancel();  // it runs
  };
  EXPECT_EQ(executor.run({"hold", {}, {}, {}}, control).status().code(), absl::StatusCode::kCancelled);
  EXPECT_THAT(ends_.said(), IsEmpty());
}

TEST_F(ChildTest, OutOfMemoryFailsTheTaskNotTheChild) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || defined(__clang__)
  GTEST_SKIP() << "sanitizers map terabytes";
#endif
  ChildOptions o = options();
  o.config.memory_bytes = uint64_t{2} << 30;
  ChildExecutor executor(o);
  EXPECT_TRUE(run(&executor, "fine").ok());
  const pid_t child = executor.child();
  const auto hog = run(&executor, "hog");
  EXPECT_EQ(hog.status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(hog.status().message()), HasSubstr("out of memory in task 'hog'"));
  auto first = begin(&executor, "hog 2", path("met")), second = begin(&executor, "hog 2", path("met"));
  EXPECT_EQ(first.get()->rays, 7u) << "alone there is memory";
  EXPECT_EQ(second.get()->rays, 7u);
  EXPECT_EQ(executor.child(), child);
  EXPECT_THAT(ends_.said(), IsEmpty());
}

TEST_F(ChildTest, AnExecutorThatCannotWorkIsGivenUp) {
  for (const auto& [command, why] : {std::pair("/bin/false", "exit code 1, 3 times in a row"),
                                     std::pair("/nowhere/executor", "cannot start /nowhere/executor: No such file")}) {
    ChildOptions o = options();
    o.command = {command};
    ChildExecutor executor(o);
    EXPECT_EQ(run(&executor, "fine").status().code(), absl::StatusCode::kUnavailable);
    EXPECT_THAT(std::string(executor.health().message()), HasSubstr(why));
    EXPECT_THAT(std::string(executor.health().message()), Not(HasSubstr("\n")));
    EXPECT_EQ(run(&executor, "fine").status(), executor.health());
  }
}

/// The worker's child in a farm.
class ChildFarmTest : public FarmTest {
 protected:
  std::unique_ptr<ChildExecutor> child_executor(std::vector<std::string> command) {
    ChildOptions o;
    o.config = {address(), 2, uint64_t{1} << 30, 0};
    o.command = std::move(command);
    o.on_end = ends_.hear();
    return std::make_unique<ChildExecutor>(o);
  }

  Ends ends_;
};

TEST_F(ChildFarmTest, GivesTheSameBytesAlsoWhenItIsKilled) {
  auto executor = child_executor({LIGHTLOOM_WORKER, "executor"});
  ChildExecutor* const child = executor.get();
  const RunningWorker worker(dial(address()), std::move(executor), "worker", 2);
  int killed = 0;
  const RemoteJob job = watch(submit().id, [&](const RemoteJob& now) {
    const pid_t pid = child->child();
    if (killed < 3 && now.done >= 2 && now.running > 1 && pid > 0 && ::kill(pid, SIGKILL) == 0) ++killed;
  });
  ASSERT_EQ(job.state, "done") << job.error;
  EXPECT_GE(killed, 1);
  EXPECT_EQ(job.done, job.tasks);
  expect_fetched_as_baked(job.id);
}

TEST_F(ChildFarmTest, AJobWhoseTaskEndsTheChildFailsWithTheReasonAndTheRestIsDone) {
  const RunningWorker worker(dial(address()), child_executor({FAULTY_EXECUTOR, "surfaces"}), "worker", 2);
  const RemoteJob job = watch(submit().id);
  EXPECT_NE(job.state, "done");
  EXPECT_THAT(job.error, HasSubstr("task 'surfaces' ended its executor: SIGSEGV"));
  EXPECT_EQ(job.done, job.tasks - 2) << "all but the surfaces, and assembly, which needs them";
  FarmClient client(address());
  const auto events = test::value_or_die(client.events(job.id));
  EXPECT_EQ(
      std::count_if(events.begin(), events.end(), [](const RemoteEvent& e) { return e.what.starts_with("failed"); }),
      3);
}

TEST_F(ChildFarmTest, AWorkerWhoseExecutorCannotWorkLeavesWithTheReason) {
  const RemoteJob job = submit();
  RunningWorker broken(dial(address()), child_executor({"/bin/false"}), "broken", 2);
  EXPECT_THAT(std::string(broken.wait().message()), HasSubstr("3 times in a row"));
  const RunningWorker worker(dial(address()), "worker");
  EXPECT_EQ(watch(job.id).state, "done") << "what it had was handed back, and counts as no failure";
}

}  // namespace
}  // namespace lightloom
