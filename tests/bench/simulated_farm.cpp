#include "tests/bench/simulated_farm.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <map>
#include <memory>
#include <numeric>
#include <string>

#include "bake-server/store/sqlite_store.h"
#include "core/base/rng.h"
#include "tests/bench/or_exit.h"
#include "tests/bench/simulated_worker.h"

namespace lightloom::bench {
namespace {

constexpr double kAssembleSeconds = 1;
constexpr int kBlobs = 512;  // results share so many, each with another neighbour

/// The cells' times, and what they yield: pure functions of their number.
class Cells {
 public:
  Cells(const FarmOptions& options, BlobStore* blobs) {
    Rng rng(options.seed);
    for (int i = 0; i < options.tasks; ++i) {
      seconds_.push_back(options.task_seconds[rng.next_below(static_cast<uint32_t>(options.task_seconds.size()))]);
    }
    for (int i = 0; i < kBlobs; ++i) {
      const std::string text = "blob " + std::to_string(i);
      blobs_.push_back(or_exit(blobs->put({reinterpret_cast<const uint8_t*>(text.data()), text.size()})));
    }
  }
  double seconds_of(const Assignment& a) const {
    if (a.kind == "plan") return 0;  // it needs a planned level, as all do
    return a.kind == "assemble" ? kAssembleSeconds : seconds_[number_of(a)];
  }
  std::vector<Digest> outputs_of(const Assignment& a) const {
    const size_t i = a.kind == "cell" ? number_of(a) : 0;
    return {blobs_[i % kBlobs], blobs_[(i + 1) % kBlobs]};
  }
  std::vector<NewTask> spawned_by(const Assignment& a) const {
    std::vector<NewTask> out;
    if (a.kind != "plan") return out;
    const auto n = static_cast<int64_t>(seconds_.size());
    for (int64_t i = 0; i < n; ++i) out.push_back({"cell", 1, std::to_string(i), i});
    out.push_back({"assemble", 2, "", n});
    return out;
  }
  double work_seconds() const { return std::accumulate(seconds_.begin(), seconds_.end(), kAssembleSeconds); }
  double longest_seconds() const {
    return std::max(kAssembleSeconds, *std::max_element(seconds_.begin(), seconds_.end()));
  }

 private:
  static size_t number_of(const Assignment& a) { return std::stoul(a.argument); }

  std::vector<double> seconds_;
  std::vector<Digest> blobs_;
};

/// What the store has on record of the job.
void count_events(Store* store, JobId id, FarmReport* report) {
  const Job job = or_exit(store->job(id));
  report->done = job.done;
  report->failed = job.failed;
  std::map<TaskId, int> completed, leased;
  for (int64_t after = 0;;) {
    const std::vector<Event> events = or_exit(store->events(id, after, 100'000));
    for (const Event& e : events) {
      report->leases += e.what == "leased";
      report->expired += e.what == "expired";
      report->failed_attempts += e.what.starts_with("failed");
      report->on_record_twice += e.what == "completed" && ++completed[e.task] > 1;
      if (e.what == "leased" && ++leased[e.task] == 1 && leased.size() == job.tasks - 1) {
        report->all_leased_seconds = 1e-3 * static_cast<double>(e.at_ms);
      }
    }
    if (events.empty()) return;
    after = events.back().id;
  }
}

void count_waits(std::vector<double> waits, FarmReport* report) {
  if (waits.empty()) return;
  std::sort(waits.begin(), waits.end());
  report->wait_mean_seconds = std::accumulate(waits.begin(), waits.end(), 0.0) / static_cast<double>(waits.size());
  report->wait_p99_seconds = waits[static_cast<size_t>(0.99 * static_cast<double>(waits.size() - 1))];
}

}  // namespace

FarmReport simulate(const FarmOptions& options, const std::filesystem::path& folder) {
  const auto store = or_exit(open_sqlite_store(folder, Durability::kProcess));
  const auto blobs = or_exit(BlobStore::open(folder / "blobs", Durability::kProcess));
  const Cells cells(options, blobs.get());
  test::Agenda<double> agenda;  // seconds
  Surroundings around{
      .agenda = agenda,
      .from_server{&agenda, options.link_bytes_per_second},
      .to_server{&agenda, options.link_bytes_per_second},
      .coordinator{&agenda, store.get(), blobs.get(), options.charge_seconds, options.commit_seconds},
      .latency_seconds = options.latency_seconds,
      .level_bytes = options.level_bytes,
      .result_bytes = options.result_bytes,
      .plan_seconds = options.plan_seconds,
      .blob_seconds = options.blob_seconds,
      .seconds_of = [&](const Assignment& a) { return cells.seconds_of(a); },
      .outputs_of = [&](const Assignment& a) { return cells.outputs_of(a); },
      .spawned_by = [&](const Assignment& a) { return cells.spawned_by(a); },
  };

  FarmReport report;
  report.dying = std::max(1, static_cast<int>(options.workers * options.failing / 2));
  report.failing = std::max(1, static_cast<int>(options.workers * options.failing) - report.dying);
  report.work_seconds = cells.work_seconds();
  report.longest_seconds = cells.longest_seconds();
  const int healthy = options.workers - report.dying - report.failing;
  report.ideal_seconds = std::max(report.work_seconds / healthy, report.longest_seconds);

  // Who fails is spread among the others.
  Rng rng(options.seed + 1);
  std::vector<Fate> fates(static_cast<size_t>(options.workers), Fate::kHealthy);
  for (int i = 0; i < report.dying + report.failing;) {
    Fate& fate = fates[rng.next_below(static_cast<uint32_t>(options.workers))];
    if (fate != Fate::kHealthy) continue;
    fate = i++ < report.dying ? Fate::kDies : Fate::kFailsEachTask;
  }
  std::vector<std::unique_ptr<SimulatedWorker>> workers;
  for (size_t i = 0; i < fates.size(); ++i) {
    workers.push_back(std::make_unique<SimulatedWorker>(&around, "worker-" + std::to_string(i), fates[i], i));
    SimulatedWorker* worker = workers.back().get();
    agenda.at(rng.next_float(), [worker] { worker->begin(); });  // they join within a second
    const double end_of_life = options.plan_seconds + report.ideal_seconds * static_cast<double>(rng.next_float());
    if (fates[i] == Fate::kDies) agenda.at(1 + end_of_life, [worker] { worker->die(); });
  }

  // All are there before the job is.
  JobId job = 0;
  constexpr double kSubmitted = 2;
  agenda.at(kSubmitted, [&] {
    NewJob request;
    request.request_id = "simulated request";
    request.client = "simulation";
    request.name = "level";
    request.tasks = {{"plan", 0, "", 0}};
    job = or_exit(store->submit(request, static_cast<int64_t>(1e3 * kSubmitted))).id;
  });
  uint64_t turns = 0;
  for (;;) {
    const bool late = agenda.now() > 100 * (options.plan_seconds + report.ideal_seconds) + 1000;
    if (late || !agenda.step()) or_exit(absl::InternalError("the job goes on without end"));
    if (job == 0 || !around.coordinator.idle() || turns == around.coordinator.costs().turns) continue;
    turns = around.coordinator.costs().turns;
    if (or_exit(store->job(job)).state != JobState::kRunning) break;
  }
  report.seconds = agenda.now() - kSubmitted;
  report.coordinator = around.coordinator.costs();
  report.levels_ready_seconds = around.levels_ready_seconds - kSubmitted;
  report.from_server_busy_seconds = around.from_server.busy_seconds();
  report.to_server_busy_seconds = around.to_server.busy_seconds();
  report.deaths_with_tasks = around.deaths_with_tasks;
  report.strict_share =
      std::max((report.work_seconds - around.seconds_of_the_dead) / healthy, report.longest_seconds) / report.seconds;
  count_waits(std::move(around.waits), &report);
  count_events(store.get(), job, &report);
  report.all_leased_seconds -= kSubmitted;
  return report;
}

std::vector<double> read_task_seconds(const std::filesystem::path& csv) {
  std::ifstream in(csv);
  std::vector<double> out;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with('#')) continue;
    double seconds = 0;
    const size_t comma = line.find(',');
    if (comma == std::string::npos ||
        std::from_chars(line.data() + comma + 1, line.data() + line.size(), seconds).ec != std::errc()) {
      or_exit(absl::InvalidArgumentError(csv.string() + ": not KIND,SECONDS: " + line));
    }
    out.push_back(seconds);
  }
  if (out.empty()) or_exit(absl::NotFoundError(csv.string() + ": there are no task times"));
  return out;
}

}  // namespace lightloom::bench
