#include "cli/loom_runtime.h"

#include <algorithm>

#include "core/base/file.h"

namespace lightloom {
int LoomReader::read(void* user, const uint8_t digest[32], uint64_t size, void* out) {
  auto* reader = static_cast<LoomReader*>(user);
  ChunkRef ref;
  std::copy(digest, digest + 32, ref.digest.bytes.begin());
  ref.size = size;
  const auto bytes = reader->store_.get(ref);
  reader->status_ = bytes.status();
  if (!bytes.ok()) return 1;
  std::copy(bytes->begin(), bytes->end(), static_cast<uint8_t*>(out));
  return 0;
}

void RuntimeMessages::receive(void* user, lightloom_message_kind kind, const char* text) {
  auto* self = static_cast<RuntimeMessages*>(user);
  const std::lock_guard lock(self->mutex_);
  if (kind == LIGHTLOOM_MESSAGE_VALIDATION) ++self->validation_;
  self->newest_ = text;
}

absl::Status RuntimeMessages::status(lightloom_result result) const {
  const std::lock_guard lock(mutex_);
  if (result == LIGHTLOOM_OK && validation_ == 0) return absl::OkStatus();
  return absl::UnavailableError("runtime: " + (newest_.empty() ? lightloom_result_string(result) : newest_));
}

absl::Status load_loom(const std::filesystem::path& loom, const RuntimeMessages& messages, lightloom_runtime* runtime) {
  LL_ASSIGN_OR_RETURN(const auto manifest, read_file(loom / "manifest"));
  LoomReader reader(loom);
  lightloom_asset_info asset{};
  asset.struct_size = sizeof asset;
  asset.manifest = manifest.data();
  asset.manifest_bytes = manifest.size();
  asset.read_chunk = LoomReader::read;
  asset.read_user = &reader;
  const absl::Status loaded = messages.status(lightloom_load(runtime, &asset));
  return reader.status().ok() ? loaded : reader.status();
}

absl::Status set_albedo_emission_sky(const SurfaceInputs& inputs, Vec3 environment, const RuntimeMessages& messages,
                                     lightloom_runtime* runtime) {
  const float sky[3] = {environment.x, environment.y, environment.z};
  LL_RETURN_IF_ERROR(messages.status(lightloom_set_albedo(runtime, floats(inputs.albedo), 0, inputs.albedo.size())));
  LL_RETURN_IF_ERROR(
      messages.status(lightloom_set_emission(runtime, floats(inputs.emission), 0, inputs.emission.size())));
  return messages.status(lightloom_set_environment(runtime, sky));
}

absl::StatusOr<PlayTimes> play_times(const RuntimeMessages& messages, lightloom_runtime* runtime) {
  lightloom_stats stats{};
  stats.struct_size = sizeof stats;
  LL_RETURN_IF_ERROR(messages.status(lightloom_get_stats(runtime, &stats)));
  return PlayTimes{stats.radiosity_ms, stats.select_ms + stats.relight_ms, stats.project_ms, stats.receive_ms};
}

}  // namespace lightloom
