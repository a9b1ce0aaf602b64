// The contract of Store, for every implementation, rule by rule. store_model_test.cpp goes at it at random.
#include "bake-server/store/store.h"

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <utility>

#include "tests/unit/bake-server/store_backends.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class StoreContract : public testing::TestWithParam<StoreBackend> {
 protected:
  void SetUp() override { reopen(); }

  void reopen() {
    store_.reset();
    store_ = value(GetParam().open(folder_.path()));
    ASSERT_NE(store_, nullptr);
  }

  JobId submit(const NewJob& job, int64_t now_ms = 1) { return value(store_->submit(job, now_ms)).id; }

  bool lease(TaskId task, const std::string& worker, const std::string& token, uint32_t max_live = 1) {
    return value(store_->lease({task, worker, token, /*expires_ms=*/100, max_live}, /*now_ms=*/10));
  }

  Completion complete(const std::string& token, int output, const std::vector<NewTask>& spawned = {}) {
    return value(store_->complete(token, {digest(output)}, spawned, /*now_ms=*/20));
  }

  bool fail(const std::string& token, const std::string& reason = "broke", uint32_t max_failures = 3) {
    return value(store_->fail(token, reason, /*now_ms=*/30, max_failures));
  }

  Job job(JobId id) { return value(store_->job(id)); }
  Task task(TaskId id) { return value(store_->task(id)); }

  /// The task of that order; blocked ones appear in no listing.
  TaskId task_of(JobId job, int64_t order) {
    for (TaskId id = 1; id < 1000; ++id) {
      const absl::StatusOr<Task> task = store_->task(id);
      if (task.ok() && task->job == job && task->order == order) return id;
    }
    ADD_FAILURE() << "job " << job << " has no task of order " << order;
    return 0;
  }

  /// "what" of the job's events, with the task's order where there is one.
  std::vector<std::string> history(JobId job) {
    std::vector<std::string> lines;
    for (const Event& e : value(store_->events(job, 0, 1000))) {
      lines.push_back(e.task == 0 ? e.what : absl::StrCat(task(e.task).order, " ", e.what));
    }
    return lines;
  }

  TemporaryFolder folder_;
  std::unique_ptr<Store> store_;
};

// Submitting.

TEST_P(StoreContract, ANewJobIsReadBackWhole) {
  NewJob request = new_job("r", {cell(0, 5), cell(0, 6), cell(1, 0)});
  request.name = "level \"one\"";
  request.priority = -7;
  request.payload = std::string("\0\xFF\n", 3);
  request.inputs = {digest(1), digest(2)};
  const Job submitted = value(store_->submit(request, 123));
  for (const Job& read : {submitted, job(submitted.id), value(store_->jobs(0, 10)).at(0)}) {
    EXPECT_EQ(read.request_id, "r");
    EXPECT_EQ(read.client, "c");
    EXPECT_EQ(read.name, request.name);
    EXPECT_EQ(read.priority, -7);
    EXPECT_EQ(read.payload, request.payload);
    EXPECT_EQ(read.inputs, request.inputs);
    EXPECT_EQ(read.state, JobState::kRunning);
    EXPECT_EQ(read.created_ms, 123);
    EXPECT_EQ(read.finished_ms, 0);
    EXPECT_THAT(counts(read), ElementsAre(3, 2, 0, 0, 0));
    EXPECT_THAT(read.error, IsEmpty());
    EXPECT_THAT(read.outputs, IsEmpty());
  }
}

TEST_P(StoreContract, ATaskIsReadBackWhole) {
  NewTask wanted = cell(3, -1);
  wanted.argument = std::string("\0\x80'\"", 4);
  const Task read = task(task_of(submit(new_job("r", {cell(1, 7), wanted})), -1));
  EXPECT_EQ(read.kind, "cell");
  EXPECT_EQ(read.stage, 3u);
  EXPECT_EQ(read.argument, wanted.argument);
  EXPECT_EQ(read.state, TaskState::kBlocked);
  EXPECT_EQ(read.live, 0u);
  EXPECT_EQ(read.failures, 0u);
  EXPECT_THAT(read.outputs, IsEmpty());
}

TEST_P(StoreContract, TheSameRequestIsTheSameJob) {
  const NewJob request = new_job("r", {cell(0, 0)});
  const JobId first = submit(request);
  value(store_->set_priority(first, 5));
  EXPECT_EQ(submit(request, 99), first);
  EXPECT_EQ(job(first).created_ms, 1);
  EXPECT_EQ(job(first).priority, 5);
  EXPECT_THAT(counts(job(first)), ElementsAre(1, 1, 0, 0, 0));
  reopen();
  EXPECT_EQ(submit(request, 99), first);
  EXPECT_THAT(history(first), ElementsAre("submitted"));
}

TEST_P(StoreContract, AJobMayBeRefusedUnlessItIsThere) {
  const NewJob request = new_job("r", {cell(0, 0)});
  const AdmitJob refuse = [](const NewJob& job) { return absl::ResourceExhaustedError("no " + job.request_id); };
  EXPECT_EQ(store_->submit(request, 1, refuse).status(), absl::ResourceExhaustedError("no r"));
  EXPECT_THAT(value(store_->jobs(0, 10)), IsEmpty());
  const JobId first = submit(request);
  EXPECT_EQ(value(store_->submit(request, 2, refuse)).id, first);
}

TEST_P(StoreContract, TheSameRequestIdForSomethingElseIsRefused) {
  const NewJob request = new_job("r", {cell(0, 0)});
  submit(request);
  std::vector<NewJob> others(8, request);
  others[0].name = "x";
  others[1].priority = 1;
  others[2].payload = "x";
  others[3].inputs = {digest(0)};
  others[4].tasks.push_back(cell(0, 0));
  others[5].tasks[0].order = 1;
  others[6].tasks[0].stage = 1;
  others[7].tasks[0].argument = "x";
  for (size_t i = 0; i < others.size(); ++i) {
    const absl::Status status = store_->submit(others[i], 2).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kAlreadyExists) << i << ": " << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("'r'"));
  }
  EXPECT_EQ(value(store_->jobs(0, 10)).size(), 1u);
}

TEST_P(StoreContract, ClientsDoNotShareRequestIds) {
  NewJob request = new_job("r", {cell(0, 0)});
  const JobId first = submit(request);
  request.client = "other";
  EXPECT_NE(submit(request), first);
}

TEST_P(StoreContract, RequestsBeyondTheLimitsAreRefused) {
  NewJob fits = new_job("r", {cell(0, 0)});
  fits.payload.assign(kMaxPayload, 'p');
  fits.tasks[0].argument.assign(kMaxArgument, 'a');
  std::vector<NewJob> bad(4, fits);
  bad[0].payload += 'p';
  bad[1].tasks[0].argument += 'a';
  bad[2].tasks.clear();
  bad[3].request_id.clear();
  for (size_t i = 0; i < bad.size(); ++i) {
    const absl::Status status = store_->submit(bad[i], 1).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << i << ": " << status;
    EXPECT_THAT(std::string(status.message()), Not(HasSubstr("\n")));
  }
  EXPECT_THAT(value(store_->jobs(0, 10)), IsEmpty());
  EXPECT_EQ(job(submit(fits)).payload, fits.payload);
}

// Leasing.

TEST_P(StoreContract, OnlyReadyTasksAreLeased) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(1, 1)}));
  const TaskId low = task_of(id, 0);
  const TaskId high = task_of(id, 1);
  EXPECT_FALSE(lease(high, "w", "blocked"));
  EXPECT_FALSE(lease(12345, "w", "nowhere"));
  EXPECT_TRUE(lease(low, "w", "a"));
  EXPECT_EQ(task(low).live, 1u);
  EXPECT_THAT(counts(job(id)), ElementsAre(2, 0, 1, 0, 0));
  EXPECT_EQ(complete("a", 1), Completion::kAccepted);
  EXPECT_FALSE(lease(low, "w", "done"));
  EXPECT_EQ(task(high).state, TaskState::kReady);
  EXPECT_TRUE(lease(high, "w", "blocked")) << "a lease that was lost used up no token";
}

TEST_P(StoreContract, AttemptsAtATaskAreLimitedAndOnePerWorker) {
  const TaskId id = task_of(submit(new_job("r", {cell(0, 0)})), 0);
  EXPECT_FALSE(lease(id, "v", "zero", 0));
  EXPECT_TRUE(lease(id, "v", "a", 1));
  EXPECT_FALSE(lease(id, "w", "b", 1));
  EXPECT_FALSE(lease(id, "v", "b", 2)) << "the worker has one";
  EXPECT_TRUE(lease(id, "w", "b", 2));
  EXPECT_FALSE(lease(id, "x", "c", 2));
  EXPECT_EQ(task(id).live, 2u);
  value(store_->release("v", {"a"}, /*now_ms=*/15));
  EXPECT_TRUE(lease(id, "v", "c", 2)) << "it has none any more";
}

TEST_P(StoreContract, ATokenNamesOneAttemptForEver) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1)}));
  EXPECT_TRUE(lease(task_of(id, 0), "w", "a"));
  complete("a", 1);
  EXPECT_EQ(store_->lease({task_of(id, 1), "w", "a", 100, 1}, 10).status().code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(store_->lease({task_of(id, 1), "w", "", 100, 1}, 10).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(store_->lease({task_of(id, 1), "", "b", 100, 1}, 10).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(task(task_of(id, 1)).live, 0u);
}

TEST_P(StoreContract, ThreadsNeverGetTheSameTask) {
  constexpr int kTasks = 40;
  std::vector<NewTask> tasks;
  tasks.reserve(kTasks);
  for (int i = 0; i < kTasks; ++i) tasks.push_back(cell(0, i));
  const JobId id = submit(new_job("r", tasks));
  std::vector<TaskId> ids;
  const std::vector<JobView> views = value(store_->view(kTasks));
  for (const JobView::Ready& ready : views.at(0).ready) ids.push_back(ready.task);
  std::atomic<int> leased = 0;
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int worker = 0; worker < 4; ++worker) {
    threads.emplace_back([&, worker] {
      for (const TaskId task : ids) {
        const std::string token = absl::StrCat(worker, "/", task);
        if (!value(store_->lease({task, absl::StrCat("w", worker), token, 100, 1}, 10))) continue;
        ++leased;
        EXPECT_EQ(value(store_->complete(token, {digest(1)}, {}, 20)), Completion::kAccepted);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(leased, kTasks);
  EXPECT_EQ(job(id).state, JobState::kDone);
}

TEST_P(StoreContract, ExtendKeepsWhatIsLiveAndTheWorkers) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1), cell(0, 2)}));
  lease(task_of(id, 0), "w", "kept");
  lease(task_of(id, 1), "w", "done");
  lease(task_of(id, 2), "v", "another's");
  complete("done", 1);
  EXPECT_THAT(value(store_->extend("w", {"kept", "done", "another's", "unknown"}, 500)), ElementsAre("kept"));
  EXPECT_THAT(value(store_->expire(500)), ElementsAre("another's")) << "both were leased until 100";
  EXPECT_THAT(value(store_->expire(501)), ElementsAre("kept"));
  EXPECT_THAT(value(store_->extend("w", {"kept"}, 900)), IsEmpty());
}

TEST_P(StoreContract, ExpiredLeasesAreNoFailures) {
  const JobId id = submit(new_job("r", {cell(0, 0)}));
  const TaskId of = task_of(id, 0);
  lease(of, "w", "a");
  EXPECT_THAT(value(store_->expire(100)), IsEmpty()) << "it lasts up to 100";
  EXPECT_THAT(value(store_->expire(101)), ElementsAre("a"));
  EXPECT_THAT(value(store_->expire(101)), IsEmpty());
  EXPECT_EQ(task(of).failures, 0u);
  EXPECT_EQ(task(of).live, 0u);
  EXPECT_THAT(counts(job(id)), ElementsAre(1, 1, 0, 0, 0));
  EXPECT_TRUE(lease(of, "w", "b"));
  EXPECT_THAT(history(id), ElementsAre("submitted", "0 leased", "0 expired", "0 leased"));
}

TEST_P(StoreContract, ReleasedTasksAreReadyAgain) {
  const JobId id = submit(new_job("r", {cell(0, 0)}));
  const TaskId of = task_of(id, 0);
  lease(of, "w", "a");
  value(store_->release("v", {"a", "unknown"}, /*now_ms=*/15));
  EXPECT_EQ(task(of).live, 1u) << "only its own worker hands it back";
  value(store_->release("w", {"a"}, /*now_ms=*/15));
  value(store_->release("w", {"a"}, /*now_ms=*/15));
  EXPECT_EQ(task(of).live, 0u);
  EXPECT_EQ(task(of).failures, 0u);
  EXPECT_THAT(counts(job(id)), ElementsAre(1, 1, 0, 0, 0));
  EXPECT_THAT(history(id), ElementsAre("submitted", "0 leased", "0 released"));
}

TEST_P(StoreContract, ARestartRenewsEveryLease) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1)}));
  lease(task_of(id, 0), "w", "a");
  lease(task_of(id, 1), "w", "b");
  complete("b", 1);
  reopen();
  value(store_->renew_all(7));  // the new clock may be far behind
  EXPECT_THAT(value(store_->expire(7)), IsEmpty());
  EXPECT_THAT(value(store_->expire(8)), ElementsAre("a"));
}

// Completing.

TEST_P(StoreContract, StagesOpenInTheirOrderAndTheJobEnds) {
  const JobId id = submit(new_job("r", {cell(7, 20), cell(2, 10), cell(2, 11), cell(4, 15)}));
  lease(task_of(id, 10), "w", "10");
  lease(task_of(id, 11), "w", "11");
  EXPECT_EQ(complete("10", 1), Completion::kAccepted);
  EXPECT_EQ(task(task_of(id, 15)).state, TaskState::kBlocked);
  EXPECT_EQ(complete("11", 2), Completion::kAccepted);
  EXPECT_EQ(task(task_of(id, 15)).state, TaskState::kReady);
  EXPECT_EQ(task(task_of(id, 20)).state, TaskState::kBlocked);
  EXPECT_THAT(counts(job(id)), ElementsAre(4, 1, 0, 2, 0));
  lease(task_of(id, 15), "w", "15");
  complete("15", 3);
  lease(task_of(id, 20), "w", "20");
  EXPECT_EQ(job(id).state, JobState::kRunning);
  EXPECT_EQ(complete("20", 4), Completion::kAccepted);
  const Job ended = job(id);
  EXPECT_EQ(ended.state, JobState::kDone);
  EXPECT_EQ(ended.finished_ms, 20);
  EXPECT_THAT(ended.outputs, ElementsAre(digest(4)));
  EXPECT_THAT(counts(ended), ElementsAre(4, 0, 0, 4, 0));
  EXPECT_THAT(value(store_->view(10)), IsEmpty());
}

TEST_P(StoreContract, SpawnedTasksJoinTheJob) {
  const JobId id = submit(new_job("r", {cell(0, 0)}));
  lease(task_of(id, 0), "w", "plan");
  EXPECT_EQ(complete("plan", 1, {cell(1, 30), cell(2, 40), cell(1, 20)}), Completion::kAccepted);
  EXPECT_THAT(counts(job(id)), ElementsAre(4, 2, 0, 1, 0));
  EXPECT_EQ(task(task_of(id, 30)).state, TaskState::kReady);
  EXPECT_EQ(task(task_of(id, 40)).state, TaskState::kBlocked);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(complete("plan", 1, {cell(1, 30), cell(2, 40), cell(1, 20)}), Completion::kAlreadyDone);
  }
  EXPECT_THAT(counts(job(id)), ElementsAre(4, 2, 0, 1, 0));
}

TEST_P(StoreContract, SpawnedTasksLieAboveTheirOwnStage) {
  const JobId id = submit(new_job("r", {cell(3, 0)}));
  lease(task_of(id, 0), "w", "a");
  std::vector<NewTask> too_long = {cell(4, 1)};
  too_long[0].argument.assign(kMaxArgument + 1, 'a');
  for (const std::vector<NewTask>& bad : {std::vector{cell(4, 1), cell(3, 2)}, std::vector{cell(0, 1)}, too_long}) {
    const absl::Status status = store_->complete("a", {digest(1)}, bad, 20).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  }
  EXPECT_THAT(counts(job(id)), ElementsAre(1, 0, 1, 0, 0));
  EXPECT_EQ(complete("a", 1), Completion::kAccepted) << "the attempt is still live";
}

TEST_P(StoreContract, TheFirstResultEndsTheOtherAttempts) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1)}));
  const TaskId of = task_of(id, 0);
  lease(of, "v", "a", 2);
  lease(of, "w", "b", 2);
  EXPECT_EQ(complete("b", 1), Completion::kAccepted);
  EXPECT_THAT(value(store_->extend("v", {"a"}, 500)), IsEmpty());
  EXPECT_FALSE(fail("a"));
  EXPECT_EQ(complete("a", 1), Completion::kAlreadyDone);
  EXPECT_EQ(task(of).live, 0u);
  EXPECT_THAT(counts(job(id)), ElementsAre(2, 1, 0, 1, 0));
}

TEST_P(StoreContract, AnotherResultRaisesTheAlarmOncePerAttempt) {
  const JobId id = submit(new_job("r", {cell(0, 0)}));
  const TaskId of = task_of(id, 0);
  lease(of, "v", "a", 2);
  lease(of, "w", "b", 2);
  complete("b", 1);
  EXPECT_EQ(complete("a", 2), Completion::kMismatch) << "although the job is over";
  EXPECT_EQ(complete("a", 2), Completion::kMismatch);
  EXPECT_EQ(complete("b", 3), Completion::kMismatch);
  EXPECT_THAT(task(of).outputs, ElementsAre(digest(1)));
  EXPECT_EQ(complete("b", 1), Completion::kAlreadyDone);
  EXPECT_THAT(history(id), ElementsAre("submitted", "0 leased", "0 leased", "0 completed", "ended: done", "0 mismatch",
                                       "0 mismatch"));
  EXPECT_EQ(value(store_->events(id, 0, 100)).at(5).worker, "v");
}

TEST_P(StoreContract, LateResultsAreAccepted) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1), cell(0, 2), cell(0, 3)}));
  lease(task_of(id, 0), "w", "expired");
  value(store_->expire(101));
  lease(task_of(id, 0), "v", "newer");
  lease(task_of(id, 1), "w", "released");
  value(store_->release("w", {"released"}, /*now_ms=*/15));
  lease(task_of(id, 2), "w", "failed");
  fail("failed");
  EXPECT_EQ(complete("expired", 1), Completion::kAccepted);
  EXPECT_THAT(value(store_->extend("v", {"newer"}, 500)), IsEmpty());
  EXPECT_EQ(complete("released", 1), Completion::kAccepted);
  EXPECT_EQ(complete("failed", 1), Completion::kAccepted);
  EXPECT_THAT(counts(job(id)), ElementsAre(4, 1, 0, 3, 0));
  EXPECT_THAT(task(task_of(id, 2)).error, IsEmpty());
}

TEST_P(StoreContract, UnknownTokensCompleteNothing) {
  submit(new_job("r", {cell(0, 0)}));
  EXPECT_EQ(complete("nobody's", 1), Completion::kUnknown);
  EXPECT_FALSE(fail("nobody's"));
}

TEST_P(StoreContract, OutputsComeInOrder) {
  const JobId id = submit(new_job("r", {cell(0, 9), cell(0, -3), cell(0, 4), cell(0, 5)}));
  for (const int order : {4, 9, -3}) {
    lease(task_of(id, order), "w", absl::StrCat("t", order));
    complete(absl::StrCat("t", order), order);
  }
  const std::vector<TaskOutputs> outputs = value(store_->outputs(id, 0));
  ASSERT_EQ(outputs.size(), 3u) << "one is not done";
  for (const auto& [index, order] : {std::pair(0u, -3), {1u, 4}, {2u, 9}}) {
    EXPECT_EQ(outputs[index].order, order);
    EXPECT_EQ(outputs[index].task, task_of(id, order));
    EXPECT_EQ(outputs[index].kind, "cell");
    EXPECT_EQ(outputs[index].argument, cell(0, order).argument);
    EXPECT_THAT(outputs[index].outputs, ElementsAre(digest(order)));
  }
  EXPECT_THAT(value(store_->outputs(id, 1)), IsEmpty());
  lease(task_of(id, 5), "w", "last");
  value(store_->complete("last", {digest(50), digest(51)}, {}, 20));
  EXPECT_THAT(job(id).outputs, ElementsAre(digest(-3), digest(4), digest(50), digest(51), digest(9)));
}

// Failing.

TEST_P(StoreContract, ATaskFailsForGoodWithItsLastReason) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1)}));
  const TaskId of = task_of(id, 0);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(task(of).state, TaskState::kReady);
    EXPECT_EQ(task(of).failures, static_cast<uint32_t>(i));
    ASSERT_TRUE(lease(of, "w", absl::StrCat("t", i)));
    EXPECT_TRUE(fail(absl::StrCat("t", i), absl::StrCat("reason\n", i)));
    EXPECT_FALSE(fail(absl::StrCat("t", i), "again"));
  }
  EXPECT_EQ(task(of).state, TaskState::kFailed);
  EXPECT_EQ(task(of).error, "reason\\n2");
  EXPECT_FALSE(lease(of, "w", "no more"));
  EXPECT_THAT(counts(job(id)), ElementsAre(2, 1, 0, 0, 1));
  EXPECT_THAT(history(id), ElementsAre("submitted", "0 leased", "0 failed: reason\\n0", "0 leased",
                                       "0 failed: reason\\n1", "0 leased", "0 failed: reason\\n2"));
}

TEST_P(StoreContract, FailingForGoodEndsTheOtherAttempts) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1)}));
  const TaskId of = task_of(id, 0);
  lease(of, "v", "a", 2);
  lease(of, "w", "b", 2);
  EXPECT_TRUE(fail("a", "broke", 1));
  EXPECT_THAT(value(store_->extend("w", {"b"}, 500)), IsEmpty());
  EXPECT_EQ(task(of).live, 0u);
  EXPECT_THAT(counts(job(id)), ElementsAre(2, 1, 0, 0, 1));
}

TEST_P(StoreContract, AFailedAttemptLeavesTheOthersLive) {
  const JobId id = submit(new_job("r", {cell(0, 0)}));
  const TaskId of = task_of(id, 0);
  lease(of, "v", "a", 2);
  lease(of, "w", "b", 2);
  EXPECT_TRUE(fail("a"));
  EXPECT_EQ(task(of).live, 1u);
  EXPECT_THAT(counts(job(id)), ElementsAre(1, 0, 1, 0, 0));
  EXPECT_EQ(complete("b", 1), Completion::kAccepted);
}

TEST_P(StoreContract, AHoleInTheLastStageMakesTheJobPartial) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1)}));
  lease(task_of(id, 1), "w", "b");
  lease(task_of(id, 0), "w", "a");
  fail("a", "no memory", 1);
  EXPECT_EQ(job(id).state, JobState::kRunning) << "the other goes on";
  EXPECT_EQ(complete("b", 7), Completion::kAccepted);
  const Job ended = job(id);
  EXPECT_EQ(ended.state, JobState::kPartial);
  EXPECT_EQ(ended.error, absl::StrCat("task ", task_of(id, 0), " (cell): no memory"));
  EXPECT_THAT(ended.outputs, ElementsAre(digest(7)));
  EXPECT_THAT(counts(ended), ElementsAre(2, 0, 0, 1, 1));
  EXPECT_EQ(complete("a", 1), Completion::kJobEnded);
}

TEST_P(StoreContract, AJobOfWhichNothingIsDoneHasFailed) {
  const JobId id = submit(new_job("r", {cell(0, 0)}));
  lease(task_of(id, 0), "w", "a");
  fail("a", "no level", 1);
  EXPECT_EQ(job(id).state, JobState::kFailed);
}

TEST_P(StoreContract, AHoleInALowerStageMakesTheJobFail) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1), cell(1, 2)}));
  lease(task_of(id, 0), "w", "a");
  lease(task_of(id, 1), "w", "b");
  complete("a", 1);
  fail("b", "no memory", 1);
  const Job ended = job(id);
  EXPECT_EQ(ended.state, JobState::kFailed);
  EXPECT_EQ(ended.finished_ms, 30);
  EXPECT_THAT(ended.error, HasSubstr("no memory"));
  EXPECT_EQ(task(task_of(id, 2)).state, TaskState::kCancelled);
  EXPECT_EQ(history(id).back(), "ended: failed");
  EXPECT_EQ(value(store_->outputs(id, 0)).size(), 1u) << "what was done stays";
}

TEST_P(StoreContract, ALateResultHealsATaskThatFailed) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1), cell(1, 2)}));
  lease(task_of(id, 0), "w", "a");
  fail("a", "broke", 1);
  EXPECT_EQ(complete("a", 1), Completion::kAccepted);
  EXPECT_THAT(counts(job(id)), ElementsAre(3, 1, 0, 1, 0));
  lease(task_of(id, 1), "w", "b");
  complete("b", 1);
  EXPECT_EQ(task(task_of(id, 2)).state, TaskState::kReady);
}

// Cancelling, priorities, listings.

TEST_P(StoreContract, CancelEndsTheJobAndItsAttempts) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1), cell(0, 2), cell(1, 3)}));
  lease(task_of(id, 0), "w", "a");
  lease(task_of(id, 1), "w", "b");
  complete("a", 1);
  value(store_->cancel(id, 40));
  value(store_->cancel(id, 41));
  const Job ended = job(id);
  EXPECT_EQ(ended.state, JobState::kCancelled);
  EXPECT_EQ(ended.finished_ms, 40);
  EXPECT_THAT(counts(ended), ElementsAre(4, 0, 0, 1, 0));
  EXPECT_THAT(value(store_->extend("w", {"b"}, 500)), IsEmpty());
  EXPECT_THAT(value(store_->expire(1'000)), IsEmpty());
  EXPECT_FALSE(lease(task_of(id, 2), "w", "c"));
  EXPECT_FALSE(fail("b"));
  EXPECT_EQ(complete("b", 1), Completion::kJobEnded);
  EXPECT_EQ(complete("a", 1), Completion::kAlreadyDone);
  EXPECT_EQ(task(task_of(id, 0)).state, TaskState::kDone);
  for (const int order : {1, 2, 3}) EXPECT_EQ(task(task_of(id, order)).state, TaskState::kCancelled) << order;
  EXPECT_THAT(history(id),
              ElementsAre("submitted", "0 leased", "1 leased", "0 completed", "cancelled", "ended: cancelled"));
}

TEST_P(StoreContract, CancelLeavesOtherJobsAndEndedOnesAlone) {
  const JobId first = submit(new_job("r", {cell(0, 0)}));
  const JobId second = submit(new_job("s", {cell(0, 1)}));
  lease(task_of(second, 1), "w", "b");
  value(store_->cancel(first, 40));
  EXPECT_EQ(complete("b", 1), Completion::kAccepted);
  value(store_->cancel(second, 50));
  EXPECT_EQ(job(second).state, JobState::kDone);
}

TEST_P(StoreContract, PrioritiesChange) {
  const JobId id = submit(new_job("r", {cell(0, 0)}));
  value(store_->set_priority(id, -3));
  EXPECT_EQ(job(id).priority, -3);
  EXPECT_EQ(value(store_->view(1)).at(0).priority, -3);
}

TEST_P(StoreContract, WhatIsNotThereIsNotFound) {
  for (const absl::Status& status :
       {store_->cancel(9, 1), store_->set_priority(9, 1), store_->job(9).status(), store_->task(9).status(),
        store_->outputs(9, 0).status(), store_->events(9, 0, 1).status()}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kNotFound) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("9"));
  }
}

TEST_P(StoreContract, JobsAndEventsCanBePaged) {
  std::vector<JobId> ids;
  for (const char* request : {"a", "b", "c", "d", "e"}) ids.push_back(submit(new_job(request, {cell(0, 0)})));
  std::vector<JobId> paged;
  for (std::vector<Job> page = value(store_->jobs(0, 2)); !page.empty();
       page = value(store_->jobs(page.back().id, 2))) {
    EXPECT_LE(page.size(), 2u);
    for (const Job& job : page) paged.push_back(job.id);
  }
  EXPECT_EQ(paged, ids);

  lease(task_of(ids[2], 0), "w", "t");
  complete("t", 1);
  std::vector<std::string> whats;
  for (std::vector<Event> page = value(store_->events(ids[2], 0, 3)); !page.empty();
       page = value(store_->events(ids[2], page.back().id, 3))) {
    EXPECT_LE(page.size(), 3u);
    for (const Event& event : page) whats.push_back(absl::StrCat(event.what, "@", event.at_ms, " ", event.worker));
  }
  EXPECT_THAT(whats, ElementsAre("submitted@1 ", "leased@10 w", "completed@20 w", "ended: done@20 "));
}

TEST_P(StoreContract, EveryChangeOfAJobGrowsItsRevision) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1)}));
  const JobId other = submit(new_job("s", {cell(0, 2)}));
  const uint64_t others = job(other).revision;
  uint64_t last = job(id).revision;
  const auto grew = [&] { return job(id).revision > std::exchange(last, job(id).revision); };
  value(store_->set_priority(id, 1));
  EXPECT_TRUE(grew()) << "priority";
  value(store_->set_priority(id, 1));
  EXPECT_FALSE(grew()) << "no other priority";
  lease(task_of(id, 0), "w", "a");
  EXPECT_TRUE(grew()) << "lease";
  EXPECT_FALSE(lease(task_of(id, 0), "w", "b"));
  EXPECT_FALSE(grew()) << "no lease";
  value(store_->expire(101));
  EXPECT_TRUE(grew()) << "expiry";
  lease(task_of(id, 0), "w", "b");
  grew();
  value(store_->release("w", {"b"}, /*now_ms=*/15));
  EXPECT_TRUE(grew()) << "release";
  lease(task_of(id, 0), "w", "c");
  grew();
  fail("c");
  EXPECT_TRUE(grew()) << "failure";
  complete("c", 1);
  EXPECT_TRUE(grew()) << "completion";
  complete("c", 1);
  EXPECT_FALSE(grew()) << "no completion";
  complete("c", 2);
  EXPECT_TRUE(grew()) << "alarm";
  value(store_->cancel(id, 50));
  EXPECT_TRUE(grew()) << "cancel";
  value(store_->cancel(id, 50));
  EXPECT_FALSE(grew()) << "cancelled before";
  EXPECT_EQ(job(other).revision, others);
}

TEST_P(StoreContract, TheViewShowsWhatMayBeDecided) {
  const JobId first = submit(new_job("r", {cell(0, 5), cell(0, 1), cell(0, 3), cell(0, 4), cell(1, 0)}));
  NewJob request = new_job("s", {cell(2, 8)});
  request.client = "d";
  request.priority = 4;
  const JobId second = submit(request);
  value(store_->cancel(submit(new_job("t", {cell(0, 0)})), 5));
  const auto of = [&](int64_t order) { return task_of(order == 8 ? second : first, order); };
  value(store_->lease({of(3), "v", "a", 100, 2}, 12));
  value(store_->lease({of(3), "w", "b", 100, 2}, 11));

  const std::vector<JobView> views = value(store_->view(2));
  ASSERT_EQ(views.size(), 2u);
  EXPECT_EQ(views[0].id, first);
  EXPECT_EQ(views[0].client, "c");
  EXPECT_EQ(views[0].priority, 0);
  EXPECT_EQ(views[0].live, 2u);
  EXPECT_THAT(views[0].ready, ElementsAre(JobView::Ready{of(1), 1}, JobView::Ready{of(4), 4}));
  EXPECT_THAT(views[0].running, ElementsAre(JobView::Running{of(3), 3, 2, 11, {"v", "w"}}));
  EXPECT_EQ(views[1].id, second);
  EXPECT_EQ(views[1].client, "d");
  EXPECT_EQ(views[1].priority, 4);
  EXPECT_EQ(views[1].live, 0u);
  EXPECT_THAT(views[1].ready, ElementsAre(JobView::Ready{of(8), 8}));
  EXPECT_THAT(views[1].running, IsEmpty());
}

// Results that are known.

TEST_P(StoreContract, WhatAnEarlierJobDidIsNotDoneAgain) {
  const JobId first = submit(new_job("r", {cell(0, 0)}));
  lease(task_of(first, 0), "w", "plan");
  complete("plan", 100, {cell(1, 1), cell(1, 2), cell(2, 3)});
  lease(task_of(first, 1), "w", "one");
  complete("one", 101);
  value(store_->cancel(first, 40));

  NewJob again = new_job("s", {cell(0, 0)});
  again.client = "d";
  again.name = "the same by another name";
  again.priority = 3;
  const JobId second = submit(again, /*now_ms=*/50);
  EXPECT_THAT(counts(job(second)), ElementsAre(4, 1, 0, 2, 0));
  EXPECT_EQ(job(second).reused, 2u);
  EXPECT_EQ(task(task_of(second, 1)).outputs, std::vector{digest(101)});
  EXPECT_THAT(history(second), ElementsAre("submitted", "0 reused", "1 reused"));
  lease(task_of(second, 2), "w", "two");
  complete("two", 102);
  lease(task_of(second, 3), "w", "three");
  complete("three", 103);
  EXPECT_EQ(job(second).state, JobState::kDone);

  const JobId third = submit(new_job("t", {cell(0, 0)}));
  EXPECT_EQ(job(third).state, JobState::kDone) << "without any worker";
  EXPECT_EQ(job(third).outputs, std::vector{digest(103)});
  EXPECT_EQ(job(third).reused, 4u);
}

TEST_P(StoreContract, OtherWorkIsNotTakenForKnown) {
  const JobId first = submit(new_job("r", {cell(0, 0)}));
  lease(task_of(first, 0), "w", "a");
  complete("a", 1);
  NewJob payload = new_job("payload", {cell(0, 0)});
  payload.payload = "other";
  NewJob inputs = new_job("inputs", {cell(0, 0)});
  inputs.inputs = {digest(7)};
  for (const NewJob& other : {payload, inputs, new_job("argument", {cell(0, 1)}), new_job("stage", {cell(1, 0)}),
                              new_job("more", {cell(0, 0), cell(0, 1)})}) {
    EXPECT_EQ(job(submit(other)).done, 0u) << other.request_id;
  }
}

TEST_P(StoreContract, AFailedTaskIsTriedAgainByTheNextJob) {
  const JobId first = submit(new_job("r", {cell(0, 0)}));
  lease(task_of(first, 0), "w", "a");
  fail("a", "broke", 1);
  EXPECT_EQ(job(first).state, JobState::kFailed);
  EXPECT_THAT(counts(job(submit(new_job("s", {cell(0, 0)})))), ElementsAre(1, 1, 0, 0, 0));
}

TEST_P(StoreContract, AResultThatRaisedTheAlarmIsNotTakenForKnown) {
  const JobId first = submit(new_job("r", {cell(0, 0)}));
  lease(task_of(first, 0), "v", "a", 2);
  lease(task_of(first, 0), "w", "b", 2);
  complete("a", 1);
  EXPECT_EQ(complete("b", 2), Completion::kMismatch);
  EXPECT_EQ(job(submit(new_job("s", {cell(0, 0)}))).done, 0u);
}

TEST_P(StoreContract, TheViewSaysWhoFailedATask) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1)}));
  for (const char* worker : {"w", "v", "w"}) {
    lease(task_of(id, 1), worker, absl::StrCat(worker, job(id).revision));
    fail(absl::StrCat(worker, job(id).revision - 1), "broke", 9);
  }
  EXPECT_THAT(value(store_->view(9)).at(0).ready,
              ElementsAre(JobView::Ready{task_of(id, 0), 0}, JobView::Ready{task_of(id, 1), 1, {"v", "w"}}));
}

TEST_P(StoreContract, AGroupIsOneStep) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1)}));
  value(store_->group([&] {
    EXPECT_TRUE(lease(task_of(id, 0), "w", "a"));
    EXPECT_EQ(complete("a", 1), Completion::kAccepted);
    EXPECT_FALSE(store_->cancel(77, 1).ok()) << "which changes nothing, nor what came before";
    return absl::OkStatus();
  }));
  EXPECT_THAT(counts(job(id)), ElementsAre(2, 1, 0, 1, 0));
  EXPECT_EQ(store_->group([&] {
    EXPECT_TRUE(lease(task_of(id, 1), "w", "b"));
    EXPECT_EQ(complete("b", 1), Completion::kAccepted);
    EXPECT_EQ(job(id).state, JobState::kDone);
    return absl::AbortedError("no");
  }),
            absl::AbortedError("no"));
  EXPECT_THAT(counts(job(id)), ElementsAre(2, 1, 0, 1, 0));
  EXPECT_TRUE(lease(task_of(id, 1), "w", "b")) << "the token was never used";
}

TEST_P(StoreContract, EverythingOutlivesTheStore) {
  const JobId id = submit(new_job("r", {cell(0, 0), cell(0, 1), cell(0, 2)}));
  lease(task_of(id, 0), "w", "a");
  lease(task_of(id, 1), "w", "b");
  lease(task_of(id, 2), "w", "c");
  complete("a", 1);
  fail("c");
  const std::vector<std::string> before = history(id);
  const Job old = job(id);
  reopen();
  EXPECT_EQ(history(id), before);
  EXPECT_EQ(job(id).revision, old.revision);
  EXPECT_EQ(counts(job(id)), counts(old));
  EXPECT_THAT(value(store_->extend("w", {"a", "b", "c"}, 500)), ElementsAre("b"));
  EXPECT_EQ(complete("a", 1), Completion::kAlreadyDone);
  EXPECT_EQ(task(task_of(id, 2)).failures, 1u);
}

INSTANTIATE_TEST_SUITE_P(All, StoreContract, testing::ValuesIn(store_backends()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace lightloom::test
