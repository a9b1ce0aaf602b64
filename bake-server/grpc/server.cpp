#include "bake-server/grpc/server.h"

#include <absl/strings/str_cat.h>
#include <grpc/support/log.h>
#include <grpcpp/grpcpp.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "bake-server/listen_address.h"
#include "core/base/text.h"
#include "proto/job_service.grpc.pb.h"
#include "proto/worker_service.grpc.pb.h"

namespace lightloom {

namespace {

constexpr int kMaxMessageBytes = 2 << 20;
constexpr std::chrono::seconds kShutdownGrace{1};

class JobService final : public v1::JobService::CallbackService {
 public:
  explicit JobService(ServerInfo info) : info_(std::move(info)) {}

  grpc::ServerUnaryReactor* GetServerInfo(grpc::CallbackServerContext* context, const v1::GetServerInfoRequest*,
                                          v1::ServerInfo* response) override {
    response->set_version(info_.version);
    response->set_protocol_version(info_.protocol_version);
    response->set_method_version(info_.method_version);
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    reactor->Finish(grpc::Status::OK);
    return reactor;
  }

 private:
  const ServerInfo info_;
};

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
    case Refusal::kNone:
      break;
  }
  return Refused::REASON_UNSPECIFIED;
}

class WorkerService final : public v1::WorkerService::CallbackService {
 public:
  explicit WorkerService(ServerInfo info) : info_(std::move(info)) {}

  grpc::ServerUnaryReactor* Join(grpc::CallbackServerContext* context, const v1::JoinRequest* request,
                                 v1::JoinResponse* response) override {
    const WorkerInfo worker{.protocol_version = request->protocol_version(),
                            .method_version = request->method_version(),
                            .avx2 = request->avx2(),
                            .threads = request->threads()};
    const Admission admission = admit(worker, info_);
    if (admission.accepted()) {
      spdlog::info("worker {} joined: version {}, {} threads", context->peer(), printable(request->version(), 64),
                   worker.threads);
      response->mutable_accepted()->set_server_version(info_.version);
    } else {
      spdlog::warn("worker {} refused: {}", context->peer(), admission.message);
      response->mutable_refused()->set_reason(to_proto(admission.refusal));
      response->mutable_refused()->set_message(admission.message);
    }
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    reactor->Finish(grpc::Status::OK);
    return reactor;
  }

 private:
  const ServerInfo info_;
};

/// gRPC prints what it also returns, in many lines: kept for those who debug.
void log_for_debugging(gpr_log_func_args* entry) { spdlog::debug("gRPC: {}", entry->message); }

}  // namespace

struct Server::Parts {
  explicit Parts(const ServerInfo& info) : job_service(info), worker_service(info) {}

  JobService job_service;
  WorkerService worker_service;
  std::unique_ptr<grpc::Server> server;  // last: it stops before the services that it calls
};

absl::StatusOr<std::unique_ptr<Server>> Server::start(const std::string& address, const ServerInfo& info) {
  LL_RETURN_IF_ERROR(check_listen_address(address));
  gpr_set_log_function(log_for_debugging);
  auto parts = std::make_unique<Parts>(info);
  grpc::EnableDefaultHealthCheckService(true);
  grpc::ServerBuilder builder;
  // Without this two servers share a port on Linux, and each gets some of the workers.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.SetMaxReceiveMessageSize(kMaxMessageBytes);
  builder.RegisterService(&parts->job_service);
  builder.RegisterService(&parts->worker_service);
  int port = 0;
  builder.AddListeningPort(address, grpc::InsecureServerCredentials(), &port);
  parts->server = builder.BuildAndStart();
  if (parts->server == nullptr || port == 0) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", address, ": the port is in use or not allowed: choose another"));
  }
  std::string taken = absl::StrCat(address.substr(0, address.rfind(':')), ":", port);
  return std::unique_ptr<Server>(new Server(std::move(parts), std::move(taken)));
}

Server::Server(std::unique_ptr<Parts> parts, std::string address)
    : parts_(std::move(parts)), address_(std::move(address)) {}

Server::~Server() { parts_->server->Shutdown(std::chrono::system_clock::now() + kShutdownGrace); }

std::shared_ptr<grpc::Channel> Server::in_process_channel() { return parts_->server->InProcessChannel({}); }

}  // namespace lightloom
