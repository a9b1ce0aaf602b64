#include "runtime/simd_backend.h"

#include <algorithm>
#include <string>
#include <utility>

#include "runtime/boundary.h"
#include "runtime/resident.h"

namespace lightloom {

absl::Status SimdBackend::start(std::shared_ptr<const AssetIndex> index, std::span<const AssetIndex::Kept> kept) {
  SimdOptions options;
  options.threads = static_cast<int>(options_.threads);
  options.smoothing = options_.smoothing;
  options.memory = memory_;
  auto runtime = std::make_unique<SimdRuntime>(*index, options);
  if (options_.byte_budget != 0 && runtime->counts().bytes > options_.byte_budget) {
    return over_budget("the surface arrays alone take " + std::to_string(runtime->counts().bytes) +
                       " bytes, the budget is " + std::to_string(options_.byte_budget));
  }
  surfaces_.assign(index->objects().size(), false);
  probes_.assign(index->probes().size(), {});
  cells_.assign(index->cells().size(), {});
  coarse_rays_ = coarse_rays(index->rays());
  if (runtime_ != nullptr) runtime->inherit(*runtime_, kept);
  runtime_ = std::move(runtime);
  return absl::OkStatus();
}

void SimdBackend::unload() {
  forget();
  runtime_ = nullptr;
}

bool SimdBackend::resident(const AssetIndex::Target& target, const Detail& detail) const {
  const std::lock_guard lock(mutex_);
  switch (target.kind) {
    case AssetIndex::Kind::kSurface:
      return surfaces_[target.index];
    case AssetIndex::Kind::kRelight:
    case AssetIndex::Kind::kCell:
      break;
  }
  const Details& d = target.kind == AssetIndex::Kind::kCell ? cells_[target.index] : probes_[target.index];
  return d.has(detail);
}

void SimdBackend::unload_target(const AssetIndex::Target& target) {
  const std::lock_guard lock(mutex_);
  switch (target.kind) {
    case AssetIndex::Kind::kSurface:
      surfaces_[target.index] = false;
      break;
    case AssetIndex::Kind::kRelight:
      runtime_->unload_probe(target.index);
      probes_[target.index] = {};
      break;
    case AssetIndex::Kind::kCell:
      runtime_->unload_cell(target.index);
      cells_[target.index] = {};
      break;
  }
}

void SimdBackend::drop_target_detail(const AssetIndex::Target& target) {
  const std::lock_guard lock(mutex_);
  Details& d = target.kind == AssetIndex::Kind::kCell ? cells_[target.index] : probes_[target.index];
  if (!d.base) return;
  d.now = std::exchange(d.base, std::nullopt);
  if (target.kind == AssetIndex::Kind::kCell) {
    runtime_->drop_cell_detail(target.index);
  } else {
    runtime_->drop_probe_detail(target.index);
  }
}

absl::StatusOr<bool> SimdBackend::goes_over_base(const Details& details, const Detail& detail) {
  if (detail.base && details.now) return late_base();
  return details.now && details.now->base;
}

void SimdBackend::note(const Detail& detail, bool over_base, Details* details) {
  if (over_base) details->base = details->now;
  details->now = detail;
}

absl::Status SimdBackend::load_surface(uint32_t object, const SurfaceChunk&) {
  const std::lock_guard lock(mutex_);
  surfaces_[object] = true;
  return absl::OkStatus();
}

absl::Status SimdBackend::load_relight(uint32_t probe, std::span<const uint32_t> rays, const Detail& detail) {
  std::vector<uint32_t> few;
  if (!detail.all_rays) {
    for (const uint32_t r : coarse_rays_) few.push_back(rays[r]);
    rays = few;
  }
  simd::PackedProbe packed = runtime_->pack_probe(rays);
  const std::lock_guard lock(mutex_);
  if (probes_[probe].has(detail)) return absl::OkStatus();
  LL_ASSIGN_OR_RETURN(const bool over_base, goes_over_base(probes_[probe], detail));
  LL_RETURN_IF_ERROR(check_budget(packed.bytes(), over_base ? 0 : runtime_->probe_bytes(probe)));
  runtime_->load_probe(probe, std::move(packed), over_base);
  note(detail, over_base, &probes_[probe]);
  return absl::OkStatus();
}

absl::Status SimdBackend::load_cell(uint32_t cell, const SourceCell& source, const Detail& detail) {
  simd::PackedCell packed = runtime_->pack_cell(source);
  const std::lock_guard lock(mutex_);
  if (cells_[cell].has(detail)) return absl::OkStatus();
  LL_ASSIGN_OR_RETURN(const bool over_base, goes_over_base(cells_[cell], detail));
  LL_RETURN_IF_ERROR(check_budget(packed.bytes(), over_base ? 0 : runtime_->cell_bytes(cell)));
  LL_RETURN_IF_ERROR(runtime_->load_cell(cell, std::move(packed), over_base));
  note(detail, over_base, &cells_[cell]);
  return absl::OkStatus();
}

absl::Status SimdBackend::check_budget(uint64_t more, uint64_t less) const {
  const uint64_t bytes = runtime_->counts().bytes + more - less;
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
  if ((options.smoothing < 1 || options.fade < 1) && !options_.smoothing) {
    return absl::InvalidArgumentError("smoothing and fade below 1 need LIGHTLOOM_CREATE_SMOOTHING");
  }
  const std::lock_guard lock(mutex_);
  update_options_ = options;
  return absl::OkStatus();
}

absl::Status SimdBackend::update(uint32_t frames) {
  SimdFrameOptions frame;
  {
    const std::lock_guard lock(mutex_);
    frame = {update_options_.max_probes,    update_options_.max_cells, update_options_.epsilon,
             update_options_.epsilon_floor, update_options_.smoothing, update_options_.fade};
  }
  for (uint32_t f = 0; f < frames; ++f) runtime_->update(frame);
  return absl::OkStatus();
}

absl::Status SimdBackend::read_irradiance(std::span<float> rgb) {
  runtime_->read_irradiance(rgb);
  return absl::OkStatus();
}

lightloom_counts SimdBackend::counts() const {
  lightloom_counts out = counts_of(index());
  const SimdCounts c = runtime_->counts();
  out.resident_probes = c.resident_probes;
  out.resident_cells = c.resident_cells;
  out.active_cells = c.active_cells;
  out.gpu_bytes = c.bytes;
  out.byte_budget = options_.byte_budget;
  const std::lock_guard lock(mutex_);
  out.resident_surfaces = static_cast<uint32_t>(std::count(surfaces_.begin(), surfaces_.end(), true));
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
