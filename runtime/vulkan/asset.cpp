// Which chunks of an asset are resident.
#include "runtime/vulkan/asset.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "runtime/boundary.h"
#include "runtime/resident.h"

namespace lightloom {
namespace {

template <class T>
void append(std::pmr::vector<uint8_t>* to, const T* values, size_t count) {
  const auto* bytes = reinterpret_cast<const uint8_t*>(values);
  to->insert(to->end(), bytes, bytes + count * sizeof(T));
}

}  // namespace

absl::Status VulkanAsset::load_chunk(const Digest& digest, std::span<const uint8_t> bytes) {
  LL_ASSIGN_OR_RETURN(const AssetIndex::Target target, find_chunk(index_, digest));
  {
    const std::lock_guard lock(mutex_);
    const bool resident = target.kind == AssetIndex::Kind::kSurface   ? surfaces_[target.index].keys != nullptr
                          : target.kind == AssetIndex::Kind::kRelight ? probes_[target.index].resident
                                                                      : cells_[target.index].resident;
    if (resident) return absl::OkStatus();
  }
  const auto keys = [this](uint32_t object) {
    const std::lock_guard lock(mutex_);
    return surfaces_[object].keys;
  };
  switch (target.kind) {
    case AssetIndex::Kind::kSurface: {
      LL_ASSIGN_OR_RETURN(const SurfaceChunk chunk, index_.surface(target.index, bytes));
      return load_surface(target.index, chunk);
    }
    case AssetIndex::Kind::kRelight: {
      LL_ASSIGN_OR_RETURN(const auto rays, resolve_relight(index_, target.index, bytes, keys));
      return load_relight(target.index, rays);
    }
    case AssetIndex::Kind::kCell:
      break;
  }
  LL_ASSIGN_OR_RETURN(const SourceCell source, resolve_cell(index_, target.index, bytes, keys));
  return load_cell(target.index, source);
}

absl::Status VulkanAsset::unload_chunk(const Digest& digest) {
  LL_ASSIGN_OR_RETURN(const AssetIndex::Target target, find_chunk(index_, digest));
  const std::lock_guard lock(mutex_);
  switch (target.kind) {
    case AssetIndex::Kind::kSurface:
      unload_surface(target.index);
      break;
    case AssetIndex::Kind::kRelight:
      unload_relight(target.index);
      break;
    case AssetIndex::Kind::kCell:
      unload_cell(target.index);
      break;
  }
  touch();
  return absl::OkStatus();
}

absl::Status VulkanAsset::load_surface(uint32_t object, const SurfaceChunk& chunk) {
  const AssetIndex::Object& o = index_.objects()[object];
  const size_t n = chunk.keys.size();
  std::pmr::vector<uint8_t> points(memory_), normals(memory_);
  points.reserve(16 * n);
  normals.reserve(4 * n);
  for (size_t i = 0; i < n; ++i) {
    const Vec3 p = chunk.positions[i];
    // Radius 0 would mean that the element is not resident.
    const float radius = std::max(1e-6f, 0.5f * std::sqrt(std::max(0.0f, chunk.areas[i])));
    const float point[] = {p.x, p.y, p.z, radius};
    const uint32_t normal = encode_normal(chunk.normals[i]);
    append(&points, point, 4);
    append(&normals, &normal, 1);
  }
  const SurfaceKeys keys = keys_of_surface(chunk, memory_);

  const AssetIndex::Target target{AssetIndex::Kind::kSurface, object};
  const std::lock_guard lock(mutex_);
  if (surfaces_[object].keys != nullptr) return absl::OkStatus();
  uploads_.cancel(target);
  if (n > 0) {
    uploads_.push({target, points_.handle(), 16ull * o.first_element, std::move(points), 0, 0, false, false});
    try {
      uploads_.push({target, normals_.handle(), 4ull * o.first_element, std::move(normals), 0, 0, true, false});
    } catch (...) {
      uploads_.pop_newest();
      throw;
    }
  }
  surfaces_[object].keys = keys;
  if (map_ != nullptr && n > 0) {
    const LightmapMap::Range changed = map_->add(o, chunk.keys);
    map_table_.touch(4 * changed.begin, 4 * changed.end);
    if (chunk.keys.back() >= o.width * o.height) map_layers_ = kImageLayers;
    image_stale_ = true;
  }
  touch();
  return absl::OkStatus();
}

void VulkanAsset::unload_surface(uint32_t object) {
  if (surfaces_[object].keys == nullptr) return;
  const AssetIndex::Target target{AssetIndex::Kind::kSurface, object};
  const AssetIndex::Object& o = index_.objects()[object];
  uploads_.cancel(target);
  if (o.elements > 0) {
    uploads_.push({target, points_.handle(), 16ull * o.first_element, std::pmr::vector<uint8_t>(memory_), 0,
                   16ull * o.elements, true, false});
  }
  surfaces_[object].keys = nullptr;
}

absl::Status VulkanAsset::load_relight(uint32_t probe, const std::vector<uint32_t>& rays) {
  // What the probe sees, by tiles.
  std::vector<uint32_t> tiles(tile_words_);
  for (const uint32_t ray : rays) {
    if (ray == gpu::kDead) continue;
    const uint32_t tile = ray == gpu::kSky ? sky_tile_ : ray >> tile_shift_;
    tiles[tile / 32] |= 1u << tile % 32;
  }
  std::pmr::vector<uint8_t> data(memory_);
  data.reserve(4 * (rays.size() + tiles.size()));
  append(&data, rays.data(), rays.size());
  append(&data, tiles.data(), tiles.size());

  const AssetIndex::Target target{AssetIndex::Kind::kRelight, probe};
  const std::lock_guard lock(mutex_);
  if (probes_[probe].resident) return absl::OkStatus();
  // The memory that the upload needs, before the slot is taken.
  uploads_.push({target, VK_NULL_HANDLE, 0, std::move(data), 0, 0, true, false});
  const absl::StatusOr<uint32_t> slot = relight_pools_->allocate();
  if (!slot.ok()) {
    uploads_.pop_newest();
    return slot.status();
  }
  uploads_.newest().to = relight_pools_->buffer_of(*slot);
  uploads_.newest().offset = relight_pools_->offset_of(*slot);
  probes_[probe] = {true, false, *slot};
  touch();
  return absl::OkStatus();
}

void VulkanAsset::unload_relight(uint32_t probe) {
  Probe& p = probes_[probe];
  if (!p.resident) return;
  graves_.push_back({recorded_ + context_->frames, true, p.slot, {}});
  uploads_.cancel({AssetIndex::Kind::kRelight, probe});
  if (p.uploaded) {
    write_slot(p.slot, gpu::kNoProbe);
    for (const uint32_t c : index_.cells_of(probe)) {
      ++cells_[c].missing;
      refresh_cell(c);
    }
  }
  p = {};
}

absl::Status VulkanAsset::load_cell(uint32_t cell, const SourceCell& source) {
  LL_ASSIGN_OR_RETURN(CellBlock block, make_cell_block(source, context_->page_bytes, memory_));
  std::pmr::vector<uint32_t> elements(source.elements.begin(), source.elements.end(), memory_);

  const AssetIndex::Target target{AssetIndex::Kind::kCell, cell};
  const std::lock_guard lock(mutex_);
  Cell& c = cells_[cell];
  if (c.resident) return absl::OkStatus();
  // The memory that the upload needs, before anything else changes.
  uploads_.push({target, VK_NULL_HANDLE, 0, std::move(block.data), 0, 0, true, false});
  const absl::StatusOr<CellPools::Place> place = [&]() -> absl::StatusOr<CellPools::Place> {
    try {
      return cell_pools_->allocate(block.bytes);
    } catch (...) {
      uploads_.pop_newest();
      throw;
    }
  }();
  const absl::Status marked = place.ok() ? mark_received(cell, source.elements) : place.status();
  if (!marked.ok()) {
    uploads_.pop_newest();
    if (place.ok()) cell_pools_->release(*place, recorded_ + 1);
    return marked;
  }
  uploads_.newest().to = cell_pools_->pools()[place->pool].buffer.handle();
  uploads_.newest().offset = place->offset;
  c.resident = true;
  c.uploaded = false;
  c.place = *place;
  c.elements = std::move(elements);
  c.record.pool = place->pool;
  c.record.base = static_cast<uint32_t>(place->offset / gpu::kCellUnit);
  c.record.jobs = block.jobs;
  c.record.octets = block.octets;
  c.record.project_quads = static_cast<uint32_t>(block.projection_bytes / 16);
  c.record.receive_quads = static_cast<uint32_t>(block.reconstruction_bytes / 16);
  touch();
  return absl::OkStatus();
}

void VulkanAsset::unload_cell(uint32_t cell) {
  Cell& c = cells_[cell];
  if (!c.resident) return;
  graves_.push_back({recorded_ + context_->frames, false, 0, c.place});
  uploads_.cancel({AssetIndex::Kind::kCell, cell});
  for (const uint32_t e : c.elements) received_[e] = false;
  c.elements = std::pmr::vector<uint32_t>(memory_);
  c.resident = c.uploaded = false;
  refresh_cell(cell);
}

/// No two receivers may share an E.
absl::Status VulkanAsset::mark_received(uint32_t cell, const std::vector<uint32_t>& elements) {
  for (size_t i = 0; i < elements.size(); ++i) {
    if (!received_[elements[i]]) {
      received_[elements[i]] = true;
      continue;
    }
    for (size_t marked = 0; marked < i; ++marked) received_[elements[marked]] = false;
    return absl::DataLossError("cell " + std::to_string(cell) +
                               " is corrupt: a receiver occurs twice; bake again or fetch it again");
  }
  return absl::OkStatus();
}

void VulkanAsset::uploaded(AssetIndex::Target target) {
  if (target.kind == AssetIndex::Kind::kCell) {
    cells_[target.index].uploaded = true;
    refresh_cell(target.index);
  } else if (target.kind == AssetIndex::Kind::kRelight) {
    Probe& p = probes_[target.index];
    p.uploaded = true;
    write_slot(p.slot, target.index);
    for (const uint32_t c : index_.cells_of(target.index)) {
      --cells_[c].missing;
      refresh_cell(c);
    }
  }
}

void VulkanAsset::write_slot(uint32_t slot, uint32_t probe) {
  slot_table_.as<gpu::Slot>()[slot] = {probe, ++generation_};
  slot_table_.touch(slot * sizeof(gpu::Slot), (slot + 1) * sizeof(gpu::Slot));
}

void VulkanAsset::refresh_cell(uint32_t cell) {
  Cell& c = cells_[cell];
  const bool live = c.resident && c.uploaded && c.missing == 0;
  if (live == (c.record.live != 0)) return;
  c.record.live = live ? ++generation_ : 0;
  cell_table_.as<gpu::Cell>()[cell] = c.record;
  cell_table_.touch(cell * sizeof(gpu::Cell), (cell + 1) * sizeof(gpu::Cell));
}

void VulkanAsset::set(SurfaceInput input, uint64_t first, std::span<const float> rgb) {
  const std::lock_guard lock(mutex_);
  ShadowTable& table = inputs_[static_cast<size_t>(input)];
  float* const to = table.as<float>() + 3 * first;
  const float highest = input == SurfaceInput::kAlbedo ? LIGHTLOOM_MAX_ALBEDO : 3.402823466e38f;
  bool same = true;
  for (size_t i = 0; i < rgb.size(); ++i) {
    const float value = std::min(rgb[i], highest);
    same = same && to[i] == value;
    to[i] = value;
  }
  const bool overwritten = input == SurfaceInput::kDirect && direct_overwritten_;
  if (same && !overwritten) return;
  if (overwritten && rgb.size() == 3ull * index_.surface_elements()) direct_overwritten_ = false;
  table.touch(12 * first, 12 * first + rgb.size_bytes());
  touch();
}

void VulkanAsset::set_environment(Vec3 radiance) {
  const std::lock_guard lock(mutex_);
  if (radiance == settings_.environment) return;
  settings_.environment = radiance;
  sky_changed_ = true;
  touch();
}

void VulkanAsset::set_options(const lightloom_update_options& options) {
  const std::lock_guard lock(mutex_);
  settings_.options = options;
  touch();
}

void VulkanAsset::reset_feedback() {
  const std::lock_guard lock(mutex_);
  reset_ = true;
  touch();
}

bool VulkanAsset::tables_pending() const {
  return cell_table_.pending_bytes() + slot_table_.pending_bytes() + map_table_.pending_bytes() > 0 ||
         std::any_of(inputs_.begin(), inputs_.end(), [](const auto& t) { return t.pending_bytes() > 0; });
}

bool VulkanAsset::uploads_pending() const {
  const std::lock_guard lock(mutex_);
  return !uploads_.empty() || tables_pending();
}

void VulkanAsset::fill_counts(lightloom_counts* out) const {
  const std::lock_guard lock(mutex_);
  *out = counts_of(index_);
  for (const Surface& s : surfaces_) out->resident_surfaces += s.keys != nullptr;
  for (const Probe& p : probes_) out->resident_probes += p.resident;
  for (const Cell& c : cells_) {
    out->resident_cells += c.resident;
    out->active_cells += c.record.live != 0;
  }
  out->pages = cell_pools_->count();
  out->pending_bytes = uploads_.pending_bytes();
  for (const ShadowTable& t : inputs_) out->pending_bytes += t.pending_bytes();
  out->gpu_bytes = context_->bytes;
  out->byte_budget = context_->budget;
}

void VulkanAsset::fill_stats(lightloom_stats* out) const {
  const std::lock_guard lock(mutex_);
  if (skipped_frame_ > last_frame_) {
    out->skipped = 1;
    return;
  }
  out->changed_tiles = last_.changed_tiles;
  out->updated_probes = last_.updated_probes;
  out->updated_cells = last_.updated_cells;
  out->waiting_probes = last_.waiting_probes;
  out->waiting_cells = last_.waiting_cells;
  out->relight_bytes = uint64_t{last_.updated_probes} * index_.rays() * 4;
  out->project_bytes = uint64_t{last_.project_quads} * 16;
  out->receive_bytes = uint64_t{last_.receive_quads} * 16;
}

void VulkanAsset::finished(uint32_t frame, const gpu::Control& counters) {
  const std::lock_guard lock(mutex_);
  if (frame <= last_frame_) return;
  last_frame_ = frame;
  last_ = counters;
  const bool idle = counters.changed_tiles == 0 && counters.updated_probes == 0 && counters.waiting_probes == 0 &&
                    counters.updated_cells == 0 && counters.waiting_cells == 0;
  // Nothing was new to the frame, and it changed nothing: the next one would do the same.
  if (frame > touched_frame_ && idle) quiet_ = true;
}

void VulkanAsset::fill_outputs(lightloom_vulkan_outputs* out) const {
  out->surface_elements = index_.surface_elements();
  out->irradiance = irradiance_.handle();
  out->irradiance_bytes = 12ull * index_.surface_elements();
  out->direct = inputs_[static_cast<size_t>(SurfaceInput::kDirect)].device().handle();
  if (map_ == nullptr) return;
  out->image = image_.handle();
  out->image_view = image_.view();
  out->image_format = options_.image_format;
  out->image_width = index_.width();
  out->image_height = index_.height();
  out->image_layers = kImageLayers;
}

}  // namespace lightloom
