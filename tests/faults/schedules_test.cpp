// Ten thousand ways for messages between workers, clients and coordinator to go wrong: every one may be lost, come twice,
// late or out of order, and so may its answer; workers and the coordinator die and come back; disks are full for a while.
// The real dispatcher, scheduler and store; a clock and a network that are made up here, from a seed.
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <queue>
#include <random>
#include <set>

#include "bake-server/coordinator/dispatcher.h"
#include "bake-server/store/sqlite_store.h"
#include "tests/support/agenda.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::test {
namespace {

constexpr int kSchedules = 10'000;
constexpr int64_t kFaultsEndMs = 4'000;  // from then on everything works, so that all that can end does
constexpr int64_t kGiveUpMs = 60'000;
constexpr uint32_t kCells = 4;

/// What a task yields: a pure function of it, as the store asks for.
std::string output_of(const Assignment& a) { return absl::StrCat(a.payload, "/", a.kind, "/", a.argument); }
std::vector<Digest> outputs_of(const Assignment& a) { return {sha256(output_of(a))}; }
std::vector<NewTask> spawned_by(const Assignment& a) {
  if (a.kind != "plan") return {};
  std::vector<NewTask> out;
  for (uint32_t i = 0; i < kCells; ++i) out.push_back({"cell", 1, std::to_string(i), i});
  out.push_back({"assemble", 2, "", kCells});
  return out;
}

class Chance {
 public:
  explicit Chance(uint64_t seed) : random_(seed) {}
  uint64_t below(uint64_t n) { return random_() % n; }
  bool one_in(uint64_t n) { return below(n) == 0; }

 private:
  std::mt19937_64 random_;
};

/// Counts what went wrong, over all schedules: a test without faults would prove nothing.
struct Faults {
  uint64_t requests_lost = 0, requests_twice = 0, requests_late = 0, answers_lost = 0, workers_killed = 0,
           coordinators_killed = 0, failures = 0, cancels = 0, groups_undone = 0, reused = 0;
};

/// One schedule.
class Schedule {
 public:
  Schedule(Store* store, BlobStore* blobs, uint64_t seed, Faults* faults)
      : chance_(seed), seed_(seed), store_(store), blobs_(blobs), faults_(faults) {}

  void run() {
    start_coordinator();
    const uint64_t jobs = 1 + chance_.below(3);
    for (uint64_t i = 0; i < jobs; ++i) {
      agenda_.at(static_cast<int64_t>(chance_.below(2'000)), [this, i] { submit(i); });
    }
    for (int i = 0; i < 3; ++i) workers_.push_back(std::make_unique<Worker>(absl::StrCat("w", seed_, ".", i)));
    for (auto& worker : workers_)
      agenda_.at(static_cast<int64_t>(chance_.below(500)), [&, w = worker.get()] { talk(w); });
    for (int i = 0; i < 2; ++i) {
      if (chance_.one_in(2)) agenda_.at(time_of_fault(), [this] { kill_worker(); });
      if (chance_.one_in(4)) agenda_.at(time_of_fault(), [this] { kill_coordinator(); });
    }
    tick();
    while (!over_ && agenda_.now() < kGiveUpMs) ASSERT_TRUE(agenda_.step());
    check();
  }

 private:
  struct Worker {
    explicit Worker(std::string its_name) : name(std::move(its_name)) {}
    std::string name;
    uint64_t incarnation = 1, sequence = 0, seen = 0;
    std::map<std::string, Assignment> running;
    std::map<std::string, Assignment> finished;
    std::set<std::string> failed, released;
    std::set<std::string> cancelled;  // told that they are lost
  };

  bool faults_now() const { return agenda_.now() < kFaultsEndMs; }
  int64_t time_of_fault() { return static_cast<int64_t>(chance_.below(static_cast<uint64_t>(kFaultsEndMs))); }
  int64_t delay() {
    if (!faults_now() || !chance_.one_in(6)) return 1 + static_cast<int64_t>(chance_.below(5));
    ++faults_->requests_late;
    return static_cast<int64_t>(chance_.below(3'000));
  }

  void start_coordinator() {
    DispatchOptions options;
    options.lease_ms = 1'000;
    options.max_failures = 1'000;  // bad luck alone ends no job
    options.decide.straggler_ms = 700;
    options.new_token = [this] { return absl::StrCat(seed_, ".", next_token_++); };
    dispatcher_ = std::make_unique<Dispatcher>(store_, blobs_, options);
    value(store_->renew_all(agenda_.now() + options.lease_ms));
    ++life_;
  }

  void kill_coordinator() {
    ++faults_->coordinators_killed;
    dispatcher_.reset();
    agenda_.at(agenda_.now() + static_cast<int64_t>(chance_.below(1'500)), [this] { start_coordinator(); });
  }

  void kill_worker() {
    ++faults_->workers_killed;
    Worker& w = *workers_[chance_.below(workers_.size())];
    const std::string name = w.name;
    const uint64_t incarnation = w.incarnation;
    w = Worker(name);
    w.incarnation = incarnation + 1;
    agenda_.at(agenda_.now() + static_cast<int64_t>(chance_.below(1'500)), [this, &w] { talk(&w); });
  }

  /// A client, which repeats its request until it hears an answer.
  void submit(uint64_t i) {
    NewJob job = new_job(absl::StrCat("request ", seed_, ".", i), {{"plan", 0, "", 0}});
    // In every second schedule all jobs ask for the same: what one has done the others take.
    job.payload = absl::StrCat(seed_, ".", seed_ % 2 == 0 ? 0 : i);
    job.priority = static_cast<int32_t>(i);
    if (dispatcher_ != nullptr) {
      const JobId id = value(store_->submit(job, agenda_.now())).id;
      jobs_.insert(id);
      ids_[job.request_id].insert(id);
      if (chance_.one_in(8)) {
        agenda_.at(agenda_.now() + static_cast<int64_t>(chance_.below(1'000)), [this, id] {
          ++faults_->cancels;
          value(store_->cancel(id, agenda_.now()));
          if (dispatcher_ != nullptr) dispatcher_->wake_all();
        });
      }
      if (!faults_now() || !chance_.one_in(3)) return;  // else its answer was lost
    }
    agenda_.at(agenda_.now() + 50, [this, i] { submit(i); });
  }

  /// The coordinator's loop.
  void tick() {
    hear({});
    over_ = over();
    agenda_.at(agenda_.now() + 100, [this] { tick(); });
  }
  /// As Coordinator::loop(): what comes in is durable together with what follows from it, or not at all.
  void hear(const std::function<void()>& message) {
    if (dispatcher_ == nullptr) return;
    const bool fails = faults_now() && chance_.one_in(25);
    std::vector<Dispatcher::Answered> answers;
    const absl::Status durable = store_->group([&] {
      if (message) message();
      answers = dispatcher_->step(agenda_.now());
      return fails ? absl::ResourceExhaustedError("disk full") : absl::OkStatus();
    });
    if (!durable.ok()) {
      ++faults_->groups_undone;
      for (auto& a : answers) a.answer = durable;
      for (auto& a : dispatcher_->give_up(durable)) answers.push_back(std::move(a));
    }
    for (auto& a : answers) a.to(std::move(a.answer));
  }

  /// The worker's side of a Sync, and the network between.
  void talk(Worker* w) {
    SyncMessage m;
    m.worker = w->name;
    m.threads = 2;
    m.incarnation = w->incarnation;
    m.sequence = ++w->sequence;
    m.seen = w->seen;
    m.room = 2 - static_cast<uint32_t>(std::min<size_t>(2, w->running.size()));
    m.wait_ms = 100;
    for (const auto& [attempt, a] : w->running) m.running.push_back({attempt, 1});
    for (const auto& [attempt, a] : w->finished) m.finished.push_back({attempt, outputs_of(a), spawned_by(a), 10});
    for (const std::string& attempt : w->failed) m.failed.push_back({attempt, "broke"});
    m.released.assign(w->released.begin(), w->released.end());

    const auto answer = [this, w, incarnation = w->incarnation](const absl::StatusOr<SyncAnswer>& a) {
      if (!a.ok()) return;
      if (faults_now() && chance_.one_in(6)) {
        ++faults_->answers_lost;
        return;
      }
      agenda_.at(agenda_.now() + delay(), [this, w, incarnation, a = *a] {
        if (w->incarnation == incarnation) take(w, a);
      });
    };
    const auto send = [&] {
      agenda_.at(agenda_.now() + delay(), [this, m, answer, life = life_] {
        // A connection does not outlive its server.
        if (life == life_) hear([&] { dispatcher_->hear(m, answer, agenda_.now()); });
      });
    };
    if (faults_now() && chance_.one_in(6)) {
      ++faults_->requests_lost;
    } else {
      send();
    }
    if (faults_now() && chance_.one_in(6)) {
      ++faults_->requests_twice;
      send();
    }
    // The next one comes whether or not there was an answer, as after a deadline.
    agenda_.at(agenda_.now() + 150, [this, w, incarnation = w->incarnation] {
      if (w->incarnation == incarnation) talk(w);
    });
  }

  void take(Worker* w, const SyncAnswer& answer) {
    w->seen = std::max(w->seen, answer.sequence);
    for (const std::string& attempt : answer.acknowledged) {
      w->finished.erase(attempt);
      w->failed.erase(attempt);
      w->released.erase(attempt);
    }
    for (const std::string& attempt : answer.lost) w->running.erase(attempt);
    for (const Assignment& a : answer.assignments) {
      if (w->running.contains(a.attempt) || w->finished.contains(a.attempt) || w->failed.contains(a.attempt) ||
          w->released.contains(a.attempt) || ended_.contains(a.attempt)) {
        continue;
      }
      w->running.emplace(a.attempt, a);
      agenda_.at(agenda_.now() + static_cast<int64_t>(chance_.below(400)),
                 [this, w, incarnation = w->incarnation, attempt = a.attempt] {
                   if (w->incarnation == incarnation) end_task(w, attempt);
                 });
    }
  }

  void end_task(Worker* w, const std::string& attempt) {
    const auto task = w->running.find(attempt);
    if (task == w->running.end()) return;  // lost meanwhile
    ended_.insert(attempt);
    if (faults_now() && chance_.one_in(10)) {
      ++faults_->failures;
      w->failed.insert(attempt);
    } else if (faults_now() && chance_.one_in(10)) {
      w->released.insert(attempt);
    } else {
      const std::string output = output_of(task->second);
      value(blobs_->put({reinterpret_cast<const uint8_t*>(output.data()), output.size()}));
      w->finished.insert(*task);
    }
    w->running.erase(task);
  }

  bool over() {
    if (faults_now()) return false;
    return std::all_of(jobs_.begin(), jobs_.end(),
                       [&](JobId id) { return value(store_->job(id)).state != JobState::kRunning; });
  }

  void check() {
    SCOPED_TRACE(absl::StrCat("schedule ", seed_));
    for (const auto& [request, ids] : ids_) EXPECT_EQ(ids.size(), 1u) << request << " made more than one job";
    for (const JobId id : jobs_) {
      const Job job = value(store_->job(id));
      ASSERT_NE(job.state, JobState::kRunning) << job.done << " of " << job.tasks << " done";
      std::map<TaskId, int> completed;
      for (const Event& e : value(store_->events(id, 0, 1'000'000))) {
        completed[e.task] += e.what == "completed" || e.what == "reused";
        faults_->reused += e.what == "reused";
        EXPECT_NE(e.what, "mismatch");
      }
      for (const auto& [task, n] : completed) EXPECT_LE(n, 1) << "task " << task << " is on record twice";
      if (job.state == JobState::kCancelled) continue;
      EXPECT_EQ(job.state, JobState::kDone) << job.error;
      EXPECT_EQ(job.tasks, 2u + kCells);
      EXPECT_EQ(job.done, job.tasks);
      const Assignment last{
          .attempt = "", .job = id, .payload = job.payload, .kind = "assemble", .argument = "", .inputs = {}};
      EXPECT_EQ(job.outputs, outputs_of(last));
      for (uint32_t stage = 0; stage < 3; ++stage) {
        for (const TaskOutputs& t : value(store_->outputs(id, stage))) EXPECT_EQ(completed[t.task], 1);
      }
    }
    for (const JobView& view : value(store_->view(1))) EXPECT_FALSE(jobs_.contains(view.id));
  }

  Agenda<int64_t> agenda_;  // milliseconds
  Chance chance_;
  uint64_t seed_;
  Store* store_;
  BlobStore* blobs_;
  Faults* faults_;
  std::unique_ptr<Dispatcher> dispatcher_;  // null while it is dead
  uint64_t life_ = 0, next_token_ = 0;
  bool over_ = false;
  std::vector<std::unique_ptr<Worker>> workers_;
  std::set<JobId> jobs_;
  std::map<std::string, std::set<JobId>> ids_;  // by request
  std::set<std::string> ended_;                 // attempts that a worker ran to some end
};

TEST(Schedules, NoTaskIsLostNoneIsDoneTwiceAndAllJobsEnd) {
  const TemporaryFolder folder;
  const auto store = value(open_sqlite_store(folder.path(), Durability::kProcess));
  const auto blobs = value(BlobStore::open(folder.path() / "blobs", Durability::kProcess));
  Faults faults;
  for (int seed = 1; seed <= kSchedules && !testing::Test::HasFailure(); ++seed) {
    Schedule(store.get(), blobs.get(), static_cast<uint64_t>(seed), &faults).run();
  }
  std::printf(
      "%d schedules: %lu requests lost, %lu doubled, %lu messages late, %lu answers lost, %lu groups undone, %lu "
      "workers and %lu coordinators killed, %lu tasks failed, %lu used again, %lu jobs cancelled\n",
      kSchedules, faults.requests_lost, faults.requests_twice, faults.requests_late, faults.answers_lost,
      faults.groups_undone, faults.workers_killed, faults.coordinators_killed, faults.failures, faults.reused,
      faults.cancels);
  for (const uint64_t n : {faults.requests_lost, faults.requests_twice, faults.requests_late, faults.answers_lost,
                           faults.workers_killed, faults.groups_undone}) {
    EXPECT_GT(n, uint64_t{kSchedules});
  }
  EXPECT_GT(faults.coordinators_killed, uint64_t{kSchedules} / 4);
  EXPECT_GT(faults.cancels, uint64_t{kSchedules} / 8);
  EXPECT_GT(faults.reused, uint64_t{kSchedules});
}

}  // namespace
}  // namespace lightloom::test
