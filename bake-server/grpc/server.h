// The coordinator's gRPC face. It translates messages and calls the scheduler; it decides nothing.
#pragma once

#include <memory>
#include <string>

#include "bake-server/farm.h"
#include "bake-server/scheduler/admission.h"
#include "core/base/status.h"

namespace grpc {
class Channel;
}

namespace lightloom {

/// A running server: JobService, WorkerService, BlobService and gRPC's standard health service. Thread-safe.
class Server {
 public:
  /// Listens on `address` (see check_listen_address, also for `insecure`; port 0 takes a free one), serves until
  /// destroyed. Errors: a bad address, a port in use. `farm` must outlive the server, whose end stops its coordinator.
  static absl::StatusOr<std::unique_ptr<Server>> start(const std::string& address, const ServerInfo& info, Farm* farm,
                                                       bool insecure = false);

  /// Serves this process only, by in_process_channel().
  static absl::StatusOr<std::unique_ptr<Server>> start_in_process(const ServerInfo& info, Farm* farm);

  /// Calls that still run get a second to end, then they are cancelled.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Where it listens, with the port that was taken.
  const std::string& address() const { return address_; }
  /// A connection from inside this process, past the network stack.
  std::shared_ptr<grpc::Channel> in_process_channel();

 private:
  struct Parts;
  Server(std::unique_ptr<Parts> parts, std::string address);

  std::unique_ptr<Parts> parts_;
  std::string address_;
};

}  // namespace lightloom
