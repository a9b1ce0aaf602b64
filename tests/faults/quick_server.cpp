// A server whose leases are short, so that tests of its faults need not wait long for their end. Workers speak once a
// second.
// Arguments: the state folder, and, if given, HOST:PORT to listen on and PostgreSQL's address.
#include <cstdio>
#include <string>

#include "bake-server/grpc/server.h"
#include "core/base/stop_signal.h"
#include "core/base/version.h"
#include "proto/protocol_version.h"

namespace {

int failed(const absl::Status& status) {
  std::fprintf(stderr, "quick_server: %s\n", std::string(status.message()).c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace lightloom;
  if (argc < 2 || argc > 4) return 2;
  StopSignal stop;
  CoordinatorOptions options;
  options.dispatch.lease_ms = 2'500;
  const auto farm = Farm::open(argv[1], options, Durability::kPowerLoss, {}, argc > 3 ? argv[3] : "");
  if (!farm.ok()) return failed(farm.status());
  ServerInfo info;
  info.version = std::string(kVersion);
  info.protocol_version = kProtocolVersion;
  info.method_version = std::string(kMethodVersion);
  const auto server = Server::start(argc > 2 ? argv[2] : "127.0.0.1:0", info, farm->get(), /*insecure=*/true);
  if (!server.ok()) return failed(server.status());
  std::printf("listening on %s\n", (*server)->address().c_str());
  std::fflush(stdout);
  stop.wait();
  return 0;
}
