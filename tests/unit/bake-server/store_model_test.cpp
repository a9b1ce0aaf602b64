// Thousands of random transitions, on a Store and on a model that is too simple to be wrong: it keeps everything in
// vectors and counts anew whenever it is asked.
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "bake-server/store/store.h"
#include "tests/unit/bake-server/store_backends.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::test {
namespace {

constexpr int kTransitions = 3000;
constexpr uint32_t kMaxFailures = 2;

struct ModelTask {
  size_t job = 0;
  NewTask task;
  TaskId id = 0;  // 0: not seen yet
  enum { kWaits, kDone, kFailed } state = kWaits;
  uint32_t failures = 0;
  int64_t output = 0;
};

struct ModelAttempt {
  size_t task = 0;
  std::string worker;
  int64_t leased_ms = 0;
  int64_t expires_ms = 0;
  bool live = true;
  bool mismatched = false;
  bool failed = false;
};

struct ModelJob {
  JobId id = 0;
  NewJob request;
  int32_t priority = 0;
  JobState state = JobState::kRunning;
  std::vector<size_t> tasks;
  std::vector<std::string> history;
};

class StoreModel : public testing::TestWithParam<StoreBackend> {
 public:
  // The model.

  uint64_t live(size_t task) const {
    return static_cast<uint64_t>(std::count_if(attempts_.begin(), attempts_.end(), [&](const auto& named) {
      return named.second.live && named.second.task == task;
    }));
  }

  uint32_t open_stage(const ModelJob& job) const {
    uint32_t stage = UINT32_MAX;
    for (const size_t t : job.tasks) {
      if (tasks_[t].state != ModelTask::kDone) stage = std::min(stage, tasks_[t].task.stage);
    }
    return stage;
  }

  TaskState state(size_t t) const {
    const ModelJob& job = jobs_[tasks_[t].job];
    if (tasks_[t].state == ModelTask::kDone) return TaskState::kDone;
    if (tasks_[t].state == ModelTask::kFailed) return TaskState::kFailed;
    if (job.state != JobState::kRunning) return TaskState::kCancelled;
    return tasks_[t].task.stage == open_stage(job) ? TaskState::kReady : TaskState::kBlocked;
  }

  std::vector<uint64_t> model_counts(const ModelJob& job) const {
    std::vector<uint64_t> counts(5);
    counts[0] = job.tasks.size();
    for (const size_t t : job.tasks) {
      if (state(t) == TaskState::kReady) ++counts[live(t) > 0 ? 2 : 1];
      if (state(t) == TaskState::kDone) ++counts[3];
      if (state(t) == TaskState::kFailed) ++counts[4];
    }
    return counts;
  }

  JobView model_view(const ModelJob& job) const {
    JobView view{.id = job.id, .client = job.request.client, .priority = job.priority, .ready = {}, .running = {}};
    std::map<int64_t, size_t> in_order;
    for (const size_t t : job.tasks) in_order[tasks_[t].task.order] = t;
    for (const auto& [order, t] : in_order) {
      if (state(t) != TaskState::kReady) continue;
      if (live(t) == 0) {
        JobView::Ready ready{tasks_[t].id, order};
        std::set<std::string> failed_by;
        for (const auto& [token, attempt] : attempts_) {
          if (attempt.task == t && attempt.failed) failed_by.insert(attempt.worker);
        }
        ready.failed_by.assign(failed_by.begin(), failed_by.end());
        view.ready.push_back(ready);
        continue;
      }
      JobView::Running running{.task = tasks_[t].id, .order = order, .leased_ms = INT64_MAX, .workers = {}};
      for (const auto& [token, attempt] : attempts_) {
        if (!attempt.live || attempt.task != t) continue;
        ++running.live;
        ++view.live;
        running.leased_ms = std::min(running.leased_ms, attempt.leased_ms);
        running.workers.push_back(attempt.worker);
      }
      view.running.push_back(running);
    }
    return view;
  }

  void note(size_t task, const std::string& worker, const std::string& what) {
    jobs_[tasks_[task].job].history.push_back(absl::StrCat(tasks_[task].task.order, " ", worker, " ", what));
  }

  void end(ModelJob& job, JobState state, const char* name) {
    job.state = state;
    job.history.push_back(absl::StrCat("ended: ", name));
  }

  void end_if_nothing_is_left(ModelJob& job) {
    bool waiting = false;
    bool failed = false;
    bool done = false;
    for (const size_t t : job.tasks) {
      if (state(t) == TaskState::kReady) return;
      waiting |= tasks_[t].state == ModelTask::kWaits;
      failed |= tasks_[t].state == ModelTask::kFailed;
      done |= tasks_[t].state == ModelTask::kDone;
    }
    if (!failed) return end(job, JobState::kDone, "done");
    waiting || !done ? end(job, JobState::kFailed, "failed") : end(job, JobState::kPartial, "partial");
  }

  void add_task(size_t job, const NewTask& task) {
    jobs_[job].tasks.push_back(tasks_.size());
    tasks_.push_back({.job = job, .task = task});
  }

  // Chance.

  uint64_t below(uint64_t n) { return random_() % n; }

  NewTask random_task(uint32_t lowest_stage, uint64_t stages) {
    // Unique, so that a view tells which task it means; and not in the order of submission.
    const auto order = static_cast<int64_t>(below(1000) * 100'000) + ++orders_;
    return {absl::StrCat("kind", below(3)), lowest_stage + static_cast<uint32_t>(below(stages)), absl::StrCat(order),
            order};
  }

  std::string random_worker() { return absl::StrCat("w", below(4)); }

  /// Mostly of a live attempt, now and then one that never was.
  std::string random_token() {
    if (tokens_ == 0 || below(50) == 0) return "nobody's";
    std::string name;
    do {
      name = token(tokens_ - below(std::min<uint64_t>(tokens_, 30)));
    } while (!attempts_[name].live && below(6) != 0);
    return name;
  }

  static std::string token(uint64_t number) { return absl::StrCat("t", 1'000'000 + number); }  // sorts by number

  // The transitions, each on both.

  void submit() {
    const uint64_t running = static_cast<uint64_t>(
        std::count_if(jobs_.begin(), jobs_.end(), [](const ModelJob& job) { return job.state == JobState::kRunning; }));
    if (running < 4) {
      ModelJob job;
      job.request = new_job(absl::StrCat("r", jobs_.size()), {});
      job.request.client = absl::StrCat("c", below(2));
      job.request.priority = job.priority = static_cast<int32_t>(below(3));
      const uint64_t stages = 1 + below(3);
      for (uint64_t n = 1 + below(8); n > 0; --n) job.request.tasks.push_back(random_task(0, stages));
      job.id = value(store_->submit(job.request, now_)).id;
      job.history = {"submitted"};
      jobs_.push_back(job);
      for (const NewTask& task : job.request.tasks) add_task(jobs_.size() - 1, task);
    } else {
      const ModelJob& again = jobs_[below(jobs_.size())];
      EXPECT_EQ(value(store_->submit(again.request, now_)).id, again.id);
    }
  }

  void lease() {
    size_t t = below(tasks_.size());
    // Mostly one that may be had.
    for (int i = 0; i < 60 && state(t) != TaskState::kReady && below(20) != 0; ++i) t = below(tasks_.size());
    lease(t, 1 + below(3));
  }

  void lease(size_t t, uint64_t max_live) {
    const std::string worker = random_worker();
    const bool has_one = std::any_of(attempts_.begin(), attempts_.end(), [&](const auto& named) {
      return named.second.live && named.second.task == t && named.second.worker == worker;
    });
    if (tasks_[t].id == 0) return;  // blocked so far: its number is not known yet
    const bool expected = state(t) == TaskState::kReady && live(t) < max_live && !has_one;
    const int64_t expires_ms = now_ + static_cast<int64_t>(below(60));
    const std::string name = token(tokens_ + 1);
    EXPECT_EQ(value(store_->lease({tasks_[t].id, worker, name, expires_ms, static_cast<uint32_t>(max_live)}, now_)),
              expected);
    if (!expected) return;
    ++tokens_;
    attempts_[name] = {.task = t, .worker = worker, .leased_ms = now_, .expires_ms = expires_ms};
    note(t, worker, "leased");
  }

  void complete() {
    last_token_ = random_token();
    const auto attempt = attempts_.find(last_token_);
    const bool lies = below(15) == 0;
    last_output_ = lies ? -1 : attempt == attempts_.end() ? 0 : tasks_[attempt->second.task].task.order;
    complete_again();
  }

  void complete_again() {
    const auto attempt = attempts_.find(last_token_);
    std::vector<NewTask> spawned;
    if (attempt != attempts_.end()) {
      const uint32_t stage = tasks_[attempt->second.task].task.stage;
      for (uint64_t n = below(3); stage < 4 && n > 1; --n) spawned.push_back(random_task(stage + 1, 2));
    }
    EXPECT_EQ(value(store_->complete(last_token_, {digest(last_output_)}, spawned, now_)), model_complete(spawned));
  }

  Completion model_complete(const std::vector<NewTask>& spawned) {
    const auto named = attempts_.find(last_token_);
    if (named == attempts_.end()) return Completion::kUnknown;
    ModelAttempt& attempt = named->second;
    const size_t t = attempt.task;
    if (tasks_[t].state == ModelTask::kDone) {
      if (tasks_[t].output == last_output_) return Completion::kAlreadyDone;
      if (!std::exchange(attempt.mismatched, true)) note(t, attempt.worker, "mismatch");
      return Completion::kMismatch;
    }
    const size_t job = tasks_[t].job;
    if (jobs_[job].state != JobState::kRunning) return Completion::kJobEnded;
    end_attempts(t);
    tasks_[t].state = ModelTask::kDone;
    tasks_[t].output = last_output_;
    note(t, attempt.worker, "completed");
    for (const NewTask& task : spawned) add_task(job, task);
    end_if_nothing_is_left(jobs_[job]);
    return Completion::kAccepted;
  }

  void end_attempts(size_t task) {
    for (auto& [token, attempt] : attempts_) {
      if (attempt.task == task) attempt.live = false;
    }
  }

  void fail() {
    const std::string name = random_token();
    const auto named = attempts_.find(name);
    const bool expected = named != attempts_.end() && named->second.live;
    EXPECT_EQ(value(store_->fail(name, "broke", now_, kMaxFailures)), expected);
    if (!expected) return;
    named->second.live = false;
    named->second.failed = true;
    ModelTask& task = tasks_[named->second.task];
    note(named->second.task, named->second.worker, "failed: broke");
    if (++task.failures < kMaxFailures) return;
    end_attempts(named->second.task);
    task.state = ModelTask::kFailed;
    end_if_nothing_is_left(jobs_[task.job]);
  }

  void expire() {
    std::vector<std::pair<int64_t, std::string>> late;
    for (const auto& [token, attempt] : attempts_) {
      if (attempt.live && attempt.expires_ms < now_) late.emplace_back(attempt.expires_ms, token);
    }
    std::sort(late.begin(), late.end());
    std::vector<std::string> expected;
    for (const auto& [expires_ms, token] : late) {
      expected.push_back(token);
      attempts_[token].live = false;
      note(attempts_[token].task, attempts_[token].worker, "expired");
    }
    EXPECT_EQ(value(store_->expire(now_)), expected);
  }

  void release() {
    const std::string worker = random_worker();
    const std::vector<std::string> tokens = {random_token(), random_token()};
    value(store_->release(worker, tokens, now_));
    for (const std::string& name : tokens) {
      const auto named = attempts_.find(name);
      if (named == attempts_.end() || named->second.worker != worker || !named->second.live) continue;
      named->second.live = false;
      note(named->second.task, worker, "released");
    }
  }

  void extend() {
    const std::string worker = random_worker();
    const int64_t expires_ms = now_ + 40;
    std::vector<std::string> all;
    std::vector<std::string> expected;
    for (auto& [name, attempt] : attempts_) {
      all.push_back(name);
      if (!attempt.live || attempt.worker != worker) continue;
      expected.push_back(name);
      attempt.expires_ms = expires_ms;
    }
    EXPECT_EQ(value(store_->extend(worker, all, expires_ms)), expected);
  }

  void cancel() {
    ModelJob& job = jobs_[below(jobs_.size())];
    value(store_->cancel(job.id, now_));
    if (job.state != JobState::kRunning) return;
    for (const size_t t : job.tasks) end_attempts(t);
    job.history.emplace_back("cancelled");
    end(job, JobState::kCancelled, "cancelled");
  }

  void set_priority() {
    ModelJob& job = jobs_[below(jobs_.size())];
    job.priority = static_cast<int32_t>(below(9)) - 4;
    value(store_->set_priority(job.id, job.priority));
  }

  void reopen() {
    store_.reset();
    store_ = value(GetParam().open(folder_.path()));
    ASSERT_NE(store_, nullptr);
    if (below(2) == 0) return;
    value(store_->renew_all(now_ + 30));
    for (auto& [name, attempt] : attempts_) {
      if (attempt.live) attempt.expires_ms = now_ + 30;
    }
  }

  // Comparing.

  /// What is running, after every transition; also learns the numbers of tasks that became ready.
  void compare_views() {
    std::vector<JobView> views = value(store_->view(1'000));
    size_t next = 0;
    for (ModelJob& job : jobs_) {
      if (job.state != JobState::kRunning) continue;
      ASSERT_LT(next, views.size());
      const JobView& view = views[next++];
      for (const size_t t : job.tasks) {
        for (const JobView::Ready& ready : view.ready) {
          if (tasks_[t].id == 0 && ready.order == tasks_[t].task.order) tasks_[t].id = ready.task;
        }
      }
      const JobView expected = model_view(job);
      EXPECT_EQ(view.id, expected.id);
      EXPECT_EQ(view.client, expected.client);
      EXPECT_EQ(view.priority, expected.priority);
      EXPECT_EQ(view.live, expected.live);
      EXPECT_TRUE(view.ready == expected.ready) << "job " << job.id;
      EXPECT_TRUE(view.running == expected.running) << "job " << job.id;
      EXPECT_EQ(counts(value(store_->job(job.id))), model_counts(job)) << "job " << job.id;
    }
    EXPECT_EQ(next, views.size());
  }

  void compare_all() {
    compare_views();
    for (const ModelJob& job : jobs_) {
      const Job stored = value(store_->job(job.id));
      EXPECT_EQ(stored.state, job.state) << "job " << job.id;
      EXPECT_EQ(stored.finished_ms == 0, job.state == JobState::kRunning) << "job " << job.id;
      EXPECT_EQ(counts(stored), model_counts(job)) << "job " << job.id;
      compare_history(job);
    }
    for (size_t t = 0; t < tasks_.size(); ++t) {
      if (tasks_[t].id == 0) continue;
      const Task stored = value(store_->task(tasks_[t].id));
      EXPECT_EQ(stored.job, jobs_[tasks_[t].job].id) << "task " << stored.id;
      EXPECT_EQ(stored.kind, tasks_[t].task.kind) << "task " << stored.id;
      EXPECT_EQ(stored.argument, tasks_[t].task.argument) << "task " << stored.id;
      EXPECT_EQ(stored.stage, tasks_[t].task.stage) << "task " << stored.id;
      EXPECT_EQ(stored.state, state(t)) << "task " << stored.id;
      EXPECT_EQ(stored.live, live(t)) << "task " << stored.id;
      EXPECT_EQ(stored.failures, tasks_[t].failures) << "task " << stored.id;
      const bool done = tasks_[t].state == ModelTask::kDone;
      EXPECT_EQ(stored.outputs, done ? std::vector{digest(tasks_[t].output)} : std::vector<Digest>())
          << "task " << stored.id;
    }
  }

  void compare_history(const ModelJob& job) {
    std::map<TaskId, int64_t> order_of;
    for (const size_t t : job.tasks) order_of[tasks_[t].id] = tasks_[t].task.order;
    std::vector<std::string> lines;
    std::map<TaskId, int> completions;
    for (const Event& e : value(store_->events(job.id, 0, 100'000))) {
      lines.push_back(e.task == 0 ? e.what : absl::StrCat(order_of[e.task], " ", e.worker, " ", e.what));
      if (e.what != "completed") continue;
      EXPECT_EQ(++completions[e.task], 1) << "task " << e.task << " was done twice";
    }
    EXPECT_EQ(lines, job.history) << "job " << job.id;
    EXPECT_EQ(completions.size(), model_counts(job)[3]) << "job " << job.id;
  }

 protected:
  TemporaryFolder folder_;
  std::unique_ptr<Store> store_;
  std::mt19937_64 random_{2};
  int64_t now_ = 1;
  int64_t orders_ = 0;
  uint64_t tokens_ = 0;
  std::string last_token_ = "nobody's";
  int64_t last_output_ = 0;
  std::vector<ModelJob> jobs_;
  std::vector<ModelTask> tasks_;
  std::map<std::string, ModelAttempt> attempts_;  // by token, in the order of their leases
};

TEST_P(StoreModel, AgreesAtRandom) {
  struct Transition {
    const char* name;
    int weight;
    void (StoreModel::*run)();
  };
  const std::vector<Transition> transitions = {
      {"submit", 8, &StoreModel::submit},      {"lease", 40, &StoreModel::lease},
      {"complete", 20, &StoreModel::complete}, {"complete again", 6, &StoreModel::complete_again},
      {"fail", 10, &StoreModel::fail},         {"expire", 6, &StoreModel::expire},
      {"release", 4, &StoreModel::release},    {"extend", 4, &StoreModel::extend},
      {"cancel", 1, &StoreModel::cancel},      {"set_priority", 2, &StoreModel::set_priority},
      {"reopen", 2, &StoreModel::reopen},
  };
  std::vector<size_t> lots;
  for (size_t i = 0; i < transitions.size(); ++i) {
    lots.insert(lots.end(), static_cast<size_t>(transitions[i].weight), i);
  }
  reopen();
  submit();
  compare_views();
  for (int i = 0; i < kTransitions; ++i) {
    const Transition& transition = transitions[lots[below(lots.size())]];
    SCOPED_TRACE(absl::StrCat("transition ", i, ": ", transition.name));
    now_ += static_cast<int64_t>(below(4));
    (this->*transition.run)();
    i % 250 == 0 ? compare_all() : compare_views();
    if (HasFailure()) return;  // what follows would only repeat it
  }
  compare_all();

  // Everything that is left is done: all jobs end.
  for (bool left = true; left && !HasFailure();) {
    left = false;
    for (size_t t = 0; t < tasks_.size(); ++t) {
      if (state(t) != TaskState::kReady) continue;
      left = true;
      if (live(t) == 0) lease(t, 1);
      const auto attempt = std::find_if(attempts_.begin(), attempts_.end(),
                                        [&](const auto& named) { return named.second.live && named.second.task == t; });
      ASSERT_NE(attempt, attempts_.end());
      last_token_ = attempt->first;
      last_output_ = tasks_[t].task.order;
      EXPECT_EQ(value(store_->complete(last_token_, {digest(last_output_)}, {}, now_)), model_complete({}));
      compare_views();
    }
  }
  compare_all();
  std::map<JobState, int> ends;
  for (const Job& job : value(store_->jobs(0, 100'000))) ++ends[job.state];
  EXPECT_EQ(ends[JobState::kRunning], 0);
  for (const JobState end : {JobState::kDone, JobState::kPartial, JobState::kFailed, JobState::kCancelled}) {
    EXPECT_GT(ends[end], 0) << "no job ended as " << static_cast<int>(end);
  }
}

INSTANTIATE_TEST_SUITE_P(All, StoreModel, testing::ValuesIn(store_backends()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace lightloom::test
