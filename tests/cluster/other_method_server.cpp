// A server whose bakes follow another method: what clients and workers of this release meet after half an upgrade.
// Arguments: the state folder.
#include <cstdio>
#include <string>

#include "bake-server/grpc/server.h"
#include "core/base/stop_signal.h"
#include "core/base/version.h"
#include "proto/protocol_version.h"

int main(int argc, char** argv) {
  using namespace lightloom;
  if (argc != 2) return 2;
  StopSignal stop;
  const auto farm = Farm::open(argv[1]);
  if (!farm.ok()) return 1;
  ServerInfo info;
  info.version = std::string(kVersion);
  info.protocol_version = kProtocolVersion;
  info.method_version = "another";
  const auto server = Server::start("127.0.0.1:0", info, farm->get());
  if (!server.ok()) return 1;
  std::printf("listening on %s\n", (*server)->address().c_str());
  std::fflush(stdout);
  stop.wait();
  return 0;
}
