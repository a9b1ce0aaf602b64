// The C boundary: what every extern "C" function does first and last. No exception gets out.
#pragma once

#include <algorithm>
#include <cstring>
#include <memory>
#include <new>
#include <string>

#include "core/base/status.h"
#include "runtime/backend.h"
#include "runtime/host_memory.h"
#include "runtime/messages.h"

struct lightloom_runtime {
  explicit lightloom_runtime(const lightloom_allocator& allocator, lightloom::Messages m)
      : memory(allocator), messages(m) {}
  lightloom::HostMemory memory;
  lightloom::Messages messages;
  std::unique_ptr<lightloom::Backend> backend;
};

namespace lightloom {

/// Payload that tells the results apart which share a status code with others.
inline constexpr const char* kOverBudget = "lightloom/over_budget";
inline constexpr const char* kNotReady = "lightloom/not_ready";
inline constexpr const char* kUnknownChunk = "lightloom/unknown_chunk";
absl::Status over_budget(const std::string& message);
absl::Status not_ready(const std::string& message);
absl::Status unknown_chunk(const std::string& message);
absl::Status unreadable_chunk(const ChunkRef& ref);

/// Which status stands for which result, in all of runtime/ and in core/asset.
lightloom_result result_of(const absl::Status& status);

/// Runs `body`, which returns an absl::Status, and reports what went wrong.
template <class Body>
lightloom_result guarded(const Messages& messages, Body body) noexcept {
  try {
    absl::Status status;
    try {
      status = body();
    } catch (const std::bad_alloc&) {
      status = absl::ResourceExhaustedError("out of host memory; unload something, or bake a smaller asset");
    } catch (const std::exception& e) {
      status = absl::InternalError(e.what());
    }
    if (!status.ok()) messages.send(LIGHTLOOM_MESSAGE_ERROR, std::string(status.message()));
    return result_of(status);
  } catch (...) {  // no memory for the message
    return LIGHTLOOM_ERROR_OUT_OF_MEMORY;
  }
}

/// As guarded(), for functions that need an asset; `body` takes the backend.
template <class Body>
lightloom_result with_asset(lightloom_runtime* runtime, Body body) noexcept {
  if (runtime == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  return guarded(runtime->messages, [&]() -> absl::Status {
    if (!runtime->backend->loaded()) {
      return absl::FailedPreconditionError("no asset is loaded; call lightloom_load or lightloom_load_manifest first");
    }
    return body(*runtime->backend);
  });
}

/// Copies as much of `from` as the caller's struct holds.
template <class T>
absl::Status fill(T from, T* to) {
  if (to == nullptr || to->struct_size < sizeof(uint32_t)) {
    return absl::InvalidArgumentError("the output is null or its struct_size is not set");
  }
  from.struct_size = to->struct_size;
  std::memcpy(to, &from, std::min<size_t>(to->struct_size, sizeof(T)));
  return absl::OkStatus();
}

/// Makes a runtime; `make` fills its backend.
template <class Make>
lightloom_result make_runtime(const lightloom_allocator& allocator, Messages messages, lightloom_runtime** out,
                              Make make) noexcept {
  *out = nullptr;
  return guarded(messages, [&]() -> absl::Status {
    if ((allocator.allocate == nullptr) != (allocator.release == nullptr)) {
      return absl::InvalidArgumentError("lightloom_allocator has one function of two; give both or none");
    }
    HostMemory memory(allocator);
    void* place = memory.allocate(sizeof(lightloom_runtime), alignof(lightloom_runtime));
    auto* runtime = new (place) lightloom_runtime(allocator, messages);
    absl::Status status;
    try {
      status = make(runtime);
    } catch (...) {
      lightloom_destroy(runtime);
      throw;
    }
    if (!status.ok()) {
      lightloom_destroy(runtime);
      return status;
    }
    *out = runtime;
    return absl::OkStatus();
  });
}

}  // namespace lightloom
