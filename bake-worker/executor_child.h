// The executor child's side: takes tasks from the supervisor over a socket, runs them, answers.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "bake-worker/executor.h"

namespace lightloom {

/// What the supervisor asks of its child.
struct ExecutorConfig {
  std::string server;         ///< HOST:PORT, for blobs
  uint32_t threads = 1;       ///< tasks that compute at once
  uint64_t cache_bytes = 0;   ///< levels that are kept warm
  uint64_t memory_bytes = 0;  ///< that it may write to; 0: no limit
};

/// Serves the supervisor that started this process (ChildExecutor) with what `make` gives, and ends the process when the
/// supervisor is gone. Returns an exit code if there never was one.
int serve_executor(const std::function<std::unique_ptr<TaskExecutor>(const ExecutorConfig&)>& make);

/// serve_executor() with a LocalExecutor: what `lightloom-worker executor` is.
int executor_main();

}  // namespace lightloom
