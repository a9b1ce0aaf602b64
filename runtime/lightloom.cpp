// The C boundary: checks arguments, turns statuses into results, lets no exception out.
#include "runtime/include/lightloom.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <new>
#include <span>
#include <string>

#include "runtime/runtime.h"

struct lightloom_runtime {
  std::unique_ptr<lightloom::Runtime> impl;
};

namespace lightloom {
namespace {

/// Which status code stands for which result, in all of runtime/ and in core/asset.
lightloom_result result_of(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return LIGHTLOOM_OK;
    case absl::StatusCode::kInvalidArgument:
      return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
    case absl::StatusCode::kNotFound:
      return LIGHTLOOM_ERROR_NO_DEVICE;
    case absl::StatusCode::kOutOfRange:
      return LIGHTLOOM_ERROR_MISSING_FEATURE;
    case absl::StatusCode::kResourceExhausted:
      return LIGHTLOOM_ERROR_OUT_OF_MEMORY;
    case absl::StatusCode::kDataLoss:
      return LIGHTLOOM_ERROR_CORRUPT_ASSET;
    case absl::StatusCode::kUnimplemented:
      return LIGHTLOOM_ERROR_UNSUPPORTED_ASSET;
    case absl::StatusCode::kAborted:
      return LIGHTLOOM_ERROR_READ_FAILED;
    case absl::StatusCode::kFailedPrecondition:
      return LIGHTLOOM_ERROR_NO_ASSET;
    case absl::StatusCode::kUnavailable:
      return LIGHTLOOM_ERROR_DEVICE_LOST;
    default:
      return LIGHTLOOM_ERROR_INTERNAL;
  }
}

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

/// As guarded(), for functions that need an asset; `body` takes the runtime.
template <class Body>
lightloom_result with_asset(const lightloom_runtime* runtime, Body body) noexcept {
  if (runtime == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  return guarded(runtime->impl->messages(), [&]() -> absl::Status {
    if (runtime->impl->asset() == nullptr) {
      return absl::FailedPreconditionError("no asset is loaded; call lightloom_load first");
    }
    return body(*runtime->impl);
  });
}

absl::Status check_array(const void* rgb, uint64_t elements, const GpuAsset& asset) {
  if (rgb == nullptr) return absl::InvalidArgumentError("the array is null");
  if (elements != asset.counts().surface_elements) {
    return absl::InvalidArgumentError("array has " + std::to_string(elements) + " elements, the asset " +
                                      std::to_string(asset.counts().surface_elements) + " surface elements");
  }
  return absl::OkStatus();
}

/// Feedback would keep a NaN for ever, and an albedo above 1 grows without bound.
absl::Status check_values(const char* what, std::span<const float> rgb, float lowest, float highest) {
  for (size_t i = 0; i < rgb.size(); ++i) {
    if (!std::isfinite(rgb[i]) || rgb[i] < lowest || rgb[i] > highest) {
      return absl::InvalidArgumentError(std::string(what) + " of element " + std::to_string(i / 3) + " is " +
                                        std::to_string(rgb[i]) + "; give a finite value in range");
    }
  }
  return absl::OkStatus();
}

lightloom_result set_array(lightloom_runtime* runtime, SurfaceArray array, const char* what, const float* rgb,
                           uint64_t elements, float lowest, float highest) {
  return with_asset(runtime, [&](Runtime& r) -> absl::Status {
    LL_RETURN_IF_ERROR(check_array(rgb, elements, *r.asset()));
    const std::span<const float> values(rgb, elements * 3);
    LL_RETURN_IF_ERROR(check_values(what, values, lowest, highest));
    return r.set(array, values);
  });
}

/// Copies as much of `from` as the caller's struct holds.
template <class T>
absl::Status fill(const T& from, T* to) {
  if (to == nullptr || to->struct_size < sizeof(uint32_t)) {
    return absl::InvalidArgumentError("the output is null or its struct_size is not set");
  }
  const uint32_t size = to->struct_size;
  std::memcpy(to, &from, std::min<size_t>(size, sizeof(T)));
  to->struct_size = size;
  return absl::OkStatus();
}

constexpr float kMax = 3.402823466e38f;

}  // namespace
}  // namespace lightloom

using lightloom::guarded;
using lightloom::with_asset;

extern "C" {

const char* lightloom_result_string(lightloom_result result) {
  switch (result) {
    case LIGHTLOOM_OK:
      return "ok";
    case LIGHTLOOM_ERROR_INVALID_ARGUMENT:
      return "invalid argument";
    case LIGHTLOOM_ERROR_NO_DEVICE:
      return "no Vulkan device";
    case LIGHTLOOM_ERROR_MISSING_FEATURE:
      return "the device or a layer lacks a feature";
    case LIGHTLOOM_ERROR_OUT_OF_MEMORY:
      return "out of memory";
    case LIGHTLOOM_ERROR_CORRUPT_ASSET:
      return "corrupt asset";
    case LIGHTLOOM_ERROR_UNSUPPORTED_ASSET:
      return "unsupported asset";
    case LIGHTLOOM_ERROR_READ_FAILED:
      return "a chunk could not be read";
    case LIGHTLOOM_ERROR_NO_ASSET:
      return "no asset is loaded";
    case LIGHTLOOM_ERROR_DEVICE_LOST:
      return "device lost";
    case LIGHTLOOM_ERROR_INTERNAL:
      return "internal error";
  }
  return "unknown result";
}

uint32_t lightloom_version(void) {
  return LIGHTLOOM_VERSION_MAJOR << 22 | LIGHTLOOM_VERSION_MINOR << 12 | LIGHTLOOM_VERSION_PATCH;
}

lightloom_result lightloom_create(const lightloom_create_info* info, lightloom_runtime** out) {
  if (out == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  *out = nullptr;
  if (info == nullptr || info->struct_size < sizeof(lightloom_create_info)) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  lightloom::RuntimeOptions options;
  options.messages = {info->message, info->message_user};
  return guarded(options.messages, [&]() -> absl::Status {
    constexpr uint32_t kKnown = LIGHTLOOM_CREATE_VALIDATION | LIGHTLOOM_CREATE_FORCE_STAGING;
    if ((info->flags & ~kKnown) != 0 || info->reserved != 0) {
      return absl::InvalidArgumentError("lightloom_create_info has unknown flags or a reserved field that is not 0");
    }
    options.validation = (info->flags & LIGHTLOOM_CREATE_VALIDATION) != 0;
    options.force_staging = (info->flags & LIGHTLOOM_CREATE_FORCE_STAGING) != 0;
    options.page_bytes = info->page_bytes;
    options.max_groups = info->max_workgroups;
    auto runtime = std::make_unique<lightloom_runtime>();
    LL_ASSIGN_OR_RETURN(runtime->impl, lightloom::Runtime::create(options));
    *out = runtime.release();
    return absl::OkStatus();
  });
}

void lightloom_destroy(lightloom_runtime* runtime) { delete runtime; }

lightloom_result lightloom_load(lightloom_runtime* runtime, const lightloom_asset_info* info) {
  if (runtime == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  return guarded(runtime->impl->messages(), [&]() -> absl::Status {
    if (info == nullptr || info->struct_size < sizeof(lightloom_asset_info) || info->manifest == nullptr ||
        info->read_chunk == nullptr || info->reserved != 0) {
      return absl::InvalidArgumentError("lightloom_asset_info is null, its struct_size is wrong or a field is missing");
    }
    const auto read = [info](const lightloom::ChunkRef& ref, std::span<uint8_t> bytes) -> absl::Status {
      if (info->read_chunk(info->read_user, ref.digest.bytes.data(), ref.size, bytes.data()) == 0) {
        return absl::OkStatus();
      }
      return absl::AbortedError("chunk " + ref.digest.hex() + " could not be read; is the asset complete?");
    };
    return runtime->impl->load({static_cast<const uint8_t*>(info->manifest), info->manifest_bytes}, read);
  });
}

void lightloom_unload(lightloom_runtime* runtime) {
  if (runtime != nullptr) runtime->impl->unload();
}

lightloom_result lightloom_get_counts(const lightloom_runtime* runtime, lightloom_counts* counts) {
  return with_asset(runtime, [&](const lightloom::Runtime& r) {
    const auto& c = r.asset()->counts();
    return lightloom::fill(lightloom_counts{sizeof(lightloom_counts), c.surface_elements, c.receivers, c.probes,
                                            c.cells, c.clusters, c.pages, c.order, c.gpu_bytes},
                           counts);
  });
}

lightloom_result lightloom_set_direct(lightloom_runtime* runtime, const float* rgb, uint64_t elements) {
  return lightloom::set_array(runtime, lightloom::SurfaceArray::kDirect, "direct irradiance", rgb, elements,
                              -lightloom::kMax, lightloom::kMax);
}
lightloom_result lightloom_set_albedo(lightloom_runtime* runtime, const float* rgb, uint64_t elements) {
  return lightloom::set_array(runtime, lightloom::SurfaceArray::kAlbedo, "albedo", rgb, elements, 0, 1);
}
lightloom_result lightloom_set_emission(lightloom_runtime* runtime, const float* rgb, uint64_t elements) {
  return lightloom::set_array(runtime, lightloom::SurfaceArray::kEmission, "emission", rgb, elements, -lightloom::kMax,
                              lightloom::kMax);
}
lightloom_result lightloom_set_environment(lightloom_runtime* runtime, const float rgb[3]) {
  return with_asset(runtime, [&](lightloom::Runtime& r) -> absl::Status {
    if (rgb == nullptr) return absl::InvalidArgumentError("the environment is null");
    LL_RETURN_IF_ERROR(lightloom::check_values("environment", {rgb, 3}, -lightloom::kMax, lightloom::kMax));
    r.set_environment({rgb[0], rgb[1], rgb[2]});
    return absl::OkStatus();
  });
}

lightloom_result lightloom_update(lightloom_runtime* runtime, uint32_t iterations) {
  return with_asset(runtime, [&](lightloom::Runtime& r) { return r.update(iterations); });
}

lightloom_result lightloom_read_irradiance(lightloom_runtime* runtime, float* rgb, uint64_t elements) {
  return with_asset(runtime, [&](lightloom::Runtime& r) -> absl::Status {
    LL_RETURN_IF_ERROR(lightloom::check_array(rgb, elements, *r.asset()));
    return r.read_irradiance({rgb, elements * 3});
  });
}

lightloom_result lightloom_reset_feedback(lightloom_runtime* runtime) {
  return with_asset(runtime, [&](lightloom::Runtime& r) { return r.reset_feedback(); });
}

lightloom_result lightloom_get_stats(const lightloom_runtime* runtime, lightloom_stats* stats) {
  return with_asset(runtime, [&](const lightloom::Runtime& r) {
    const auto& s = r.stats();
    const auto& c = r.asset()->counts();
    const auto& ms = s.milliseconds;
    return lightloom::fill(lightloom_stats{sizeof(lightloom_stats), s.frames, s.timestamps ? 1u : 0u, 0, ms[0], ms[1],
                                           ms[2], ms[3], c.relight_bytes, c.project_bytes, c.receive_bytes},
                           stats);
  });
}

}  // extern "C"
