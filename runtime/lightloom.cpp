// The functions of lightloom.h but for lightloom_create: they check arguments and hand on to the backend.
#include "runtime/include/lightloom.h"

#include <cmath>
#include <span>
#include <string>

#include "runtime/asset_source.h"
#include "runtime/boundary.h"

namespace lightloom {
namespace {

absl::Status marked(absl::Status status, const char* payload) {
  status.SetPayload(payload, {});
  return status;
}

absl::Status check_range(const void* rgb, uint64_t first, uint64_t count, const Backend& backend) {
  if (rgb == nullptr && count > 0) return absl::InvalidArgumentError("the array is null");
  const uint64_t elements = backend.index().surface_elements();
  if (first > elements || count > elements - first) {
    return absl::InvalidArgumentError("elements " + std::to_string(first) + " and " + std::to_string(count) +
                                      " on are set, the asset has " + std::to_string(elements));
  }
  return absl::OkStatus();
}

/// Feedback would keep a NaN for ever, and an albedo above 1 grows without bound.
absl::Status check_values(const char* what, std::span<const float> rgb, float lowest, float highest) {
  for (size_t i = 0; i < rgb.size(); ++i) {
    if (!std::isfinite(rgb[i]) || rgb[i] < lowest || rgb[i] > highest) {
      return absl::InvalidArgumentError(std::string(what) + " number " + std::to_string(i / 3) + " is " +
                                        std::to_string(rgb[i]) + "; give a finite value in range");
    }
  }
  return absl::OkStatus();
}

constexpr float kMax = 3.402823466e38f;

lightloom_result set_array(lightloom_runtime* runtime, SurfaceInput input, const char* what, const float* rgb,
                           uint64_t first, uint64_t count, float lowest, float highest) {
  return with_asset(runtime, [&](Backend& backend) -> absl::Status {
    LL_RETURN_IF_ERROR(check_range(rgb, first, count, backend));
    const std::span<const float> values(rgb, count * 3);
    LL_RETURN_IF_ERROR(check_values(what, values, lowest, highest));
    if (count > 0) backend.set(input, first, values);
    return absl::OkStatus();
  });
}

Digest digest_of(const uint8_t bytes[32]) {
  Digest digest;
  std::copy(bytes, bytes + 32, digest.bytes.begin());
  return digest;
}

/// lightloom_load's reader of one chunk after the other.
struct Loader {
  Backend* backend;
  const lightloom_asset_info* info;
  std::vector<uint8_t> bytes;

  absl::Status load(const ChunkRef& ref) {
    if (ref.size == 0) return absl::OkStatus();
    LL_RETURN_IF_ERROR(check_chunk_size(ref));
    bytes.resize(ref.size);
    if (info->read_chunk(info->read_user, ref.digest.bytes.data(), ref.size, bytes.data()) != 0) {
      return unreadable_chunk(ref);
    }
    return backend->load_chunk(ref.digest, bytes);
  }
  absl::Status load_all() {
    const AssetIndex& index = backend->index();
    for (const auto& o : index.objects()) LL_RETURN_IF_ERROR(load(o.surface));
    for (const auto& p : index.probes()) LL_RETURN_IF_ERROR(load(p.relight));
    for (const auto& c : index.cells()) LL_RETURN_IF_ERROR(load(c.chunk));
    return absl::OkStatus();
  }
};

}  // namespace

absl::Status unreadable_chunk(const ChunkRef& ref) {
  return absl::AbortedError("chunk " + ref.digest.hex() + " could not be read; is the asset complete?");
}
absl::Status over_budget(const std::string& message) {
  return marked(absl::ResourceExhaustedError(message), kOverBudget);
}
absl::Status not_ready(const std::string& message) { return marked(absl::FailedPreconditionError(message), kNotReady); }
absl::Status unknown_chunk(const std::string& message) { return marked(absl::NotFoundError(message), kUnknownChunk); }

lightloom_result result_of(const absl::Status& status) {
  if (status.GetPayload(kOverBudget)) return LIGHTLOOM_ERROR_OVER_BUDGET;
  if (status.GetPayload(kNotReady)) return LIGHTLOOM_ERROR_NOT_READY;
  if (status.GetPayload(kUnknownChunk)) return LIGHTLOOM_ERROR_UNKNOWN_CHUNK;
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

}  // namespace lightloom

using lightloom::Backend;
using lightloom::guarded;
using lightloom::SurfaceInput;
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
    case LIGHTLOOM_ERROR_OVER_BUDGET:
      return "over the byte budget";
    case LIGHTLOOM_ERROR_UNKNOWN_CHUNK:
      return "the manifest does not name that chunk";
    case LIGHTLOOM_ERROR_NOT_READY:
      return "another chunk must be loaded first";
  }
  return "unknown result";
}

uint32_t lightloom_version(void) {
  return LIGHTLOOM_VERSION_MAJOR << 22 | LIGHTLOOM_VERSION_MINOR << 12 | LIGHTLOOM_VERSION_PATCH;
}

void lightloom_destroy(lightloom_runtime* runtime) {
  if (runtime == nullptr) return;
  runtime->backend = nullptr;
  lightloom::HostMemory memory = runtime->memory;
  runtime->~lightloom_runtime();
  memory.deallocate(runtime, sizeof(lightloom_runtime), alignof(lightloom_runtime));
}

lightloom_result lightloom_load_manifest(lightloom_runtime* runtime, const void* manifest, uint64_t bytes) {
  if (runtime == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  return guarded(runtime->messages, [&]() -> absl::Status {
    if (manifest == nullptr) return absl::InvalidArgumentError("the manifest is null");
    return runtime->backend->load_manifest({static_cast<const uint8_t*>(manifest), bytes});
  });
}

lightloom_result lightloom_reload_manifest(lightloom_runtime* runtime, const void* manifest, uint64_t bytes) {
  return with_asset(runtime, [&](Backend& backend) -> absl::Status {
    if (manifest == nullptr) return absl::InvalidArgumentError("the manifest is null");
    return backend.reload_manifest({static_cast<const uint8_t*>(manifest), bytes});
  });
}

lightloom_result lightloom_load_chunk(lightloom_runtime* runtime, const uint8_t digest[32], const void* bytes,
                                      uint64_t size) {
  return with_asset(runtime, [&](Backend& backend) -> absl::Status {
    if (digest == nullptr || bytes == nullptr) return absl::InvalidArgumentError("the digest or the chunk is null");
    return backend.load_chunk(lightloom::digest_of(digest), {static_cast<const uint8_t*>(bytes), size});
  });
}

lightloom_result lightloom_load_chunk_part(lightloom_runtime* runtime, const uint8_t digest[32], const void* bytes,
                                           uint64_t size, const lightloom_detail* detail) {
  return with_asset(runtime, [&](Backend& backend) -> absl::Status {
    if (digest == nullptr || bytes == nullptr) return absl::InvalidArgumentError("the digest or the chunk is null");
    if (detail == nullptr || detail->struct_size < sizeof *detail ||
        (detail->flags & ~uint32_t{LIGHTLOOM_DETAIL_COARSE_RAYS | LIGHTLOOM_DETAIL_BASE}) != 0) {
      return absl::InvalidArgumentError("lightloom_detail is null, its struct_size is wrong or a flag is unknown");
    }
    return backend.load_chunk(
        lightloom::digest_of(digest), {static_cast<const uint8_t*>(bytes), size},
        {detail->max_rank, detail->bands == 0 ? UINT32_MAX : detail->bands,
         (detail->flags & LIGHTLOOM_DETAIL_COARSE_RAYS) == 0, (detail->flags & LIGHTLOOM_DETAIL_BASE) != 0});
  });
}

lightloom_result lightloom_drop_detail(lightloom_runtime* runtime, const uint8_t digest[32]) {
  return with_asset(runtime, [&](Backend& backend) -> absl::Status {
    if (digest == nullptr) return absl::InvalidArgumentError("the digest is null");
    return backend.drop_detail(lightloom::digest_of(digest));
  });
}

lightloom_result lightloom_unload_chunk(lightloom_runtime* runtime, const uint8_t digest[32]) {
  return with_asset(runtime, [&](Backend& backend) -> absl::Status {
    if (digest == nullptr) return absl::InvalidArgumentError("the digest is null");
    return backend.unload_chunk(lightloom::digest_of(digest));
  });
}

lightloom_result lightloom_load(lightloom_runtime* runtime, const lightloom_asset_info* info) {
  if (runtime == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  return guarded(runtime->messages, [&]() -> absl::Status {
    if (info == nullptr || info->struct_size < sizeof(lightloom_asset_info) || info->manifest == nullptr ||
        info->read_chunk == nullptr || info->reserved != 0) {
      return absl::InvalidArgumentError("lightloom_asset_info is null, its struct_size is wrong or a field is missing");
    }
    Backend& backend = *runtime->backend;
    LL_RETURN_IF_ERROR(backend.load_manifest(
        {static_cast<const uint8_t*>(info->manifest), static_cast<size_t>(info->manifest_bytes)}));
    lightloom::Loader loader{&backend, info, {}};
    absl::Status status;
    try {
      status = loader.load_all();
    } catch (...) {
      backend.unload();
      throw;
    }
    if (!status.ok()) backend.unload();
    return status;
  });
}

void lightloom_unload(lightloom_runtime* runtime) {
  if (runtime != nullptr) runtime->backend->unload();
}

lightloom_result lightloom_get_counts(lightloom_runtime* runtime, lightloom_counts* counts) {
  return with_asset(runtime, [&](Backend& backend) { return lightloom::fill(backend.counts(), counts); });
}

lightloom_result lightloom_set_direct(lightloom_runtime* runtime, const float* rgb, uint64_t first, uint64_t count) {
  return lightloom::set_array(runtime, SurfaceInput::kDirect, "direct irradiance", rgb, first, count, -lightloom::kMax,
                              lightloom::kMax);
}
lightloom_result lightloom_set_albedo(lightloom_runtime* runtime, const float* rgb, uint64_t first, uint64_t count) {
  return lightloom::set_array(runtime, SurfaceInput::kAlbedo, "albedo", rgb, first, count, 0, 1);
}
lightloom_result lightloom_set_emission(lightloom_runtime* runtime, const float* rgb, uint64_t first, uint64_t count) {
  return lightloom::set_array(runtime, SurfaceInput::kEmission, "emission", rgb, first, count, -lightloom::kMax,
                              lightloom::kMax);
}
lightloom_result lightloom_set_environment(lightloom_runtime* runtime, const float rgb[3]) {
  return with_asset(runtime, [&](Backend& backend) -> absl::Status {
    if (rgb == nullptr) return absl::InvalidArgumentError("the environment is null");
    LL_RETURN_IF_ERROR(lightloom::check_values("environment", {rgb, 3}, -lightloom::kMax, lightloom::kMax));
    backend.set_environment({rgb[0], rgb[1], rgb[2]});
    return absl::OkStatus();
  });
}

lightloom_result lightloom_set_update_options(lightloom_runtime* runtime, const lightloom_update_options* options) {
  if (runtime == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  return guarded(runtime->messages, [&]() -> absl::Status {
    if (options == nullptr || options->struct_size < offsetof(lightloom_update_options, fade)) {
      return absl::InvalidArgumentError("lightloom_update_options is null or its struct_size is wrong");
    }
    lightloom_update_options o{};
    std::memcpy(&o, options, std::min<size_t>(options->struct_size, sizeof o));
    const auto is_share = [](float v) { return v >= 0 && v <= 1; };
    if (!(o.epsilon >= 0) || !(o.epsilon_floor >= 0) || !is_share(o.smoothing) || !is_share(o.fade) ||
        !std::isfinite(o.epsilon) || !std::isfinite(o.epsilon_floor)) {
      return absl::InvalidArgumentError(
          "epsilon and epsilon_floor must be at least 0, smoothing and fade within [0, 1]");
    }
    if (o.smoothing == 0) o.smoothing = 1;
    if (o.fade == 0) o.fade = 1;
    return runtime->backend->set_options(o);
  });
}

lightloom_result lightloom_reset_feedback(lightloom_runtime* runtime) {
  return with_asset(runtime, [&](Backend& backend) -> absl::Status {
    backend.reset_feedback();
    return absl::OkStatus();
  });
}

lightloom_result lightloom_update(lightloom_runtime* runtime, uint32_t frames) {
  return with_asset(runtime, [&](Backend& backend) { return backend.update(frames); });
}

lightloom_result lightloom_read_irradiance(lightloom_runtime* runtime, float* rgb, uint64_t elements) {
  return with_asset(runtime, [&](Backend& backend) -> absl::Status {
    if (elements != backend.index().surface_elements() || (rgb == nullptr && elements > 0)) {
      return absl::InvalidArgumentError("the array is null or has another length than the surface elements");
    }
    return backend.read_irradiance({rgb, elements * 3});
  });
}

lightloom_result lightloom_get_stats(lightloom_runtime* runtime, lightloom_stats* stats) {
  return with_asset(runtime, [&](Backend& backend) { return lightloom::fill(backend.stats(), stats); });
}

}  // extern "C"
