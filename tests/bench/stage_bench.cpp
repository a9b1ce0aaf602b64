// The farm's work without the farm: one of N processes that share out the tasks of a bake's stage 1 and do nothing else.
//   stage_bench LEVEL.glb LIGHTMAP_SIZE RAYS SPACING I N [TIMES.csv]
// One thread. Prints the seconds of its share, once the level is planned. TIMES.csv gets each
// task's CPU seconds: so tests/bench/task_seconds.csv was made.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>

#include "core/bake/task_runner.h"
#include "core/base/file.h"
#include "core/base/stopwatch.h"
#include "tests/bench/cpu_time.h"
#include "tests/bench/or_exit.h"

namespace lightloom {
namespace {

constexpr int64_t kRun = 16;  // neighbours that one process takes, as DecideOptions::run

using bench::or_exit;

/// One thread's.
class MemoryBlobs final : public BlobAccess {
 public:
  absl::StatusOr<std::vector<uint8_t>> get(const Digest& digest) override { return blobs_.at(digest); }
  absl::Status put(const std::vector<std::vector<uint8_t>>& many) override {
    for (const std::vector<uint8_t>& bytes : many) blobs_[sha256(bytes)] = bytes;
    return absl::OkStatus();
  }

 private:
  std::map<Digest, std::vector<uint8_t>> blobs_;
};

int run(int argc, char** argv) {
  if (argc != 7 && argc != 8) {
    std::fprintf(stderr, "usage: stage_bench LEVEL.glb LIGHTMAP_SIZE RAYS SPACING I N [TIMES.csv]\n");
    return 2;
  }
  std::ofstream times;
  if (argc == 8) {
    times.open(argv[7]);
    times << "# stage_bench " << std::filesystem::path(argv[1]).filename().string();
    for (int i = 2; i < 7; ++i) times << ' ' << argv[i];
    times << ": CPU seconds of each task of stage 1\n";
  }
  BakeParams params;
  params.lightmap_size = std::atoi(argv[2]);
  params.rays = std::atoi(argv[3]);
  params.spacing = static_cast<float>(std::atof(argv[4]));
  const int64_t mine = std::atoi(argv[5]), of = std::atoi(argv[6]);
  MemoryBlobs blobs;
  const std::vector<uint8_t> level = or_exit(read_file(argv[1]));
  (void)blobs.put({level});
  const std::vector<uint8_t> payload = encode_payload({sha256(level), params});
  TaskRunner runner(&blobs);
  BakeControl control;
  control.threads = 1;
  const SpawnedTask first = first_task();
  const TaskOutput plan = or_exit(runner.run({first.kind, payload, first.argument, {}}, control));

  const Stopwatch watch;
  uint64_t tasks = 0, rays = 0;
  for (const SpawnedTask& task : plan.spawned) {
    if (task.stage != 1 || task.order / kRun % of != mine) continue;
    const double begun_ms = bench::cpu_milliseconds();
    rays += or_exit(runner.run({task.kind, payload, task.argument, {}}, control)).rays;
    times << task.kind << ',' << 1e-3 * (bench::cpu_milliseconds() - begun_ms) << '\n';
    ++tasks;
  }
  std::printf("{\"tasks\": %llu, \"rays\": %llu, \"seconds\": %.3f}\n", static_cast<unsigned long long>(tasks),
              static_cast<unsigned long long>(rays), watch.seconds());
  return 0;
}

}  // namespace
}  // namespace lightloom

int main(int argc, char** argv) { return lightloom::run(argc, argv); }
