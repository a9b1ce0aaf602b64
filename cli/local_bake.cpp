#include "cli/local_bake.h"

#include <spdlog/spdlog.h>

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
  /// `ended` is set when the worker ends by itself, too.
  LocalWorker(std::shared_ptr<grpc::Channel> channel, TaskExecutor* executor, WorkerOptions options, CancelFlag* ended)
      : worker_(std::move(channel), executor, std::move(options)), thread_([this, ended] {
          end_ = worker_.run();
          ended->cancel();
        }) {}
  ~LocalWorker() { (void)stop(); }
  LocalWorker(const LocalWorker&) = delete;
  LocalWorker& operator=(const LocalWorker&) = delete;

  /// Why it ended by itself, if it did.
  absl::Status stop() {
    worker_.stop();
    if (thread_.joinable()) thread_.join();
    return end_;
  }

 private:
  Worker worker_;
  absl::Status end_;  // the thread's, until that is joined
  std::thread thread_;
};

/// Names the time since the machine started: what was not waited for until it was on the disk is good for that long.
std::string this_boot() {
  std::string id = "boot";
  std::ifstream("/proc/sys/kernel/random/boot_id") >> id;
  return id.substr(0, 8);
}

/// A farm waits for whoever mends the disk; here that is the user, who has to be told.
constexpr bool kWaitForRoom = false;

std::string state_of(const LocalBake& bake) { return bake.loom + ".partial"; }

std::string kept(const RemoteJob& job) {
  return std::to_string(job.done) + " of " + std::to_string(job.tasks) + " tasks are kept";
}

absl::Status stopped(const std::string& loom, const RemoteJob& job) {
  std::error_code error;
  const bool old = fs::exists(fs::path(loom) / "manifest", error);
  return absl::CancelledError("bake stopped; " + loom +
                              (old ? " still holds the earlier bake" : " holds no asset yet") + ", and " + kept(job) +
                              ": bake again to go on");
}

absl::Status no_room(const LocalBake& bake, const RemoteJob& job) {
  const std::string where = job.state == "done" ? bake.loom : state_of(bake);
  return absl::ResourceExhaustedError("no space left for " + where + ": free some on that disk, then bake again" +
                                      (job.tasks > 0 ? "; " + kept(job) : ""));
}

/// The job until it ends, or the bake is cancelled. ResourceExhausted: the disk is full.
absl::Status run_job(RemoteJob* job, FarmClient* client, std::shared_ptr<grpc::Channel> channel, TaskExecutor* executor,
                     const std::string& loom, const BakeControl& control) {
  const auto threads = static_cast<uint32_t>(thread_count(control.threads));
  CancelFlag over;
  WorkerOptions options{.name = "this", .who = introduce_this_machine(threads)};
  options.wait_for_room = kWaitForRoom;
  LocalWorker worker(std::move(channel), executor, std::move(options), &over);
  const auto end = client->watch(job->id, over, [&](const RemoteJob& now) {
    *job = now;
    if (control.progress) control.progress("bake", now.done, now.tasks, now.rays);
    if (control.cancel != nullptr && control.cancel->cancelled()) over.cancel();
  });
  if (end.ok()) *job = *end;
  if (!absl::IsCancelled(end.status())) return end.status();
  LL_RETURN_IF_ERROR(worker.stop());
  return stopped(loom, *job);
}

struct Written {
  Manifest manifest;
  double seconds = 0;  ///< of the asset's writing
};

/// A planned bake by a farm of this process. `job`: how far it came, also after an error. ResourceExhausted: the disk is full.
absl::StatusOr<Written> bake_on_own_farm(const LocalBake& bake, const std::shared_ptr<const BakeSession>& session,
                                         const EarlierResults* results, const BakeControl& control, RemoteJob* job) {
  // The level is at hand: no blob holds it, and its hash stands for it. Equal payloads, after the same bake, are one job.
  const std::vector<uint8_t> payload = encode_payload({scene_hash(session->scene()), bake.params});
  const SpawnedTask first = first_task(results);
  const auto request_id = [&](uint64_t attempt) {
    return Hasher().digest(sha256(payload)).digest(sha256(first.argument)).value(attempt).finish().hex();
  };

  spdlog::set_level(spdlog::level::off);  // a server's log; here errors say it, on stderr
  const std::string state = state_of(bake);
  CoordinatorOptions options;
  options.keep_leases = false;
  LL_ASSIGN_OR_RETURN(auto farm, Farm::open(fs::path(state) / this_boot(), options, Durability::kProcess));
  const ServerInfo info{std::string(kVersion), kProtocolVersion, std::string(kMethodVersion)};
  LL_ASSIGN_OR_RETURN(auto server, Server::start_in_process(info, farm.get()));
  FarmClient client(server->in_process_channel(), state);
  LL_ASSIGN_OR_RETURN(const std::vector<RemoteJob> earlier, client.jobs());
  std::vector<Digest> inputs;
  if (results != nullptr) {
    LL_RETURN_IF_ERROR(client.upload(bake.earlier->traces).status());
    inputs.push_back(results->traces);
  }
  uint64_t attempt = 0;
  do {  // one that another edit has cancelled is begun again; what it had done is used
    LL_ASSIGN_OR_RETURN(*job, client.submit(request_id(attempt++), payload, first, inputs, bake.loom, 0));
  } while (job->state == "cancelled");
  for (const RemoteJob& other : earlier) {  // of another level, or other parameters
    if (other.id != job->id && !other.ended()) LL_RETURN_IF_ERROR(client.cancel(other.id).status());
  }
  if (!job->ended()) {
    LocalExecutor executor(server->in_process_channel(), static_cast<uint32_t>(thread_count(control.threads)), 0,
                           kWaitForRoom);
    executor.adopt(payload, session);
    LL_RETURN_IF_ERROR(run_job(job, &client, server->in_process_channel(), &executor, bake.loom, control));
  }
  const auto forget = [&] {
    server.reset();
    farm.reset();
    std::error_code ignored;
    fs::remove_all(state, ignored);
  };
  if (job->state != "done") {
    forget();  // the same again would find the same failure
    return absl::AbortedError(job->error.empty() ? "the bake ended " + job->state : job->error);
  }
  const Stopwatch write_watch;
  const CancelFlag never;
  LL_ASSIGN_OR_RETURN(Manifest manifest, client.fetch(job->id, bake.loom, never, [](uint64_t, uint64_t) {}));
  const double seconds = write_watch.seconds();
  forget();
  return Written{std::move(manifest), seconds};
}

}  // namespace

absl::StatusOr<BakeReport> local_bake(const RayTracer& tracer, const LocalBake& bake, const BakeControl& control) {
  const Stopwatch watch;
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

  RemoteJob job;
  const auto written = bake_on_own_farm(bake, session, looks_back ? &results : nullptr, control, &job);
  if (absl::IsResourceExhausted(written.status())) return no_room(bake, job);
  if (!written.ok()) return written.status();
  BakeReport report = report_of(written->manifest);
  count_reused(*reuse, written->manifest, &report);
  add_times(*session, control.threads, &report);
  report.seconds_plan = seconds_plan;
  report.seconds_write = written->seconds;
  report.seconds_total = watch.seconds();
  return report;
}

}  // namespace lightloom
