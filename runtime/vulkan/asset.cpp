// Which chunks of an asset are resident.
#include "runtime/vulkan/asset.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

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

template <class Lit>
bool VulkanAsset::Resident<Lit>::has(const Detail& detail) const {
  return (newest() != nullptr && newest()->detail == detail) || (base && base->detail == detail);
}

template <class Lit>
absl::Status VulkanAsset::Resident<Lit>::check(const Detail& detail) const {
  if (detail.base && newest() != nullptr) return late_base();
  if (next && next->detail.base) return not_ready("the chunk's base is on its way; record a frame");
  return absl::OkStatus();
}

template <class Lit>
void VulkanAsset::bury_all(Resident<Lit>* resident) {
  for (std::optional<Lit>* lit : {&resident->now, &resident->next, &resident->base}) {
    if (*lit) bury(*std::exchange(*lit, std::nullopt));
  }
}

/// What is on its way lights from now on; a base stays beneath it.
template <class Lit>
void VulkanAsset::take_next(Resident<Lit>* resident) {
  if (resident->now && resident->now->detail.base) {
    resident->base = resident->now;
  } else if (resident->now) {
    bury(*resident->now);
  }
  resident->now = std::exchange(resident->next, std::nullopt);
}

/// Gives up what is on its way to lie above a base.
template <class Lit>
void VulkanAsset::drop_next(const AssetIndex::Target& target, Resident<Lit>* resident) {
  const bool has_base = resident->base || (resident->now && resident->now->detail.base);
  if (!has_base || !resident->next) return;
  uploads_.cancel(target);
  bury(*std::exchange(resident->next, std::nullopt));
}

bool VulkanAsset::resident(const AssetIndex::Target& target, const Detail& detail) const {
  const std::lock_guard lock(mutex_);
  switch (target.kind) {
    case AssetIndex::Kind::kSurface:
      return surfaces_[target.index];
    case AssetIndex::Kind::kRelight:
      return probes_[target.index].has(detail);
    case AssetIndex::Kind::kCell:
      break;
  }
  return cells_[target.index].has(detail);
}

void VulkanAsset::unload(const AssetIndex::Target& target) {
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
}

void VulkanAsset::drop_detail(const AssetIndex::Target& target) {
  const std::lock_guard lock(mutex_);
  if (target.kind == AssetIndex::Kind::kRelight) drop_relight_detail(target.index);
  if (target.kind == AssetIndex::Kind::kCell) drop_cell_detail(target.index);
  touch();
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

  const AssetIndex::Target target{AssetIndex::Kind::kSurface, object};
  const std::lock_guard lock(mutex_);
  if (surfaces_[object]) return absl::OkStatus();
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
  surfaces_[object] = true;
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
  if (!surfaces_[object]) return;
  const AssetIndex::Target target{AssetIndex::Kind::kSurface, object};
  const AssetIndex::Object& o = index_.objects()[object];
  uploads_.cancel(target);
  if (o.elements > 0) {
    uploads_.push({target, points_.handle(), 16ull * o.first_element, std::pmr::vector<uint8_t>(memory_), 0,
                   16ull * o.elements, true, false});
  }
  surfaces_[object] = false;
}

absl::Status VulkanAsset::load_relight(uint32_t probe, std::span<const uint32_t> rays, const Detail& detail) {
  std::pmr::vector<uint8_t> data(memory_);
  const size_t count = detail.all_rays ? rays.size() : coarse_rays_.size();
  data.reserve(4 * (count + tile_words_));
  // What the probe sees, by tiles.
  std::vector<uint32_t> tiles(tile_words_);
  for (size_t i = 0; i < count; ++i) {
    const uint32_t ray = rays[detail.all_rays ? i : coarse_rays_[i]];
    append(&data, &ray, 1);
    if (ray == gpu::kDead) continue;
    const uint32_t tile = ray == gpu::kSky ? sky_tile_ : ray >> tile_shift_;
    tiles[tile / 32] |= 1u << tile % 32;
  }
  append(&data, tiles.data(), tiles.size());

  const AssetIndex::Target target{AssetIndex::Kind::kRelight, probe};
  const std::lock_guard lock(mutex_);
  Probe& p = probes_[probe];
  if (p.has(detail)) return absl::OkStatus();
  LL_RETURN_IF_ERROR(p.check(detail));
  // The memory that the upload needs, before the slot is taken.
  make_room_for_graves();
  uploads_.push({target, VK_NULL_HANDLE, 0, std::move(data), 0, 0, true, false});
  absl::StatusOr<uint32_t> slot = absl::InternalError("");
  try {
    slot = relight_pools_->allocate(detail.all_rays ? 0 : relight_pools_->kinds() - 1);
  } catch (...) {
    uploads_.pop_newest();
    throw;
  }
  if (!slot.ok()) {
    uploads_.pop_newest();
    return slot.status();
  }
  uploads_.newest().to = relight_pools_->buffer_of(*slot);
  uploads_.newest().offset = relight_pools_->offset_of(*slot);
  if (p.next) {
    uploads_.cancel_all_but_newest(target, 1);
    bury(*p.next);
  }
  p.next = {detail, *slot};
  ++lit_;
  touch();
  return absl::OkStatus();
}

void VulkanAsset::unload_relight(uint32_t probe) {
  Probe& p = probes_[probe];
  if (p.newest() == nullptr) return;
  uploads_.cancel({AssetIndex::Kind::kRelight, probe});
  if (p.now) write_slot(p.now->slot, gpu::kNoProbe);
  bury_all(&p);
  for (const uint32_t c : index_.cells_of(probe)) refresh_cell(c, false);
}

void VulkanAsset::drop_relight_detail(uint32_t probe) {
  Probe& p = probes_[probe];
  drop_next({AssetIndex::Kind::kRelight, probe}, &p);
  if (!p.base) return;
  write_slot(p.now->slot, gpu::kNoProbe);
  bury(*p.now);
  p.now = std::exchange(p.base, std::nullopt);
  write_slot(p.now->slot, probe);
  for (const uint32_t c : index_.cells_of(probe)) refresh_cell(c, true);
}

/// Before a version is made: then no burial needs memory, whenever it comes.
void VulkanAsset::make_room_for_graves() { graves_.reserve(graves_.size() + lit_ + 1); }

void VulkanAsset::bury(const LitProbe& probe) {
  graves_.push_back({recorded_ + context_->frames, probe.slot, {}});
  --lit_;
}

void VulkanAsset::bury(const LitCell& cell) {
  graves_.push_back({recorded_ + context_->frames, std::nullopt, cell.place});
  --lit_;
}

absl::StatusOr<VulkanAsset::LitCell> VulkanAsset::place_cell(const CellBlock& block) {
  LitCell lit;
  LL_ASSIGN_OR_RETURN(lit.place, cell_pools_->allocate(block.bytes));
  lit.jobs = block.jobs;
  lit.octets = block.octets;
  lit.project_quads = static_cast<uint32_t>(block.projection_bytes / 16);
  lit.receive_quads = static_cast<uint32_t>(block.reconstruction_bytes / 16);
  return lit;
}

absl::Status VulkanAsset::load_cell(uint32_t cell, const SourceCell& source, const Detail& detail) {
  LL_ASSIGN_OR_RETURN(CellBlock block, make_cell_block(source, context_->page_bytes, memory_));
  std::pmr::vector<uint32_t> elements(source.elements.begin(), source.elements.end(), memory_);
  std::vector<uint32_t> tiles(tile_words_);
  for (const uint32_t e : source.near_elements) tiles[(e >> tile_shift_) / 32] |= 1u << (e >> tile_shift_) % 32;

  const AssetIndex::Target target{AssetIndex::Kind::kCell, cell};
  const std::lock_guard lock(mutex_);
  Cell& c = cells_[cell];
  if (c.has(detail)) return absl::OkStatus();
  LL_RETURN_IF_ERROR(c.check(detail));
  // The memory that the upload needs, before anything else changes.
  make_room_for_graves();
  uploads_.push({target, VK_NULL_HANDLE, 0, std::move(block.data), 0, 0, true, false});
  absl::StatusOr<LitCell> lit = absl::InternalError("");
  try {
    lit = place_cell(block);
  } catch (...) {
    uploads_.pop_newest();
    throw;
  }
  const absl::Status claimed = !lit.ok()               ? lit.status()
                               : c.newest() != nullptr ? absl::OkStatus()
                                                       : mark_received(cell, source.elements);
  if (!claimed.ok()) {
    uploads_.pop_newest();
    if (lit.ok()) cell_pools_->release(lit->place, recorded_ + 1);
    return claimed;
  }
  uploads_.newest().to = cell_pools_->pools()[lit->place.pool].buffer.handle();
  uploads_.newest().offset = lit->place.offset;
  if (c.next) {
    uploads_.cancel_all_but_newest(target, 1);
    bury(*c.next);
  }
  c.next = *lit;
  c.next->detail = detail;
  c.elements = std::move(elements);
  const size_t first_tile = size_t{cell} * tile_words_;  // a base's are among those of finer details
  std::copy(tiles.begin(), tiles.end(), near_table_.as<uint32_t>() + first_tile);
  near_table_.touch(4 * first_tile, 4 * (first_tile + tile_words_));
  ++lit_;
  touch();
  return absl::OkStatus();
}

void VulkanAsset::unload_cell(uint32_t cell) {
  Cell& c = cells_[cell];
  if (c.newest() == nullptr) return;
  uploads_.cancel({AssetIndex::Kind::kCell, cell});
  bury_all(&c);
  for (const uint32_t e : c.elements) received_[e] = false;
  c.elements = std::pmr::vector<uint32_t>(memory_);
  refresh_cell(cell, false);
}

void VulkanAsset::drop_cell_detail(uint32_t cell) {
  Cell& c = cells_[cell];
  drop_next({AssetIndex::Kind::kCell, cell}, &c);
  if (!c.base) return;
  bury(*c.now);
  c.now = std::exchange(c.base, std::nullopt);
  refresh_cell(cell, true);
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

/// The frame that is being recorded has all of it.
void VulkanAsset::uploaded(AssetIndex::Target target) {
  if (target.kind == AssetIndex::Kind::kCell) {
    take_next(&cells_[target.index]);
    refresh_cell(target.index, true);
  } else if (target.kind == AssetIndex::Kind::kRelight) {
    Probe& p = probes_[target.index];
    const bool replaces = p.now.has_value();
    if (replaces) write_slot(p.now->slot, gpu::kNoProbe);
    take_next(&p);
    write_slot(p.now->slot, target.index);
    for (const uint32_t c : index_.cells_of(target.index)) refresh_cell(c, replaces);
  }
}

void VulkanAsset::write_slot(uint32_t slot, uint32_t probe) {
  slot_table_.as<gpu::Slot>()[slot] = {probe, ++generation_};
  slot_table_.touch(slot * sizeof(gpu::Slot), (slot + 1) * sizeof(gpu::Slot));
}

void VulkanAsset::refresh_cell(uint32_t cell, bool anew) {
  Cell& c = cells_[cell];
  const std::span<const uint32_t> probes = index_.probes_of(cell);
  const bool live =
      c.now && std::all_of(probes.begin(), probes.end(), [this](uint32_t p) { return probes_[p].now.has_value(); });
  const bool was_live = c.record.live != 0;
  if (live == was_live && !(live && anew)) return;
  if (live) {
    c.record = {c.now->place.pool,
                static_cast<uint32_t>(c.now->place.offset / gpu::kCellUnit),
                c.now->jobs,
                c.now->octets,
                index_.cells()[cell].first_probe,
                static_cast<uint32_t>(probes.size()),
                ++generation_,
                c.now->project_quads,
                c.now->receive_quads,
                0,
                0,
                0};
  } else {
    c.record.live = 0;
  }
  cell_table_.as<gpu::Cell>()[cell] = c.record;
  cell_table_.touch(cell * sizeof(gpu::Cell), (cell + 1) * sizeof(gpu::Cell));
  if (!live) return;
  if (settings_.options.fade < 1) fade_left_ = 1;
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
  if (inherited_until_ == 0) inherited_parts_.clear();
  touch();
}

bool VulkanAsset::tables_pending() const {
  return cell_table_.pending_bytes() + near_table_.pending_bytes() + slot_table_.pending_bytes() +
                 map_table_.pending_bytes() >
             0 ||
         std::any_of(inputs_.begin(), inputs_.end(), [](const auto& t) { return t.pending_bytes() > 0; });
}

uint64_t VulkanAsset::pending_bytes() const {
  const std::lock_guard lock(mutex_);
  return uploads_.pending_bytes();
}

bool VulkanAsset::uploads_pending() const {
  const std::lock_guard lock(mutex_);
  return !uploads_.empty() || tables_pending();
}

void VulkanAsset::fill_counts(lightloom_counts* out) const {
  *out = counts_of(index_);
  const std::lock_guard lock(mutex_);
  out->pending_bytes = uploads_.pending_bytes();
  for (const ShadowTable& t : inputs_) out->pending_bytes += t.pending_bytes();
  for (const bool resident : surfaces_) out->resident_surfaces += resident;
  for (const Probe& p : probes_) out->resident_probes += p.newest() != nullptr;
  for (const Cell& c : cells_) {
    out->resident_cells += c.newest() != nullptr;
    out->active_cells += c.record.live != 0;
  }
  out->pages = cell_pools_->count();
  out->gpu_bytes = context_->bytes;
  out->byte_budget = context_->budget;
}

void VulkanAsset::fill_stats(lightloom_stats* out) const {
  const std::lock_guard lock(mutex_);
  out->upload_bytes = chunk_bytes_;
  if (skipped_frame_ > last_frame_) {
    out->skipped = 1;
    return;
  }
  out->changed_tiles = last_.changed_tiles;
  out->updated_probes = last_.updated_probes;
  out->updated_cells = last_.updated_cells;
  out->waiting_probes = last_.waiting_probes;
  out->waiting_cells = last_.waiting_cells;
  const uint64_t coarse = last_.coarse_probes, all = last_.updated_probes - coarse;
  out->relight_bytes = 4 * (all * index_.rays() + coarse * coarse_rays_.size());
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
