#include "cli/player.h"

#include <lightloom.h>

#include <algorithm>
#include <memory>
#include <string>

#include "core/asset/asset.h"
#include "core/base/file.h"
#include "runtime/decoder.h"

namespace lightloom {
namespace {

absl::StatusOr<std::vector<Vec3>> play_decoder(const std::filesystem::path& loom, const SurfaceInputs& inputs,
                                               Vec3 environment, int iterations) {
  LL_ASSIGN_OR_RETURN(const auto manifest, read_file(loom / "manifest"));
  const ChunkStore store = chunk_store(loom);
  LL_ASSIGN_OR_RETURN(const AssetSource source,
                      AssetSource::open(manifest, [&](const ChunkRef& ref, std::span<uint8_t> out) -> absl::Status {
                        LL_ASSIGN_OR_RETURN(const auto bytes, store.get(ref));
                        std::copy(bytes.begin(), bytes.end(), out.begin());
                        return absl::OkStatus();
                      }));
  LL_ASSIGN_OR_RETURN(const DecoderAsset asset, load_decoder_asset(source));
  const SurfaceLight light{inputs.direct, inputs.albedo, inputs.emission, environment};
  std::vector<Vec3> e(inputs.direct.size());
  for (int i = 0; i < iterations; ++i) e = decode_frame(asset, light, e).irradiance;
  return e;
}

/// Collects what the runtime says.
struct Messages {
  std::string error;
  int validation = 0;

  static void receive(void* user, lightloom_message_kind kind, const char* text) {
    auto* self = static_cast<Messages*>(user);
    if (kind == LIGHTLOOM_MESSAGE_VALIDATION) ++self->validation;
    self->error = text;
  }
  absl::Status status(lightloom_result result) const {
    if (result == LIGHTLOOM_OK && validation == 0) return absl::OkStatus();
    return absl::UnavailableError("runtime: " + (error.empty() ? lightloom_result_string(result) : error));
  }
};

int read_chunk(void* user, const uint8_t digest[32], uint64_t size, void* out) {
  ChunkRef ref;
  std::copy(digest, digest + 32, ref.digest.bytes.begin());
  ref.size = size;
  const auto bytes = static_cast<const ChunkStore*>(user)->get(ref);
  if (!bytes.ok()) return 1;
  std::copy(bytes->begin(), bytes->end(), static_cast<uint8_t*>(out));
  return 0;
}

const float* floats(const std::vector<Vec3>& v) { return reinterpret_cast<const float*>(v.data()); }

absl::StatusOr<std::vector<Vec3>> play_runtime(const std::filesystem::path& loom, const SurfaceInputs& inputs,
                                               Vec3 environment, const PlayOptions& options, PlayTimes* times) {
  LL_ASSIGN_OR_RETURN(const auto manifest, read_file(loom / "manifest"));
  ChunkStore store = chunk_store(loom);
  Messages messages;
  lightloom_create_info create{};
  create.struct_size = sizeof create;
  if (options.player == Player::kSimd) {
    create.flags = LIGHTLOOM_CREATE_CPU;
    create.threads = static_cast<uint32_t>(options.threads);
  } else if (options.validation) {
    create.flags = LIGHTLOOM_CREATE_VALIDATION;
  }
  create.message = Messages::receive;
  create.message_user = &messages;
  lightloom_runtime* raw = nullptr;
  LL_RETURN_IF_ERROR(messages.status(lightloom_create(&create, &raw)));
  const std::unique_ptr<lightloom_runtime, decltype(&lightloom_destroy)> runtime(raw, lightloom_destroy);

  lightloom_asset_info asset{};
  asset.struct_size = sizeof asset;
  asset.manifest = manifest.data();
  asset.manifest_bytes = manifest.size();
  asset.read_chunk = read_chunk;
  asset.read_user = &store;
  LL_RETURN_IF_ERROR(messages.status(lightloom_load(raw, &asset)));

  const uint64_t n = inputs.direct.size();
  const float sky[3] = {environment.x, environment.y, environment.z};
  LL_RETURN_IF_ERROR(messages.status(lightloom_set_direct(raw, floats(inputs.direct), 0, n)));
  LL_RETURN_IF_ERROR(messages.status(lightloom_set_albedo(raw, floats(inputs.albedo), 0, n)));
  LL_RETURN_IF_ERROR(messages.status(lightloom_set_emission(raw, floats(inputs.emission), 0, n)));
  LL_RETURN_IF_ERROR(messages.status(lightloom_set_environment(raw, sky)));
  LL_RETURN_IF_ERROR(messages.status(lightloom_update(raw, static_cast<uint32_t>(options.iterations))));
  std::vector<Vec3> e(n);
  LL_RETURN_IF_ERROR(messages.status(lightloom_read_irradiance(raw, reinterpret_cast<float*>(e.data()), n)));
  if (times) {
    lightloom_stats stats{};
    stats.struct_size = sizeof stats;
    LL_RETURN_IF_ERROR(messages.status(lightloom_get_stats(raw, &stats)));
    *times = {stats.radiosity_ms, stats.select_ms + stats.relight_ms, stats.project_ms, stats.receive_ms};
  }
  return e;
}

}  // namespace

absl::StatusOr<std::vector<Vec3>> play(const std::filesystem::path& loom, const SurfaceInputs& inputs, Vec3 environment,
                                       const PlayOptions& options, PlayTimes* times) {
  return options.player == Player::kDecoder ? play_decoder(loom, inputs, environment, options.iterations)
                                            : play_runtime(loom, inputs, environment, options, times);
}

}  // namespace lightloom
