#include "cli/player.h"

#include <algorithm>
#include <memory>

#include "cli/loom_runtime.h"
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

absl::StatusOr<std::vector<Vec3>> play_runtime(const std::filesystem::path& loom, const SurfaceInputs& inputs,
                                               Vec3 environment, const PlayOptions& options, PlayTimes* times) {
  RuntimeMessages messages;
  lightloom_create_info create{};
  create.struct_size = sizeof create;
  if (options.player == Player::kSimd) {
    create.flags = LIGHTLOOM_CREATE_CPU;
    create.threads = static_cast<uint32_t>(options.threads);
  } else if (options.validation) {
    create.flags = LIGHTLOOM_CREATE_VALIDATION;
  }
  create.message = RuntimeMessages::receive;
  create.message_user = &messages;
  lightloom_runtime* raw = nullptr;
  LL_RETURN_IF_ERROR(messages.status(lightloom_create(&create, &raw)));
  const std::unique_ptr<lightloom_runtime, decltype(&lightloom_destroy)> runtime(raw, lightloom_destroy);

  LL_RETURN_IF_ERROR(load_loom(loom, messages, raw));
  const uint64_t n = inputs.direct.size();
  LL_RETURN_IF_ERROR(messages.status(lightloom_set_direct(raw, floats(inputs.direct), 0, n)));
  LL_RETURN_IF_ERROR(set_albedo_emission_sky(inputs, environment, messages, raw));
  LL_RETURN_IF_ERROR(messages.status(lightloom_update(raw, static_cast<uint32_t>(options.iterations))));
  std::vector<Vec3> e(n);
  LL_RETURN_IF_ERROR(messages.status(lightloom_read_irradiance(raw, reinterpret_cast<float*>(e.data()), n)));
  if (times) {
    LL_ASSIGN_OR_RETURN(*times, play_times(messages, raw));
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
