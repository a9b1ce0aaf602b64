#include "bake-server/grpc/job_service.h"

#include <condition_variable>
#include <deque>
#include <mutex>

#include "bake-server/grpc/tasks.h"
#include "bake-server/grpc/translate.h"
#include "core/base/text.h"
#include "proto/job_service.grpc.pb.h"

namespace lightloom {
namespace {

constexpr size_t kMaxRequestId = 64, kMaxClient = 64, kMaxName = 256;
constexpr int kMaxInputs = 50'000;  // 1.7 MB: a rebake names all chunks of the earlier asset
constexpr uint32_t kMaxPage = 1000;

v1::Job::State to_proto(JobState state) {
  switch (state) {
    case JobState::kRunning:
      return v1::Job::RUNNING;
    case JobState::kDone:
      return v1::Job::DONE;
    case JobState::kPartial:
      return v1::Job::PARTIAL;
    case JobState::kFailed:
      return v1::Job::FAILED;
    case JobState::kCancelled:
      return v1::Job::CANCELLED;
  }
  return v1::Job::STATE_UNSPECIFIED;
}

void to_proto(const JobStatus& status, v1::Job* out) {
  const Job& job = status.job;
  out->set_id(static_cast<uint64_t>(job.id));
  out->set_name(job.name);
  out->set_client(job.client);
  out->set_priority(job.priority);
  out->set_state(to_proto(job.state));
  out->set_created_ms(job.created_ms);
  out->set_finished_ms(job.finished_ms);
  out->set_tasks(job.tasks);
  out->set_tasks_done(job.done);
  out->set_tasks_running(job.running);
  out->set_tasks_failed(job.failed);
  out->set_tasks_reused(job.reused);
  out->set_rays(status.rays);
  out->set_rays_per_second(status.rays_per_second);
  out->set_workers(status.workers);
  out->set_revision(job.revision);
  out->set_error(job.error);
  for (const Digest& d : job.outputs) out->add_outputs(to_bytes(d));
}

grpc::ServerUnaryReactor* answer(grpc::CallbackServerContext* context, const absl::StatusOr<JobStatus>& job,
                                 v1::Job* response) {
  if (job.ok()) to_proto(*job, response);
  return finish(context, job.status());
}

uint32_t page(uint32_t limit) { return limit == 0 ? 100 : std::min(limit, kMaxPage); }

absl::StatusOr<NewJob> to_job(const v1::SubmitRequest& request, const ServerInfo& info) {
  if (request.method_version() != info.method_version) {
    return absl::FailedPreconditionError("the job asks for method version '" + printable(request.method_version(), 64) +
                                         "', this server bakes by '" + info.method_version +
                                         "': install the same release of lightloom on both");
  }
  if (request.request_id().size() < 16 || request.request_id().size() > kMaxRequestId) {
    return absl::InvalidArgumentError("a request id must have 16 to 64 bytes");
  }
  if (request.client().size() > kMaxClient || request.name().size() > kMaxName) {
    return absl::InvalidArgumentError("a client's name has at most 64 bytes, a job's at most 256");
  }
  if (request.inputs_size() > kMaxInputs) return absl::InvalidArgumentError("a job has at most 50000 inputs");
  NewJob job;
  job.request_id = request.request_id();
  job.client = request.client();
  job.name = request.name();
  job.priority = request.priority();
  job.payload = request.payload();
  for (const std::string& input : request.inputs()) {
    LL_ASSIGN_OR_RETURN(job.inputs.emplace_back(), to_digest(input));
  }
  LL_ASSIGN_OR_RETURN(job.tasks, to_tasks(request.tasks()));
  return job;
}

/// Sends a job's states one after the other: the newest, if the reader is slow.
class Watching final : public grpc::ServerWriteReactor<v1::Job> {
 public:
  Watching(Coordinator* coordinator, const v1::WatchJobRequest& request)
      : coordinator_(coordinator), job_(static_cast<JobId>(request.id())), after_(request.after_revision()) {
    const auto lock = hand_over_.hold();
    shared_->reactor = this;
    StartSendInitialMetadata();
  }

  /// From now on gRPC takes what is written at once, in the thread that writes it.
  void OnSendInitialMetadataDone(bool ok) override {
    hand_over_.hold().unlock();
    if (!ok) return shared_->end(grpc::Status::CANCELLED);
    // The coordinator may call back after the call has ended, so what both touch lives as long as either.
    coordinator_->watch(
        job_, after_, [shared = shared_](const absl::StatusOr<JobStatus>& job) { return shared->changed(job); },
        [shared = shared_] { return shared->over(); });
  }
  void OnWriteDone(bool ok) override {
    const auto lock = hand_over_.hold();
    shared_->written(ok);
  }
  void OnCancel() override {
    const auto lock = hand_over_.hold();
    shared_->end(grpc::Status::CANCELLED);
  }
  void OnDone() override {
    hand_over_.hold().unlock();
    shared_->done();
    delete this;
  }

 private:
  struct Shared {
    std::mutex mutex;
    Watching* reactor = nullptr;  // null: the call has ended, or is about to
    bool writing = false, ending = false;
    std::optional<JobStatus> next;
    grpc::Status last = grpc::Status::OK;
    v1::Job message;

    bool changed(const absl::StatusOr<JobStatus>& job) {
      const std::lock_guard lock(mutex);
      if (reactor == nullptr || ending) return false;
      if (!job.ok()) {
        ending = true;
        last = to_grpc(job.status());
      } else {
        next = *job;
        ending = job->job.state != JobState::kRunning;
      }
      go_on();
      return !ending;
    }
    bool over() {
      const std::lock_guard lock(mutex);
      return reactor == nullptr || ending;
    }
    void written(bool ok) {
      const std::lock_guard lock(mutex);
      writing = false;
      if (!ok) {
        ending = true;
        next.reset();
        last = grpc::Status::CANCELLED;
      }
      go_on();
    }
    void done() { const std::lock_guard lock(mutex); }  // what ended the call is over, too
    void end(const grpc::Status& status) {
      const std::lock_guard lock(mutex);
      ending = true;
      next.reset();
      last = status;
      go_on();
    }
    void go_on() {  // REQUIRES: mutex is held
      if (reactor == nullptr || writing) return;
      if (next) {
        message.Clear();
        to_proto(*next, &message);
        next.reset();
        writing = true;
        reactor->StartWrite(&message);
      } else if (ending) {
        std::exchange(reactor, nullptr)->Finish(last);
      }
    }
  };

  HandOver hand_over_;
  Coordinator* const coordinator_;
  const JobId job_;
  const uint64_t after_;
  const std::shared_ptr<Shared> shared_ = std::make_shared<Shared>();
};

class JobService final : public v1::JobService::CallbackService {
 public:
  JobService(ServerInfo info, Coordinator* coordinator) : info_(std::move(info)), coordinator_(coordinator) {}

  grpc::ServerUnaryReactor* GetServerInfo(grpc::CallbackServerContext* context, const v1::GetServerInfoRequest*,
                                          v1::ServerInfo* response) override {
    response->set_version(info_.version);
    response->set_protocol_version(info_.protocol_version);
    response->set_method_version(info_.method_version);
    return finish(context, absl::OkStatus());
  }

  grpc::ServerUnaryReactor* Submit(grpc::CallbackServerContext* context, const v1::SubmitRequest* request,
                                   v1::Job* response) override {
    const auto job = to_job(*request, info_);
    if (!job.ok()) return finish(context, job.status());
    return answer(context, coordinator_->submit(*job), response);
  }

  grpc::ServerUnaryReactor* GetJob(grpc::CallbackServerContext* context, const v1::GetJobRequest* request,
                                   v1::Job* response) override {
    return answer(context, coordinator_->job(static_cast<JobId>(request->id())), response);
  }

  grpc::ServerUnaryReactor* ListJobs(grpc::CallbackServerContext* context, const v1::ListJobsRequest* request,
                                     v1::ListJobsResponse* response) override {
    const auto jobs = coordinator_->jobs(static_cast<JobId>(request->after()), page(request->limit()));
    if (jobs.ok()) {
      for (const JobStatus& job : *jobs) to_proto(job, response->add_jobs());
    }
    return finish(context, jobs.status());
  }

  grpc::ServerWriteReactor<v1::Job>* WatchJob(grpc::CallbackServerContext*,
                                              const v1::WatchJobRequest* request) override {
    return new Watching(coordinator_, *request);
  }

  grpc::ServerUnaryReactor* CancelJob(grpc::CallbackServerContext* context, const v1::CancelJobRequest* request,
                                      v1::Job* response) override {
    return answer(context, coordinator_->cancel(static_cast<JobId>(request->id())), response);
  }

  grpc::ServerUnaryReactor* SetPriority(grpc::CallbackServerContext* context, const v1::SetPriorityRequest* request,
                                        v1::Job* response) override {
    return answer(context, coordinator_->set_priority(static_cast<JobId>(request->id()), request->priority()),
                  response);
  }

  grpc::ServerUnaryReactor* ListEvents(grpc::CallbackServerContext* context, const v1::ListEventsRequest* request,
                                       v1::ListEventsResponse* response) override {
    const auto events = coordinator_->events(static_cast<JobId>(request->job()), static_cast<int64_t>(request->after()),
                                             page(request->limit()));
    if (!events.ok()) return finish(context, events.status());
    for (const Event& e : *events) {
      auto* out = response->add_events();
      out->set_id(static_cast<uint64_t>(e.id));
      out->set_at_ms(e.at_ms);
      out->set_worker(e.worker);
      out->set_what(e.what);
      if (e.task == 0) continue;
      const auto task = coordinator_->task(e.task);
      if (!task.ok()) return finish(context, task.status());
      out->set_task(task->kind + " " + std::to_string(task->order));
    }
    return finish(context, absl::OkStatus());
  }

  grpc::ServerUnaryReactor* ListWorkers(grpc::CallbackServerContext* context, const v1::ListWorkersRequest*,
                                        v1::ListWorkersResponse* response) override {
    for (const WorkerStatus& w : coordinator_->workers()) {
      auto* out = response->add_workers();
      out->set_id(w.id);
      out->set_version(w.version);
      out->set_threads(w.threads);
      out->set_running(w.running);
      out->set_silent_ms(w.silent_ms);
      out->set_draining(w.draining);
    }
    return finish(context, absl::OkStatus());
  }

 private:
  const ServerInfo info_;
  Coordinator* coordinator_;
};

}  // namespace

std::unique_ptr<grpc::Service> make_job_service(const ServerInfo& info, Coordinator* coordinator) {
  return std::make_unique<JobService>(info, coordinator);
}

}  // namespace lightloom
