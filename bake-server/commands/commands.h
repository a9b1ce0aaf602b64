// What lightloom-server does, one function per command. Errors are one line.
#pragma once

#include <cstdint>
#include <string>

#include "bake-server/farm.h"
#include "core/base/parallel.h"
#include "core/base/status.h"

namespace lightloom {

struct ServeOptions {
  std::string listen = "127.0.0.1:7000", state, database;
  bool insecure = false;
  FarmLimits limits;
};
/// Until SIGINT or SIGTERM.
absl::Status serve(const ServeOptions& options);

/// Prints what it freed.
absl::Status gc(const std::string& state, const std::string& database, int64_t grace_seconds, bool dry_run,
                const CancelFlag& cancel);

/// Prints what it copied. DataLoss: it is there, but blobs are missing.
absl::Status backup(const std::string& state, const std::string& database, const std::string& to,
                    const CancelFlag& cancel);

}  // namespace lightloom
