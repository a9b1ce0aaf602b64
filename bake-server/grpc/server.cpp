#include "bake-server/grpc/server.h"

#include <absl/strings/str_cat.h>
#include <grpc/support/log.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/impl/codegen/service_type.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "bake-server/grpc/blob_service.h"
#include "bake-server/grpc/job_service.h"
#include "bake-server/grpc/worker_service.h"
#include "bake-server/listen_address.h"

namespace lightloom {

namespace {

constexpr int kMaxMessageBytes = 2 << 20;
constexpr std::chrono::seconds kShutdownGrace{1};

/// gRPC prints what it also returns, in many lines: kept for those who debug.
void log_for_debugging(gpr_log_func_args* entry) { spdlog::debug(absl::StrCat("gRPC: ", entry->message)); }

}  // namespace

struct Server::Parts {
  Parts(const ServerInfo& info, Farm* its_farm, grpc::ServerBuilder* builder) : farm(its_farm) {
    gpr_set_log_function(log_for_debugging);
    grpc::EnableDefaultHealthCheckService(true);
    // Without this two servers share a port on Linux, and each gets some of the workers.
    builder->AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
    builder->SetMaxReceiveMessageSize(kMaxMessageBytes);
    services.push_back(make_job_service(info, &farm->coordinator()));
    services.push_back(make_worker_service(info, &farm->coordinator(), &farm->blobs()));
    services.push_back(make_blob_service(&farm->blobs()));
    for (const auto& service : services) builder->RegisterService(service.get());
    server = builder->BuildAndStart();
  }

  Farm* farm;
  std::vector<std::unique_ptr<grpc::Service>> services;
  std::unique_ptr<grpc::Server> server;  // last: it stops before the services that it calls
};

absl::StatusOr<std::unique_ptr<Server>> Server::start(const std::string& address, const ServerInfo& info, Farm* farm,
                                                      bool insecure) {
  LL_RETURN_IF_ERROR(check_listen_address(address, insecure));
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort(address, grpc::InsecureServerCredentials(), &port);
  auto parts = std::make_unique<Parts>(info, farm, &builder);
  if (parts->server == nullptr || port == 0) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", address, ": the port is in use or not allowed: choose another"));
  }
  std::string taken = absl::StrCat(address.substr(0, address.rfind(':')), ":", port);
  return std::unique_ptr<Server>(new Server(std::move(parts), std::move(taken)));
}

absl::StatusOr<std::unique_ptr<Server>> Server::start_in_process(const ServerInfo& info, Farm* farm) {
  grpc::ServerBuilder builder;
  auto parts = std::make_unique<Parts>(info, farm, &builder);
  if (parts->server == nullptr) return absl::InternalError("gRPC does not start in this process; see its log");
  return std::unique_ptr<Server>(new Server(std::move(parts), "in this process"));
}

Server::Server(std::unique_ptr<Parts> parts, std::string address)
    : parts_(std::move(parts)), address_(std::move(address)) {}

Server::~Server() {
  parts_->farm->coordinator().stop();  // calls that wait would hold up the end
  parts_->server->Shutdown(std::chrono::system_clock::now() + kShutdownGrace);
}

std::shared_ptr<grpc::Channel> Server::in_process_channel() { return parts_->server->InProcessChannel({}); }

}  // namespace lightloom
