#include "bake-server/scheduler/admission.h"

#include <absl/strings/str_cat.h>

#include "core/base/text.h"

namespace lightloom {

namespace {
constexpr size_t kShownVersion = 64;  // bytes of a worker's version string that messages repeat
}

Admission admit(const WorkerInfo& worker, const ServerInfo& server) {
  // Written without subtraction: a server of protocol 1 has no predecessor, and 0 means that the field was
  // not sent.
  const bool protocol_fits = worker.protocol_version >= 1 && worker.protocol_version <= server.protocol_version &&
                             worker.protocol_version + 1 >= server.protocol_version;
  if (!protocol_fits) {
    const char* to_upgrade = worker.protocol_version > server.protocol_version ? "server" : "worker";
    return {Refusal::kProtocolVersion,
            absl::StrCat("the worker speaks protocol ", worker.protocol_version, ", the server ",
                         server.protocol_version, ": upgrade the ", to_upgrade)};
  }
  if (worker.method_version != server.method_version) {
    return {Refusal::kMethodVersion,
            absl::StrCat("the worker bakes by method version '", printable(worker.method_version, kShownVersion),
                         "', the server asks for '", server.method_version,
                         "': install the same release of lightloom on both")};
  }
  if (!worker.avx2) {
    return {Refusal::kMissingAvx2,
            "the worker's CPU lacks AVX2 (x86-64-v3), and without it its results would differ in their last "
            "bits: "
            "run the worker on another machine"};
  }
  if (worker.threads == 0) {
    return {Refusal::kNoThreads, "the worker offers no threads: start it with --threads 1 or more"};
  }
  if (server.canary && worker.canary != server.canary) {
    return {Refusal::kCanary,
            absl::StrCat("a tiny known bake has other bytes there (",
                         worker.canary ? worker.canary->hex().substr(0, 12) : "none", ") than it must (",
                         server.canary->hex().substr(0, 12),
                         "): install the server's release of lightloom, and if that is so, do not use "
                         "this machine")};
  }
  return {};
}

}  // namespace lightloom
