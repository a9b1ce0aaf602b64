// What a farm makes of hundreds of workers: the real Dispatcher, scheduler and SQLite store by a made-up clock, on which
// the coordinator's turns take the CPU time that they took here.
//
//   farm_simulation [WORKERS [TASKS]] [--histogram FILE] [--charge MS] [--link GBITS] [--seed N]
//
// 500 workers, 200,000 tasks. --histogram: a line KIND,SECONDS for each task of a real bake. --charge: so long for each
// Sync, instead of what it took; then two runs print the same. --link: of the coordinator, each direction. Prints a table
// in Markdown, and what bounds a farm of this size.
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/bench/simulated_farm.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::bench {
namespace {

[[noreturn]] void usage() {
  std::fprintf(stderr,
               "usage: farm_simulation [WORKERS [TASKS]] [--histogram FILE] [--charge MS] [--link GBITS] [--seed N]\n");
  std::exit(2);
}

void row(const char* what, double value, const char* unit) { std::printf("| %s | %.4g %s |\n", what, value, unit); }

void print(const FarmOptions& o, const FarmReport& r) {
  const CoordinatorCosts& c = r.coordinator;
  const auto syncs = static_cast<double>(c.syncs), turns = static_cast<double>(c.turns);
  const double bytes_down = o.workers * o.level_bytes, bytes_up = o.tasks * o.result_bytes;
  std::printf("| %d workers, %d tasks of %.3g s | |\n|---|---|\n", o.workers, o.tasks, r.work_seconds / o.tasks);
  row("job", r.seconds, "s");
  std::printf("| ideal: max(%.0f s of work / %d healthy workers, longest task of %.2f s) | %.4g s |\n", r.work_seconds,
              o.workers - r.failing - r.dying, r.longest_seconds, r.ideal_seconds);
  row("**share of ideal**", 100 * r.share(), "%");
  row("the same without the work of those that died", 100 * r.strict_share, "%");
  row("last worker has the level and its plan after", r.levels_ready_seconds, "s");
  row("last task first leased after", r.all_leased_seconds, "s");
  row("coordinator busy", 100 * c.busy_seconds / r.seconds, "%");
  if (!o.charge_seconds) {
    row("of it: hearing Syncs", 100 * c.hear_seconds / c.busy_seconds, "%");
    row("of it: Store::view(), once a turn", 100 * c.view_seconds / c.busy_seconds, "%");
    row("of it: waiting for the disk", 100 * o.commit_seconds * turns / c.busy_seconds, "%");
    const double rest = c.busy_seconds - c.hear_seconds - c.view_seconds - o.commit_seconds * turns;
    row("of it: deciding, leasing, committing", 100 * rest / c.busy_seconds, "%");
  }
  row("coordinator's time for a Sync", 1e3 * c.busy_seconds / syncs, "ms");
  row("coordinator's time for a task", 1e3 * c.busy_seconds / o.tasks, "ms");
  row("longest turn", c.longest_turn_seconds, "s");
  row("Syncs a second", syncs / r.seconds, "");
  row("Syncs a turn", syncs / turns, "");
  row("link from server busy (levels)", 100 * r.from_server_busy_seconds / r.seconds, "%");
  row("link to server busy (results)", 100 * r.to_server_busy_seconds / r.seconds, "%");
  row("wait for work between two tasks, mean", 1e3 * r.wait_mean_seconds, "ms");
  row("the same, p99", 1e3 * r.wait_p99_seconds, "ms");
  std::printf("| workers that fail all tasks, that die (with tasks in hand) | %d, %d (%llu) |\n", r.failing, r.dying,
              static_cast<unsigned long long>(r.deaths_with_tasks));
  std::printf("| attempts: leased, failed, expired | %llu, %llu, %llu |\n", static_cast<unsigned long long>(r.leases),
              static_cast<unsigned long long>(r.failed_attempts), static_cast<unsigned long long>(r.expired));
  std::printf("| tasks done, failed for good, on record twice | %llu, %llu, %llu |\n\n",
              static_cast<unsigned long long>(r.done), static_cast<unsigned long long>(r.failed),
              static_cast<unsigned long long>(r.on_record_twice));
  std::printf(
      "No farm of this size is done sooner than: workers %.1f s, coordinator %.1f s of turns, link %.1f s of levels "
      "and "
      "%.1f s of results, level %.1f s to plan.\n",
      r.ideal_seconds, c.busy_seconds, bytes_down / o.link_bytes_per_second, bytes_up / o.link_bytes_per_second,
      o.plan_seconds);
}

int run(int argc, char** argv) {
  FarmOptions options;
  std::string histogram = LIGHTLOOM_SOURCE_DIR "/tests/bench/task_seconds.csv";
  int positional = 0;
  for (int i = 1; i < argc; ++i) {
    const std::string arg = argv[i];
    if (!arg.starts_with("--")) {
      if (++positional > 2 || std::atoi(argv[i]) < 1) usage();
      (positional == 1 ? options.workers : options.tasks) = std::atoi(argv[i]);
      continue;
    }
    if (++i == argc) usage();
    if (arg == "--histogram") {
      histogram = argv[i];
    } else if (arg == "--charge") {
      options.charge_seconds = 1e-3 * std::atof(argv[i]);
    } else if (arg == "--link") {
      options.link_bytes_per_second = 1e9 / 8 * std::atof(argv[i]);
    } else if (arg == "--seed") {
      options.seed = std::strtoull(argv[i], nullptr, 10);
    } else {
      usage();
    }
  }
  if (options.workers < 3) usage();  // two of them fail
  options.task_seconds = read_task_seconds(histogram);
  const test::TemporaryFolder folder;
  const FarmReport report = simulate(options, folder.path());
  print(options, report);
  return report.done == static_cast<uint64_t>(options.tasks) + 2 && report.on_record_twice == 0 ? 0 : 1;
}

}  // namespace
}  // namespace lightloom::bench

int main(int argc, char** argv) { return lightloom::bench::run(argc, argv); }
