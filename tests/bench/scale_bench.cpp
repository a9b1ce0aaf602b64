// How many tasks a second the farm puts on record, and how long a worker waits for one: real server, store and gRPC over
// loopback, workers that only talk. In one process, so the load is on the same cores.
//
//   scale_bench sqlite|postgres [WORKERS TASKS BYTES]     16 workers, 40,000 tasks, no blobs
//
// BYTES: each task uploads a blob of so many first. Prints a line of Markdown.
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "bake-server/grpc/server.h"
#include "core/base/rng.h"
#include "tests/support/postgres_server.h"
#include "tests/support/talking_worker.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::test {
namespace {

constexpr uint32_t kRoom = 8;

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

struct Load {
  std::string address;
  Farm* farm = nullptr;
  size_t bytes = 0;
  std::mutex mutex;
  std::vector<double> waits_ms;  // of Syncs that brought tasks
  int done = 0;
};

void work(Load* load, int number) {
  TalkingWorker worker(load->address, "worker-" + std::to_string(number), kRoom);
  Rng rng(static_cast<uint64_t>(number));
  std::vector<uint8_t> blob(load->bytes);
  std::vector<std::string> finished, outputs;
  for (;;) {
    const double asked = now_s();
    const auto given = worker.sync(finished, kRoom, 1000, outputs);
    const double ms = 1e3 * (now_s() - asked);
    {
      const std::lock_guard lock(load->mutex);
      load->done += static_cast<int>(finished.size());
      if (!given.empty()) load->waits_ms.push_back(ms);
    }
    if (given.empty() && finished.empty()) return;
    finished.clear();
    outputs.clear();
    for (const auto& task : given) {
      finished.push_back(task.attempt());
      if (load->bytes == 0) continue;
      for (size_t i = 0; i + 8 <= blob.size(); i += 8) {
        const uint64_t word = rng.next_u64();
        std::copy_n(reinterpret_cast<const uint8_t*>(&word), 8, blob.begin() + static_cast<std::ptrdiff_t>(i));
      }
      const Digest digest = value(load->farm->blobs().put(blob));
      outputs.emplace_back(digest.bytes.begin(), digest.bytes.end());
    }
  }
}

int run(const std::string& store, int workers, int tasks, size_t bytes) {
  const TemporaryFolder folder;
  const std::string database = store == "postgres" ? PostgresServer::shared().database("scale") : "";
  const auto farm = value(Farm::open(folder.path() / "state", {}, Durability::kPowerLoss, {}, database));
  const auto server = value(
      Server::start("127.0.0.1:0", {.version = "1", .protocol_version = 1, .method_version = "none"}, farm.get()));
  const auto jobs = v1::JobService::NewStub(dial(server->address()));
  submit_tasks(jobs.get(), "scale", tasks, 0);

  Load load;
  load.address = server->address();
  load.farm = farm.get();
  load.bytes = bytes;
  const double began = now_s();
  std::vector<std::thread> threads;
  for (int i = 0; i < workers; ++i) threads.emplace_back(work, &load, i);
  for (std::thread& t : threads) t.join();
  double idle = 1;  // that the last Syncs waited for tasks that were not there any more
  const double seconds = now_s() - began - idle;
  std::sort(load.waits_ms.begin(), load.waits_ms.end());
  const auto percentile = [&](double p) {
    return load.waits_ms.empty()
               ? 0
               : load.waits_ms[static_cast<size_t>(p * static_cast<double>(load.waits_ms.size() - 1))];
  };
  std::printf("| %s | %d | %d | %zu | %.0f | %.1f | %.1f |\n", store.c_str(), workers, load.done, bytes,
              load.done / seconds, percentile(0.5), percentile(0.99));
  return load.done == tasks ? 0 : 1;
}

}  // namespace
}  // namespace lightloom::test

int main(int argc, char** argv) {
  const std::string store = argc > 1 ? argv[1] : "sqlite";
  const auto number = [&](int i, int otherwise) { return argc > i ? std::atoi(argv[i]) : otherwise; };
  std::printf(
      "| store | workers | tasks | bytes each | tasks/s | median wait for tasks, ms | p99 "
      "|\n|---|---|---|---|---|---|---|\n");
  return lightloom::test::run(store, number(2, 16), number(3, 40'000), static_cast<size_t>(number(4, 0)));
}
