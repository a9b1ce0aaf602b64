#include "cli/farm_client.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <map>

#include "cli/earlier_bake.h"
#include "core/asset/asset.h"
#include "core/bake/task_runner.h"
#include "core/base/first_error.h"
#include "core/base/random_id.h"
#include "core/base/text.h"
#include "core/base/version.h"
#include "proto/client.h"
#include "proto/digest.h"
#include "proto/job_service.grpc.pb.h"

namespace lightloom {
namespace {

std::string state_of(v1::Job::State state) {
  switch (state) {
    case v1::Job::RUNNING:
      return "running";
    case v1::Job::DONE:
      return "done";
    case v1::Job::PARTIAL:
      return "partial";
    case v1::Job::FAILED:
      return "failed";
    case v1::Job::CANCELLED:
      return "cancelled";
    default:
      return "unknown";
  }
}

RemoteJob to_job(const v1::Job& in) {
  RemoteJob out;
  out.id = in.id();
  out.name = printable(in.name(), 256);
  out.client = printable(in.client(), 64);
  out.priority = in.priority();
  out.state = state_of(in.state());
  out.created_ms = in.created_ms();
  out.finished_ms = in.finished_ms();
  out.tasks = in.tasks();
  out.done = in.tasks_done();
  out.running = in.tasks_running();
  out.failed = in.tasks_failed();
  out.reused = in.tasks_reused();
  out.rays = in.rays();
  out.rays_per_second = in.rays_per_second();
  out.workers = in.workers();
  out.revision = in.revision();
  out.error = escape_controls(in.error().substr(0, 1000));
  for (const std::string& bytes : in.outputs()) {
    out.outputs.push_back(to_digest(bytes).value_or(Digest{}));
  }
  return out;
}

/// Tells of a job's states above `revision` until the job, the connection or patience ends, and of nothing new (null) ten
/// times a second.
grpc::Status follow(v1::JobService::Stub* jobs, uint64_t id, uint64_t revision, const CancelFlag& cancel,
                    const std::function<void(const v1::Job*)>& tell) {
  enum Step : intptr_t { kStarted = 1, kRead, kFinished };
  const auto tag = [](Step step) { return reinterpret_cast<void*>(step); };
  v1::WatchJobRequest request;
  request.set_id(id);
  request.set_after_revision(revision);
  grpc::ClientContext context;  // no deadline: a job may take days
  grpc::CompletionQueue queue;
  const auto reader = jobs->PrepareAsyncWatchJob(&context, request, &queue);
  reader->StartCall(tag(kStarted));
  v1::Job job;
  grpc::Status status;
  void* step = nullptr;
  bool ok = false;
  while (step != tag(kFinished)) {
    const auto tick = std::chrono::system_clock::now() + std::chrono::milliseconds(100);
    if (queue.AsyncNext(&step, &ok, tick) != grpc::CompletionQueue::GOT_EVENT) {
      if (cancel.cancelled()) context.TryCancel();
      tell(nullptr);
    } else if (step == tag(kRead) && ok) {
      tell(&job);
      reader->Read(&job, tag(kRead));
    } else if (step == tag(kStarted) && ok) {
      reader->Read(&job, tag(kRead));
    } else if (step != tag(kFinished)) {
      reader->Finish(&status, tag(kFinished));
    }
  }
  queue.Shutdown();
  while (queue.Next(&step, &ok)) {
  }
  return status;
}

}  // namespace

struct FarmClient::Connection {
  Connection(std::shared_ptr<grpc::Channel> to, Patience its_patience)
      : patience(std::move(its_patience)),
        channel(std::move(to)),
        jobs(v1::JobService::NewStub(channel)),
        blobs(channel, patience) {}
  Patience patience;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::JobService::Stub> jobs;
  BlobClient blobs;

  template <class Request, class Response>
  absl::Status call(grpc::Status (v1::JobService::Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                    const Request& request, Response* response) {
    return call_with_retries(
        patience, [&](grpc::ClientContext* context) { return ((*jobs).*method)(context, request, response); });
  }
};

FarmClient::FarmClient(const std::string& server, std::chrono::milliseconds patience, const CancelFlag* cancel)
    : server_(server) {
  Patience p;
  p.total = patience;
  p.call = std::min(p.call, patience);
  if (cancel != nullptr) p.give_up = [cancel] { return cancel->cancelled(); };
  connection_ = std::make_unique<Connection>(dial(server), std::move(p));
}
FarmClient::FarmClient(std::shared_ptr<grpc::Channel> channel, std::string server)
    : server_(std::move(server)), connection_(std::make_unique<Connection>(std::move(channel), Patience())) {}
FarmClient::~FarmClient() = default;

absl::Status FarmClient::in_words(const absl::Status& status) const {
  if (status.ok()) return status;
  if (const auto& gave_up = connection_->patience.give_up; gave_up && gave_up()) {
    return absl::CancelledError("stopped while " + server_ + " was asked");
  }
  if (absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status)) {
    return absl::UnavailableError(server_ + " does not answer (" + std::string(status.message()) +
                                  "); is lightloom-server running there?");
  }
  return absl::Status(status.code(), server_ + ": " + std::string(status.message()));
}

absl::StatusOr<Digest> FarmClient::upload(std::span<const uint8_t> blob) {
  auto digest = connection_->blobs.upload(blob);
  if (!digest.ok()) return in_words(digest.status());
  return digest;
}

absl::Status FarmClient::upload_chunks(const EarlierBake& earlier, std::vector<Digest>* inputs) const {
  std::map<Digest, ChunkRef> chunks;
  for (const ChunkRef& chunk : chunks_of(earlier.manifest)) chunks[chunk.digest] = chunk;
  std::vector<Digest> digests;
  for (const auto& [digest, chunk] : chunks) digests.push_back(digest);
  const auto missing = connection_->blobs.find_missing(digests);
  if (!missing.ok()) return in_words(missing.status());
  const ChunkStore store = chunk_store(earlier.loom);
  constexpr size_t kTogether = 32;
  std::vector<std::vector<uint8_t>> together;
  for (const Digest& digest : *missing) {
    LL_ASSIGN_OR_RETURN(together.emplace_back(), store.get(chunks[digest]));
    if (together.size() < kTogether && digest != missing->back()) continue;
    LL_RETURN_IF_ERROR(in_words(connection_->blobs.upload(together)));
    together.clear();
  }
  inputs->insert(inputs->end(), digests.begin(), digests.end());
  return absl::OkStatus();
}

absl::Status FarmClient::check_server() {
  v1::ServerInfo info;
  LL_RETURN_IF_ERROR(
      in_words(connection_->call(&v1::JobService::Stub::GetServerInfo, v1::GetServerInfoRequest(), &info)));
  if (info.method_version() != kMethodVersion) {
    return absl::FailedPreconditionError(server_ + " bakes by method version '" + printable(info.method_version(), 64) +
                                         "', this program by '" + std::string(kMethodVersion) +
                                         "': install the same release of lightloom on both");
  }
  return absl::OkStatus();
}

absl::StatusOr<RemoteJob> FarmClient::submit(std::span<const uint8_t> scene, const BakeParams& params,
                                             const EarlierBake* earlier, const std::string& name, int32_t priority,
                                             const std::function<void(uint64_t)>& progress) {
  LL_RETURN_IF_ERROR(check_server());  // before the level goes up
  const auto digest = connection_->blobs.upload(scene, progress);
  if (!digest.ok()) return in_words(digest.status());

  std::vector<Digest> inputs{*digest};
  SpawnedTask first = first_task();
  if (earlier != nullptr && !earlier->traces.empty()) {
    LL_RETURN_IF_ERROR(upload_chunks(*earlier, &inputs));
    LL_ASSIGN_OR_RETURN(const Digest traces, upload(earlier->traces));
    inputs.push_back(traces);
    const EarlierResults results{traces, earlier->tolerance};
    first = first_task(&results);
  }
  return submit(random_id(), encode_payload({*digest, params}), first, inputs, name, priority);
}

absl::StatusOr<RemoteJob> FarmClient::submit(const std::string& request_id, std::span<const uint8_t> payload,
                                             const SpawnedTask& first, const std::vector<Digest>& inputs,
                                             const std::string& name, int32_t priority) {
  v1::SubmitRequest request;
  request.set_request_id(request_id);
  const char* user = std::getenv("USER");
  request.set_client(printable(user != nullptr ? user : "", 48));
  request.set_name(printable(name, 200));
  request.set_priority(priority);
  request.set_method_version(std::string(kMethodVersion));
  request.set_payload(payload.data(), payload.size());
  for (const Digest& input : inputs) request.add_inputs(to_bytes(input));
  auto* task = request.add_tasks();
  task->set_kind(first.kind);
  task->set_stage(first.stage);
  task->set_argument(first.argument.data(), first.argument.size());
  task->set_order(first.order);
  v1::Job job;
  LL_RETURN_IF_ERROR(in_words(connection_->call(&v1::JobService::Stub::Submit, request, &job)));
  return to_job(job);
}

absl::StatusOr<RemoteJob> FarmClient::job(uint64_t id) {
  v1::GetJobRequest request;
  request.set_id(id);
  v1::Job job;
  LL_RETURN_IF_ERROR(in_words(connection_->call(&v1::JobService::Stub::GetJob, request, &job)));
  return to_job(job);
}

absl::StatusOr<std::vector<RemoteJob>> FarmClient::jobs() {
  std::vector<RemoteJob> out;
  for (;;) {
    v1::ListJobsRequest request;
    request.set_after(out.empty() ? 0 : out.back().id);
    v1::ListJobsResponse response;
    LL_RETURN_IF_ERROR(in_words(connection_->call(&v1::JobService::Stub::ListJobs, request, &response)));
    if (response.jobs().empty()) return out;
    for (const v1::Job& job : response.jobs()) out.push_back(to_job(job));
  }
}

absl::StatusOr<RemoteJob> FarmClient::cancel(uint64_t id) {
  v1::CancelJobRequest request;
  request.set_id(id);
  v1::Job job;
  LL_RETURN_IF_ERROR(in_words(connection_->call(&v1::JobService::Stub::CancelJob, request, &job)));
  return to_job(job);
}

absl::StatusOr<RemoteJob> FarmClient::set_priority(uint64_t id, int32_t priority) {
  v1::SetPriorityRequest request;
  request.set_id(id);
  request.set_priority(priority);
  v1::Job job;
  LL_RETURN_IF_ERROR(in_words(connection_->call(&v1::JobService::Stub::SetPriority, request, &job)));
  return to_job(job);
}

absl::StatusOr<std::vector<RemoteWorker>> FarmClient::workers() {
  v1::ListWorkersResponse response;
  LL_RETURN_IF_ERROR(
      in_words(connection_->call(&v1::JobService::Stub::ListWorkers, v1::ListWorkersRequest(), &response)));
  std::vector<RemoteWorker> out;
  for (const auto& w : response.workers()) {
    out.push_back(
        {printable(w.id(), 64), printable(w.version(), 64), w.threads(), w.running(), w.silent_ms(), w.draining()});
  }
  return out;
}

absl::StatusOr<std::vector<RemoteEvent>> FarmClient::events(uint64_t job) {
  std::vector<RemoteEvent> out;
  for (;;) {
    v1::ListEventsRequest request;
    request.set_job(job);
    request.set_after(out.empty() ? 0 : out.back().id);
    request.set_limit(1000);
    v1::ListEventsResponse response;
    LL_RETURN_IF_ERROR(in_words(connection_->call(&v1::JobService::Stub::ListEvents, request, &response)));
    if (response.events().empty()) return out;
    for (const auto& e : response.events()) {
      out.push_back({e.id(), e.at_ms(), printable(e.task(), 100), printable(e.worker(), 64),
                     escape_controls(e.what().substr(0, 1100))});
    }
  }
}

absl::StatusOr<RemoteJob> FarmClient::watch(uint64_t id, const CancelFlag& cancel,
                                            const std::function<void(const RemoteJob&)>& changed) {
  RemoteJob last;
  for (;;) {
    // Waits for a server that is not there, or not yet again: the stream has no deadline that would.
    LL_ASSIGN_OR_RETURN(const RemoteJob now, job(id));
    if (now.revision >= last.revision) last = now;
    changed(last);
    if (last.ended()) return last;
    const absl::Status end =
        from_grpc(follow(connection_->jobs.get(), id, last.revision, cancel, [&](const v1::Job* job) {
          if (job != nullptr) last = to_job(*job);
          changed(last);
        }));
    if (last.ended()) return last;
    if (cancel.cancelled()) return absl::CancelledError("stopped watching; the job goes on");
    const bool server_ended = absl::IsUnavailable(end) || absl::IsCancelled(end) || absl::IsUnimplemented(end);
    if (!end.ok() && !server_ended) return in_words(end);
  }
}

absl::Status FarmClient::fetch_chunks(const ChunkStore& store, const std::vector<ChunkRef>& chunks,
                                      const CancelFlag& cancel,
                                      const std::function<void(uint64_t, uint64_t)>& progress) const {
  constexpr int kAtOnce = 8;  // most of the time they wait, for the server or a disk
  FirstError error;
  const auto fetch_one = [&](const ChunkRef& chunk) -> absl::Status {
    if (store.get(chunk).ok()) return absl::OkStatus();
    const auto data = connection_->blobs.download(chunk.digest);
    if (!data.ok()) return in_words(data.status());
    return store.put(*data).status();
  };
  const bool done = parallel_for(chunks.size(), {kAtOnce, &cancel, progress}, [&](uint64_t i) {
    if (error.failed()) return;
    if (const absl::Status status = fetch_one(chunks[i]); !status.ok()) error.note(status);
  });
  LL_RETURN_IF_ERROR(error.status());
  if (done) return absl::OkStatus();
  return absl::CancelledError("fetch cancelled; what is there is kept, so fetch goes on from here");
}

absl::StatusOr<Manifest> FarmClient::fetch(uint64_t id, const std::string& loom, const CancelFlag& cancel,
                                           const std::function<void(uint64_t, uint64_t)>& progress) {
  LL_ASSIGN_OR_RETURN(const RemoteJob job, this->job(id));
  if (job.state != "done" || job.outputs.empty()) {
    return absl::FailedPreconditionError(
        "job " + std::to_string(id) + " of " + server_ + " is " + job.state +
        (job.error.empty() ? "" : " (" + job.error + ")") + "; only what is done can be fetched" +
        (job.ended() ? "" : ": lightloom watch " + std::to_string(id) + " --server " + server_));
  }
  const auto bytes = connection_->blobs.download(job.outputs.front());
  if (!bytes.ok()) return in_words(bytes.status());
  LL_ASSIGN_OR_RETURN(Manifest manifest, decode_manifest(*bytes));
  LL_RETURN_IF_ERROR(fetch_chunks(chunk_store(loom), chunks_of(manifest), cancel, progress));
  std::vector<uint8_t> traces;
  if (job.outputs.size() > 1) {
    auto download = connection_->blobs.download(job.outputs[1]);
    if (!download.ok()) return in_words(download.status());
    traces = *std::move(download);
  }
  LL_RETURN_IF_ERROR(write_manifest(loom, manifest, traces));
  return manifest;
}

}  // namespace lightloom
