#include "runtime/asset_index.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/asset/texel_codes.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

/// No baker writes larger ones; a manifest that claims them must not make us allocate them.
constexpr uint64_t kMaxChunkBytes = 1ull << 30;
/// Then the table of Y_j(ω_r) stays below 27 MB.
constexpr int32_t kMaxRelightRays = 1 << 16;
/// A surface element's number is above this in no asset, so that kDead and kSky are none.
constexpr uint64_t kMaxElements = 1ull << 31;

absl::Status corrupt(const std::string& what, const std::string& why) {
  return absl::DataLossError(what + " is corrupt: " + why + "; bake again or fetch it again");
}

/// Bytes of a surface chunk of n texels (docs/asset-format.md).
uint64_t surface_bytes(uint64_t n) {
  const auto aligned = [](uint64_t at) { return (at + 15) / 16 * 16; };
  return aligned(aligned(aligned(64 + 4 * n) + 12 * n) + 4 * n) + 4 * n;
}

/// Texels of a surface chunk of that size, or nothing if no chunk has that size. The size grows with each texel.
std::optional<uint32_t> texels_of(uint64_t bytes) {
  if (bytes < surface_bytes(0) || bytes > kMaxChunkBytes) return std::nullopt;
  for (uint64_t n = (bytes - 64) / 24 > 2 ? (bytes - 64) / 24 - 2 : 0; surface_bytes(n) <= bytes; ++n) {
    if (surface_bytes(n) == bytes) return static_cast<uint32_t>(n);
  }
  return std::nullopt;
}

absl::Status check_bytes(const std::string& what, const ChunkRef& ref, std::span<const uint8_t> bytes) {
  if (bytes.size() != ref.size) return corrupt(what, "its size is not the manifest's");
  if (sha256(bytes) != ref.digest) return corrupt(what, "its bytes have another SHA-256");
  return absl::OkStatus();
}

template <class T>
absl::StatusOr<T> in_context(const std::string& what, absl::StatusOr<T> decoded) {
  if (decoded.ok()) return decoded;
  return absl::Status(decoded.status().code(), what + ": " + std::string(decoded.status().message()));
}

}  // namespace

absl::StatusOr<AssetIndex> AssetIndex::create(const Manifest& m, std::pmr::memory_resource* memory) {
  if (m.params.relight_rays > kMaxRelightRays) {
    return absl::UnimplementedError("asset has " + std::to_string(m.params.relight_rays) +
                                    " relight rays per probe; bake with at most " + std::to_string(kMaxRelightRays));
  }
  AssetIndex index(memory);
  index.spacing_ = m.params.spacing;
  index.order_ = static_cast<uint32_t>(m.params.order);
  index.rays_ = static_cast<uint32_t>(m.params.relight_rays);
  index.width_ = static_cast<uint32_t>(m.width);
  index.height_ = static_cast<uint32_t>(m.height);
  LL_RETURN_IF_ERROR(index.add_objects(m));
  index.probes_.reserve(m.probes.size());
  for (const ProbeEntry& p : m.probes) index.probes_.push_back({p.position, p.relight});
  index.cells_.reserve(m.cells.size());
  for (const CellEntry& c : m.cells) {
    index.cells_.push_back(
        {c.chunk, c.level, c.cell, c.bounds, c.receivers, c.first_cluster, c.clusters, c.first_probe, c.probes});
  }
  index.clusters_.reserve(m.clusters.size());
  for (const ClusterEntry& c : m.clusters) index.clusters_.push_back({c.receivers, c.rank, c.probes});
  index.cell_probes_.assign(m.cell_probes.begin(), m.cell_probes.end());
  index.list_cells_of_probes();
  LL_RETURN_IF_ERROR(index.sort_digests());
  return index;
}

absl::StatusOr<std::shared_ptr<const AssetIndex>> AssetIndex::create_shared(const Manifest& manifest,
                                                                            std::pmr::memory_resource* memory) {
  LL_ASSIGN_OR_RETURN(AssetIndex index, create(manifest, memory));
  return std::allocate_shared<const AssetIndex>(std::pmr::polymorphic_allocator<AssetIndex>(memory), std::move(index));
}

/// A counting sort of the pairs of cell and probe.
void AssetIndex::list_cells_of_probes() {
  first_cell_.assign(probes_.size() + 1, 0);
  for (const uint32_t p : cell_probes_) ++first_cell_[p + 1];
  for (size_t p = 0; p < probes_.size(); ++p) first_cell_[p + 1] += first_cell_[p];
  probe_cells_.resize(cell_probes_.size());
  std::pmr::vector<uint32_t> next(first_cell_, first_cell_.get_allocator());
  for (uint32_t c = 0; c < cells_.size(); ++c) {
    for (const uint32_t p : probes_of(c)) probe_cells_[next[p]++] = c;
  }
}

absl::Status AssetIndex::add_objects(const Manifest& m) {
  uint64_t elements = 0;
  for (const ObjectEntry& entry : m.objects) {
    Object o;
    o.id = entry.id;
    o.width = static_cast<uint32_t>(entry.width);
    o.height = static_cast<uint32_t>(entry.height);
    o.x = static_cast<uint32_t>(entry.x);
    o.y = static_cast<uint32_t>(entry.y);
    o.surface = entry.surface;
    o.first_element = static_cast<uint32_t>(elements);
    if (entry.surface.size != 0) {
      const std::optional<uint32_t> texels = texels_of(entry.surface.size);
      if (!texels) return corrupt("surface of object '" + printable(entry.name) + "'", "no surface has that size");
      o.elements = *texels;
    }
    elements += o.elements;
    if (elements > kMaxElements) return absl::UnimplementedError("asset has more than 2^31 surface elements");
    by_id_.push_back(static_cast<uint32_t>(objects_.size()));
    objects_.push_back(o);
  }
  surface_elements_ = static_cast<uint32_t>(elements);
  std::sort(by_id_.begin(), by_id_.end(), [this](uint32_t a, uint32_t b) { return objects_[a].id < objects_[b].id; });
  const auto same_id = [this](uint32_t a, uint32_t b) { return objects_[a].id == objects_[b].id; };
  if (std::adjacent_find(by_id_.begin(), by_id_.end(), same_id) != by_id_.end()) {
    return corrupt("manifest", "two objects have the same identity");
  }
  return absl::OkStatus();
}

absl::Status AssetIndex::sort_digests() {
  const auto add = [this](const ChunkRef& ref, Kind kind, size_t index) {
    by_digest_.push_back({ref.digest, {kind, static_cast<uint32_t>(index)}});
  };
  for (size_t i = 0; i < objects_.size(); ++i) {
    if (objects_[i].surface.size != 0) add(objects_[i].surface, Kind::kSurface, i);
  }
  for (size_t i = 0; i < probes_.size(); ++i) add(probes_[i].relight, Kind::kRelight, i);
  for (size_t i = 0; i < cells_.size(); ++i) add(cells_[i].chunk, Kind::kCell, i);
  std::sort(by_digest_.begin(), by_digest_.end(), [](const Named& a, const Named& b) { return a.digest < b.digest; });
  // Surfaces tell their object, relight sets their position, cells their receivers: no two are alike.
  const auto same = [](const Named& a, const Named& b) { return a.digest == b.digest; };
  if (std::adjacent_find(by_digest_.begin(), by_digest_.end(), same) != by_digest_.end()) {
    return corrupt("manifest", "it names a chunk twice");
  }
  return absl::OkStatus();
}

std::optional<AssetIndex::Target> AssetIndex::find(const Digest& digest) const {
  const auto it = std::lower_bound(by_digest_.begin(), by_digest_.end(), digest,
                                   [](const Named& a, const Digest& d) { return a.digest < d; });
  if (it == by_digest_.end() || it->digest != digest) return std::nullopt;
  return it->target;
}

std::vector<AssetIndex::Kept> AssetIndex::kept_from(const AssetIndex& before) const {
  std::vector<Kept> kept;
  for (const Object& o : objects_) {
    const auto it = std::lower_bound(before.by_id_.begin(), before.by_id_.end(), o.id,
                                     [&before](uint32_t a, const Digest& id) { return before.objects_[a].id < id; });
    if (it == before.by_id_.end() || before.objects_[*it].id != o.id) continue;
    const Object& old = before.objects_[*it];
    if (old.width != o.width || old.height != o.height) continue;
    // One half from the front, the other from the back: what has changed lies somewhere in between.
    const uint32_t count = std::min(old.elements, o.elements), front = count / 2, back = count - front;
    kept.push_back({old.first_element, o.first_element, front});
    kept.push_back({old.first_element + old.elements - back, o.first_element + o.elements - back, back});
  }
  return kept;
}

absl::StatusOr<SurfaceChunk> AssetIndex::surface(uint32_t object, std::span<const uint8_t> bytes) const {
  const Object& o = objects_[object];
  const std::string what = "surface of object " + std::to_string(object);
  LL_RETURN_IF_ERROR(check_bytes(what, o.surface, bytes));
  LL_ASSIGN_OR_RETURN(SurfaceChunk chunk, in_context(what, decode_surface(bytes)));
  if (chunk.object != ChunkObject{o.id, o.width, o.height} || chunk.keys.size() != o.elements) {
    return corrupt(what, "it belongs to another object");
  }
  return chunk;
}

absl::StatusOr<CellChunk> AssetIndex::cell(uint32_t cell, std::span<const uint8_t> bytes) const {
  const Cell& c = cells_[cell];
  const std::string what = "cell " + std::to_string(cell);
  LL_RETURN_IF_ERROR(check_bytes(what, c.chunk, bytes));
  LL_ASSIGN_OR_RETURN(CellChunk chunk, in_context(what, decode_cell(bytes)));
  if (chunk.order != order_ || chunk.probe_count != c.probes || chunk.receivers.size() != c.receivers ||
      chunk.clusters.size() != c.clusters) {
    return corrupt(what, "it does not match the manifest");
  }
  return chunk;
}

absl::StatusOr<RelightChunk> AssetIndex::relight(uint32_t probe, std::span<const uint8_t> bytes) const {
  const std::string what = "relight set of probe " + std::to_string(probe);
  LL_RETURN_IF_ERROR(check_bytes(what, probes_[probe].relight, bytes));
  LL_ASSIGN_OR_RETURN(RelightChunk chunk, in_context(what, decode_relight(bytes)));
  if (chunk.rays.size() != rays_ || chunk.position != probes_[probe].position) {
    return corrupt(what, "it does not match the manifest");
  }
  return chunk;
}

absl::StatusOr<std::vector<uint32_t>> AssetIndex::objects_of(const std::vector<ChunkObject>& objects) const {
  std::vector<uint32_t> found;
  for (const ChunkObject& o : objects) {
    const auto it = std::lower_bound(by_id_.begin(), by_id_.end(), o.id,
                                     [this](uint32_t a, const Digest& id) { return objects_[a].id < id; });
    if (it == by_id_.end() || objects_[*it].id != o.id || objects_[*it].width != o.width ||
        objects_[*it].height != o.height) {
      return corrupt("chunk", "object " + o.id.hex().substr(0, 12) + " is not in the manifest at that size");
    }
    found.push_back(*it);
  }
  return found;
}

absl::StatusOr<std::vector<uint32_t>> AssetIndex::elements(const CellChunk& chunk, std::span<const uint32_t> objects,
                                                           std::span<const SurfaceKeys> keys) const {
  std::vector<uint32_t> elements;
  elements.reserve(chunk.receivers.size());
  for (const TexelRef& texel : chunk.receivers) {
    const auto& of_object = *keys[texel.slot];
    const size_t at = find_key(of_object, texel.key);
    if (at == of_object.size()) return corrupt("cell", "a receiver is no texel of its object's surface");
    elements.push_back(objects_[objects[texel.slot]].first_element + static_cast<uint32_t>(at));
  }
  return elements;
}

absl::StatusOr<std::vector<uint32_t>> AssetIndex::elements(const RelightChunk& chunk, std::span<const uint32_t> objects,
                                                           std::span<const SurfaceKeys> keys) const {
  std::vector<uint32_t> rays = chunk.rays;
  if (!to_elements(chunk.objects, objects, keys, &rays)) {
    return corrupt("relight set", "a ray ends at no texel of its object's surface");
  }
  return rays;
}

absl::StatusOr<std::vector<uint32_t>> AssetIndex::near_elements(const CellChunk& chunk,
                                                                std::span<const uint32_t> objects,
                                                                std::span<const SurfaceKeys> keys) const {
  std::vector<uint32_t> texels = chunk.near_texels;
  if (!to_elements(chunk.objects, objects, keys, &texels)) {
    return corrupt("cell", "a near texel is no texel of its object's surface");
  }
  return texels;
}

bool AssetIndex::to_elements(const std::vector<ChunkObject>& named, std::span<const uint32_t> objects,
                             std::span<const SurfaceKeys> keys, std::vector<uint32_t>* texels) const {
  const TexelCodes codes(named);
  for (uint32_t& texel : *texels) {
    if (texel == RelightChunk::kDead || texel == RelightChunk::kSky) continue;
    const auto [slot, key] = codes.texel(texel);
    const size_t at = find_key(*keys[slot], key);
    if (at == keys[slot]->size()) return false;
    texel = objects_[objects[slot]].first_element + static_cast<uint32_t>(at);
  }
  return true;
}

}  // namespace lightloom
