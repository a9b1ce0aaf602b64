#include "cli/local_bake.h"

#include <filesystem>
#include <fstream>
#include <memory>
#include <thread>
#include <utility>

#include "bake-server/grpc/server.h"
#include "bake-worker/local_executor.h"
#include "bake-worker/worker.h"
#include "cli/farm_client.h"
#include "core/base/stopwatch.h"
#include "core/base/version.h"
#include "proto/protocol_version.h"

namespace lightloom {
namespace fs = std::filesystem;
namespace {

/// A worker and its thread, ended with it.
class LocalWorker {
 public:
  LocalWorker(std::shared_ptr<grpc::Channel> channel, TaskExecutor* executor, WorkerOptions options)
      : worker_(std::move(channel), executor, std::move(options)), thread_([this] { (void)worker_.run(); }) {}
  ~LocalWorker() {
    worker_.stop();
    thread_.join();
  }
  LocalWorker(const LocalWorker&) = delete;
  LocalWorker& operator=(const LocalWorker&) = delete;

 private:
  Worker worker_;
  std::thread thread_;
};

/// Names the time since the machine started: what was not waited for until it was on the disk is good for that long.
std::string this_boot() {
  std::string id = "boot";
  std::ifstream("/proc/sys/kernel/random/boot_id") >> id;
  return id.substr(0, 8);
}

absl::Status stopped(const std::string& loom, const RemoteJob& job) {
  std::error_code error;
  const bool old = fs::exists(fs::path(loom) / "manifest", error);
  return absl::CancelledError(
      "bake stopped; " + loom + (old ? " still holds the earlier bake" : " holds no asset yet") + ", and " +
      std::to_string(job.done) + " of " + std::to_string(job.tasks) + " tasks are kept: bake again to go on");
}

/// The job until it ends, or the bake is cancelled.
absl::StatusOr<RemoteJob> run_job(RemoteJob job, FarmClient* client, std::shared_ptr<grpc::Channel> channel,
                                  TaskExecutor* executor, const std::string& loom, const BakeControl& control) {
  const auto threads = static_cast<uint32_t>(thread_count(control.threads));
  const LocalWorker worker(std::move(channel), executor, {"this", introduce_this_machine(threads)});
  const CancelFlag never;
  const auto end =
      client->watch(job.id, control.cancel != nullptr ? *control.cancel : never, [&](const RemoteJob& now) {
        job = now;
        if (control.progress) control.progress("bake", now.done, now.tasks, now.rays);
      });
  if (absl::IsCancelled(end.status())) return stopped(loom, job);
  return end;
}

}  // namespace

absl::StatusOr<BakeReport> local_bake(const RayTracer& tracer, const LocalBake& bake, const BakeControl& control) {
  const Stopwatch watch;
  const std::string& loom = bake.loom;
  LL_ASSIGN_OR_RETURN(const std::shared_ptr<const BakeSession> session,
                      BakeSession::create(tracer, bake.params, control));
  auto reuse = std::make_shared<const Reuse>(no_reuse(session->plan()));
  EarlierResults results;
  const bool looks_back = bake.earlier != nullptr && !bake.earlier->traces.empty();
  if (looks_back) {
    results = {sha256(bake.earlier->traces), bake.earlier->tolerance};
    LL_ASSIGN_OR_RETURN(reuse,
                        session->reuse(
                            results, [&] { return decode_bake_traces(bake.earlier->traces); }, control.stage("reuse")));
  }
  const double seconds_plan = watch.seconds();
  if (bake.planned && !bake.planned(*session, *reuse)) return BakeReport();

  // The level is at hand: no blob holds it, and its hash stands for it. Equal payloads, after the same bake, are one job.
  const std::vector<uint8_t> payload = encode_payload({scene_hash(tracer.scene()), bake.params});
  const SpawnedTask first = looks_back ? first_task(&results) : first_task();
  const auto request_id = [&](uint64_t attempt) {
    return Hasher().digest(sha256(payload)).digest(sha256(first.argument)).value(attempt).finish().hex();
  };

  const std::string state = loom + ".partial";
  CoordinatorOptions options;
  options.keep_leases = false;
  LL_ASSIGN_OR_RETURN(auto farm, Farm::open(fs::path(state) / this_boot(), options, Durability::kProcess));
  const ServerInfo info{std::string(kVersion), kProtocolVersion, std::string(kMethodVersion)};
  LL_ASSIGN_OR_RETURN(auto server, Server::start_in_process(info, farm.get()));
  FarmClient client(server->in_process_channel(), state);
  LL_ASSIGN_OR_RETURN(const std::vector<RemoteJob> earlier, client.jobs());
  std::vector<Digest> inputs;
  if (looks_back) {
    LL_RETURN_IF_ERROR(client.upload(bake.earlier->traces).status());
    inputs.push_back(results.traces);
  }
  RemoteJob job;
  uint64_t attempt = 0;
  do {  // one that another edit has cancelled is begun again; what it had done is used
    LL_ASSIGN_OR_RETURN(job, client.submit(request_id(attempt++), payload, first, inputs, loom, 0));
  } while (job.state == "cancelled");
  for (const RemoteJob& other : earlier) {  // of another level, or other parameters
    if (other.id != job.id && !other.ended()) LL_RETURN_IF_ERROR(client.cancel(other.id).status());
  }
  if (!job.ended()) {
    LocalExecutor executor(server->in_process_channel(), static_cast<uint32_t>(thread_count(control.threads)), 0);
    executor.adopt(payload, session);
    LL_ASSIGN_OR_RETURN(job, run_job(std::move(job), &client, server->in_process_channel(), &executor, loom, control));
  }
  const auto forget = [&] {
    server.reset();
    farm.reset();
    std::error_code ignored;
    fs::remove_all(state, ignored);
  };
  if (job.state != "done") {
    forget();  // the same again would find the same failure
    return absl::AbortedError(job.error.empty() ? "the bake ended " + job.state : job.error);
  }
  const Stopwatch write_watch;
  const CancelFlag never;
  LL_ASSIGN_OR_RETURN(const Manifest manifest, client.fetch(job.id, loom, never, [](uint64_t, uint64_t) {}));
  BakeReport report = report_of(manifest);
  count_reused(*reuse, manifest, &report);
  add_times(*session, control.threads, &report);
  report.seconds_plan = seconds_plan;
  report.seconds_write = write_watch.seconds();
  forget();
  report.seconds_total = watch.seconds();
  return report;
}

}  // namespace lightloom
