// Whether a worker that dials in may bake here. Pure: no clock, no network, no state.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/hash.h"

namespace lightloom {

/// What a worker says of itself. From outside: nothing is checked yet.
struct WorkerInfo {
  uint32_t protocol_version = 0;
  std::string method_version;
  bool avx2 = false;
  uint32_t threads = 0;
  std::optional<Digest> canary = std::nullopt;  ///< what it gives for a known bake, if it says so
};

/// What the server is, and asks of its workers.
struct ServerInfo {
  std::string version;            ///< the release, for people
  uint32_t protocol_version = 0;  ///< the newest it speaks; it speaks the one before, too
  std::string method_version;
  std::optional<Digest> canary = std::nullopt;  ///< what a worker must give for a known bake; none: any
};

enum class Refusal { kNone, kProtocolVersion, kMethodVersion, kMissingAvx2, kNoThreads, kCanary };

struct Admission {
  Refusal refusal = Refusal::kNone;
  std::string message;  ///< why it was refused and how to mend it, one line; empty if accepted

  bool accepted() const { return refusal == Refusal::kNone; }
};

/// The first thing that does not fit decides, in the order of Refusal.
Admission admit(const WorkerInfo& worker, const ServerInfo& server);

}  // namespace lightloom
