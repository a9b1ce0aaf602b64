#include "runtime/simd_backend.h"

#include <algorithm>
#include <string>
#include <utility>

#include "runtime/boundary.h"
#include "runtime/resident.h"

namespace lightloom {

absl::Status SimdBackend::load_manifest(std::span<const uint8_t> bytes) {
  unload();  // the old asset goes first: both may not fit
  LL_ASSIGN_OR_RETURN(const Manifest manifest, decode_manifest(bytes));
  LL_ASSIGN_OR_RETURN(AssetIndex made, AssetIndex::create(manifest, memory_));
  const AssetIndex& index = index_.emplace(std::move(made));
  SimdOptions options;
  options.threads = static_cast<int>(options_.threads);
  options.smoothing = options_.smoothing;
  options.memory = memory_;
  auto runtime = std::make_unique<SimdRuntime>(index, options);
  if (options_.byte_budget != 0 && runtime->counts().bytes > options_.byte_budget) {
    return over_budget("the surface arrays alone take " + std::to_string(runtime->counts().bytes) +
                       " bytes, the budget is " + std::to_string(options_.byte_budget));
  }
  keys_.assign(index.objects().size(), nullptr);
  runtime_ = std::move(runtime);
  return absl::OkStatus();
}

void SimdBackend::unload() {
  runtime_ = nullptr;
  keys_.clear();
  index_.reset();
}

absl::Status SimdBackend::load_chunk(const Digest& digest, std::span<const uint8_t> bytes) {
  LL_ASSIGN_OR_RETURN(const AssetIndex::Target target, find_chunk(*index_, digest));
  switch (target.kind) {
    case AssetIndex::Kind::kSurface:
      return load_surface(target.index, bytes);
    case AssetIndex::Kind::kRelight:
      return load_relight(target.index, bytes);
    case AssetIndex::Kind::kCell:
      return load_cell(target.index, bytes);
  }
  return absl::OkStatus();
}

absl::Status SimdBackend::unload_chunk(const Digest& digest) {
  LL_ASSIGN_OR_RETURN(const AssetIndex::Target target, find_chunk(*index_, digest));
  const std::lock_guard lock(mutex_);
  switch (target.kind) {
    case AssetIndex::Kind::kSurface:
      keys_[target.index] = nullptr;
      break;
    case AssetIndex::Kind::kRelight:
      runtime_->unload_probe(target.index);
      break;
    case AssetIndex::Kind::kCell:
      runtime_->unload_cell(target.index);
      break;
  }
  return absl::OkStatus();
}

absl::Status SimdBackend::load_surface(uint32_t object, std::span<const uint8_t> bytes) {
  LL_ASSIGN_OR_RETURN(const SurfaceChunk chunk, index_->surface(object, bytes));
  SurfaceKeys keys = keys_of_surface(chunk, memory_);
  const std::lock_guard lock(mutex_);
  if (keys_[object] == nullptr) keys_[object] = std::move(keys);
  return absl::OkStatus();
}

absl::Status SimdBackend::load_relight(uint32_t probe, std::span<const uint8_t> bytes) {
  LL_ASSIGN_OR_RETURN(const auto rays,
                      resolve_relight(*index_, probe, bytes, [this](uint32_t o) { return keys_of(o); }));
  simd::PackedProbe packed = runtime_->pack_probe(rays);
  const std::lock_guard lock(mutex_);
  LL_RETURN_IF_ERROR(check_budget(packed.bytes()));
  runtime_->load_probe(probe, std::move(packed));
  return absl::OkStatus();
}

absl::Status SimdBackend::load_cell(uint32_t cell, std::span<const uint8_t> bytes) {
  LL_ASSIGN_OR_RETURN(const SourceCell source,
                      resolve_cell(*index_, cell, bytes, [this](uint32_t o) { return keys_of(o); }));
  simd::PackedCell packed = runtime_->pack_cell(source);
  const std::lock_guard lock(mutex_);
  LL_RETURN_IF_ERROR(check_budget(packed.bytes()));
  return runtime_->load_cell(cell, std::move(packed));
}

SurfaceKeys SimdBackend::keys_of(uint32_t object) const {
  const std::lock_guard lock(mutex_);
  return keys_[object];
}

absl::Status SimdBackend::check_budget(uint64_t more) const {
  const uint64_t bytes = runtime_->counts().bytes + more;
  if (options_.byte_budget == 0 || bytes <= options_.byte_budget) return absl::OkStatus();
  return over_budget("the chunk would take the asset to " + std::to_string(bytes) + " bytes, the budget is " +
                     std::to_string(options_.byte_budget) + "; unload something first");
}

void SimdBackend::set(SurfaceInput input, uint64_t first, std::span<const float> rgb) {
  const uint32_t at = static_cast<uint32_t>(first);
  switch (input) {
    case SurfaceInput::kDirect:
      return runtime_->set_direct(at, rgb);
    case SurfaceInput::kAlbedo:
      return runtime_->set_albedo(at, rgb);
    case SurfaceInput::kEmission:
      return runtime_->set_emission(at, rgb);
  }
}

absl::Status SimdBackend::set_options(const lightloom_update_options& options) {
  if (options.smoothing < 1 && !options_.smoothing) {
    return absl::InvalidArgumentError("smoothing below 1 needs LIGHTLOOM_CREATE_SMOOTHING");
  }
  const std::lock_guard lock(mutex_);
  update_options_ = options;
  return absl::OkStatus();
}

absl::Status SimdBackend::update(uint32_t frames) {
  SimdFrameOptions frame;
  {
    const std::lock_guard lock(mutex_);
    frame = {update_options_.max_probes, update_options_.max_cells, update_options_.epsilon,
             update_options_.epsilon_floor, update_options_.smoothing};
  }
  for (uint32_t f = 0; f < frames; ++f) runtime_->update(frame);
  return absl::OkStatus();
}

absl::Status SimdBackend::read_irradiance(std::span<float> rgb) {
  runtime_->read_irradiance(rgb);
  return absl::OkStatus();
}

lightloom_counts SimdBackend::counts() const {
  lightloom_counts out = counts_of(*index_);
  const SimdCounts c = runtime_->counts();
  out.resident_probes = c.resident_probes;
  out.resident_cells = c.resident_cells;
  out.active_cells = c.active_cells;
  out.gpu_bytes = c.bytes;
  out.byte_budget = options_.byte_budget;
  const std::lock_guard lock(mutex_);
  out.resident_surfaces =
      static_cast<uint32_t>(std::count_if(keys_.begin(), keys_.end(), [](const auto& k) { return k != nullptr; }));
  return out;
}

lightloom_stats SimdBackend::stats() const {
  lightloom_stats out{};
  const SimdStats s = runtime_->stats();
  out.timestamps = 1;
  out.frames = s.frames;
  out.radiosity_ms = s.radiosity_ms;
  out.select_ms = s.select_ms;
  out.relight_ms = s.relight_ms;
  out.project_ms = s.project_ms;
  out.receive_ms = s.receive_ms;
  out.changed_tiles = s.changed_tiles;
  out.updated_probes = s.updated_probes;
  out.updated_cells = s.updated_cells;
  out.waiting_probes = s.waiting_probes;
  out.waiting_cells = s.waiting_cells;
  out.skipped = s.skipped;
  out.relight_bytes = s.relight_bytes;
  out.project_bytes = s.project_bytes;
  out.receive_bytes = s.receive_bytes;
  return out;
}

}  // namespace lightloom
