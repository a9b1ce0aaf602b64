#include "bake-server/grpc/worker_service.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include "bake-server/grpc/tasks.h"
#include "bake-server/grpc/translate.h"
#include "core/base/text.h"
#include "proto/worker_name.h"
#include "proto/worker_service.grpc.pb.h"

namespace lightloom {
namespace {

constexpr uint32_t kMaxWaitMs = 30'000, kMaxRoom = 4096;
constexpr size_t kMaxReasonBytes = 1024;
constexpr uint64_t kMaxTaskListBytes = uint64_t{256} << 20;

v1::JoinResponse::Refused::Reason to_proto(Refusal refusal) {
  using Refused = v1::JoinResponse::Refused;
  switch (refusal) {
    case Refusal::kProtocolVersion:
      return Refused::PROTOCOL_VERSION;
    case Refusal::kMethodVersion:
      return Refused::METHOD_VERSION;
    case Refusal::kMissingAvx2:
      return Refused::MISSING_AVX2;
    case Refusal::kNoThreads:
      return Refused::NO_THREADS;
    case Refusal::kCanary:
      return Refused::CANARY;
    case Refusal::kNone:
      break;
  }
  return Refused::REASON_UNSPECIFIED;
}

Admission admit(const v1::JoinRequest& request, const ServerInfo& info) {
  const auto canary = to_digest(request.canary());
  return lightloom::admit({.protocol_version = request.protocol_version(),
                           .method_version = request.method_version(),
                           .avx2 = request.avx2(),
                           .threads = request.threads(),
                           .canary = canary.ok() ? std::optional(*canary) : std::nullopt},
                          info);
}

/// What a finished task asks for. NotFound and InvalidArgument are the task's fault, others the server's.
absl::StatusOr<std::vector<NewTask>> tasks_of(const v1::SyncRequest::Finished& finished, const BlobStore& blobs) {
  if (finished.tasks_blob().empty()) return to_tasks(finished.tasks());
  LL_ASSIGN_OR_RETURN(const Digest digest, to_digest(finished.tasks_blob()));
  LL_ASSIGN_OR_RETURN(const uint64_t size, blobs.size(digest));
  if (size > kMaxTaskListBytes) {
    return absl::InvalidArgumentError("its list of tasks has " + std::to_string(size) + " bytes, the limit is " +
                                      std::to_string(kMaxTaskListBytes) +
                                      "; make tasks larger, so that they are fewer");
  }
  LL_ASSIGN_OR_RETURN(const std::vector<uint8_t> bytes, blobs.read(digest, 0, size));
  v1::TaskList list;
  if (!list.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return absl::InvalidArgumentError("blob " + digest.hex() + " is no list of tasks");
  }
  return to_tasks(list.tasks());
}

absl::StatusOr<SyncMessage> to_message(const v1::SyncRequest& request, const BlobStore& blobs) {
  if (!is_worker_name(request.worker())) return absl::InvalidArgumentError(kWorkerNameRule);
  SyncMessage out;
  out.worker = request.worker();
  out.version = printable(request.who().version(), 64);
  out.threads = request.who().threads();
  out.incarnation = request.incarnation();
  out.sequence = request.sequence();
  out.seen = request.seen();
  out.room = std::min(request.room(), kMaxRoom);
  out.wait_ms = std::min(request.wait_ms(), kMaxWaitMs);
  out.draining = request.draining();
  for (const auto& r : request.running()) out.running.push_back({r.attempt(), r.rays()});
  for (const auto& f : request.finished()) {
    SyncMessage::Finished finished{f.attempt(), {}, {}, f.rays()};
    for (const std::string& d : f.outputs()) {
      LL_ASSIGN_OR_RETURN(finished.outputs.emplace_back(), to_digest(d));
    }
    auto tasks = tasks_of(f, blobs);
    if (absl::IsNotFound(tasks.status()) || absl::IsInvalidArgument(tasks.status())) {
      out.failed.push_back({f.attempt(), std::string(tasks.status().message())});
      continue;
    }
    LL_RETURN_IF_ERROR(tasks.status());
    finished.tasks = *std::move(tasks);
    out.finished.push_back(std::move(finished));
  }
  for (const auto& f : request.failed()) {
    out.failed.push_back({f.attempt(), escape_controls(f.reason().substr(0, kMaxReasonBytes))});  // keeps its quotes
  }
  out.released.assign(request.released().begin(), request.released().end());
  return out;
}

void to_proto(const SyncAnswer& answer, v1::SyncResponse* out) {
  out->set_sequence(answer.sequence);
  out->set_lease_ms(answer.lease_ms);
  for (const std::string& a : answer.acknowledged) out->add_acknowledged(a);
  for (const std::string& a : answer.lost) out->add_lost(a);
  for (const std::string& payload : answer.warm) out->add_warm(payload);
  for (const Assignment& a : answer.assignments) {
    auto* to = out->add_assignments();
    to->set_attempt(a.attempt);
    to->set_job(static_cast<uint64_t>(a.job));
    to->set_payload(a.payload);
    to->set_kind(a.kind);
    to->set_argument(a.argument);
    to->set_priority(a.priority);
    if (a.inputs) to->set_inputs(to_bytes(*a.inputs));
  }
}

/// A Sync that is answered later, from the coordinator's thread.
class Syncing final : public grpc::ServerUnaryReactor {
 public:
  Syncing(Coordinator* coordinator, SyncMessage message, v1::SyncResponse* response)
      : coordinator_(coordinator), message_(std::move(message)), response_(response) {
    const auto lock = hand_over_.hold();
    StartSendInitialMetadata();
  }
  /// From now on gRPC takes the answer at once, in the thread that gives it.
  void OnSendInitialMetadataDone(bool) override {
    auto lock = hand_over_.hold();
    SyncMessage message = std::move(message_);
    lock.unlock();  // the answer may come from within
    coordinator_->sync(std::move(message), [this](const absl::StatusOr<SyncAnswer>& a) { answer(a); });
  }
  void answer(const absl::StatusOr<SyncAnswer>& answer) {
    const auto lock = hand_over_.hold();
    if (answer.ok()) to_proto(*answer, response_);
    Finish(to_grpc(answer.status()));
  }
  void OnDone() override {
    hand_over_.hold().unlock();
    delete this;
  }

 private:
  HandOver hand_over_;
  Coordinator* const coordinator_;
  SyncMessage message_;
  v1::SyncResponse* response_;
};

class WorkerService final : public v1::WorkerService::CallbackService {
 public:
  WorkerService(ServerInfo info, Coordinator* coordinator, const BlobStore* blobs)
      : info_(std::move(info)), coordinator_(coordinator), blobs_(*blobs) {}

  grpc::ServerUnaryReactor* Join(grpc::CallbackServerContext* context, const v1::JoinRequest* request,
                                 v1::JoinResponse* response) override {
    const Admission admission = admit(*request, info_);
    if (admission.accepted()) {
      spdlog::info(absl::StrCat("worker ", context->peer(), " joined: version ", printable(request->version(), 64),
                                ", ", request->threads(), " threads"));
      response->mutable_accepted()->set_server_version(info_.version);
    } else {
      spdlog::warn(absl::StrCat("worker ", context->peer(), " refused: ", admission.message));
      response->mutable_refused()->set_reason(to_proto(admission.refusal));
      response->mutable_refused()->set_message(admission.message);
    }
    return finish(context, absl::OkStatus());
  }

  grpc::ServerUnaryReactor* Sync(grpc::CallbackServerContext* context, const v1::SyncRequest* request,
                                 v1::SyncResponse* response) override {
    // A server of another release may have taken this one's place since the worker joined.
    const Admission admission = admit(request->who(), info_);
    if (!admission.accepted()) return finish(context, absl::FailedPreconditionError(admission.message));
    auto message = to_message(*request, blobs_);
    if (!message.ok()) return finish(context, message.status());
    return new Syncing(coordinator_, *std::move(message), response);
  }

 private:
  const ServerInfo info_;
  Coordinator* coordinator_;
  const BlobStore& blobs_;
};

}  // namespace

std::unique_ptr<grpc::Service> make_worker_service(const ServerInfo& info, Coordinator* coordinator,
                                                   const BlobStore* blobs) {
  return std::make_unique<WorkerService>(info, coordinator, blobs);
}

}  // namespace lightloom
