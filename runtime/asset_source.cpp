#include "runtime/asset_source.h"

#include <algorithm>
#include <string>
#include <utility>

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
absl::Status in_context(const std::string& what, const absl::Status& status) {
  return absl::Status(status.code(), what + ": " + std::string(status.message()));
}

/// Index of `key` in sorted `keys`, or keys.size().
size_t find_key(const std::vector<uint32_t>& keys, uint32_t key) {
  const auto it = std::lower_bound(keys.begin(), keys.end(), key);
  return it != keys.end() && *it == key ? static_cast<size_t>(it - keys.begin()) : keys.size();
}

}  // namespace

absl::Status mark_receivers(uint32_t index, const SourceCell& cell, std::vector<bool>* received) {
  for (const uint32_t element : cell.elements) {
    if ((*received)[element]) return corrupt("cell " + std::to_string(index), "a receiver occurs twice");
    (*received)[element] = true;
  }
  return absl::OkStatus();
}

absl::StatusOr<AssetSource> AssetSource::open(std::span<const uint8_t> manifest, ReadChunk read) {
  AssetSource source;
  LL_ASSIGN_OR_RETURN(source.manifest_, decode_manifest(manifest));
  source.read_ = std::move(read);
  const Manifest& m = source.manifest_;
  if (m.params.relight_rays > kMaxRelightRays) {
    return absl::UnimplementedError("asset has " + std::to_string(m.params.relight_rays) +
                                    " relight rays per probe; bake with at most " + std::to_string(kMaxRelightRays));
  }

  uint64_t elements = 0;
  for (const ObjectEntry& entry : m.objects) {
    ObjectTexels object;
    object.id = entry.id;
    object.width = static_cast<uint32_t>(entry.width);
    object.height = static_cast<uint32_t>(entry.height);
    object.first_element = static_cast<uint32_t>(elements);
    if (entry.surface.size != 0) {
      const std::string what = "surface of object '" + entry.name + "'";
      auto bytes = source.chunk(entry.surface);
      if (!bytes.ok()) return in_context(what, bytes.status());
      auto surface = decode_surface(*bytes);
      if (!surface.ok()) return in_context(what, surface.status());
      if (surface->object != ChunkObject{object.id, object.width, object.height}) {
        return corrupt(what, "it belongs to another object");
      }
      object.keys = std::move(surface->keys);
    }
    elements += object.keys.size();
    if (elements > kMaxElements) return absl::UnimplementedError("asset has more than 2^31 surface elements");
    source.objects_.push_back(std::move(object));
  }
  source.surface_elements_ = static_cast<uint32_t>(elements);

  const auto by_id = [](const ObjectTexels& a, const ObjectTexels& b) { return a.id < b.id; };
  std::sort(source.objects_.begin(), source.objects_.end(), by_id);
  const auto same_id = [](const ObjectTexels& a, const ObjectTexels& b) { return a.id == b.id; };
  if (std::adjacent_find(source.objects_.begin(), source.objects_.end(), same_id) != source.objects_.end()) {
    return corrupt("manifest", "two objects have the same identity");
  }
  return source;
}

absl::StatusOr<SourceCell> AssetSource::cell(uint32_t index) const {
  const CellEntry& entry = manifest_.cells[index];
  const std::string what = "cell " + std::to_string(index);
  const auto bytes = chunk(entry.chunk);
  if (!bytes.ok()) return in_context(what, bytes.status());
  auto decoded = decode_cell(*bytes);
  if (!decoded.ok()) return in_context(what, decoded.status());

  SourceCell cell;
  cell.chunk = *std::move(decoded);
  if (cell.chunk.order != static_cast<uint32_t>(manifest_.params.order) || cell.chunk.probe_count != entry.probes ||
      cell.chunk.receivers.size() != entry.receivers || cell.chunk.clusters.size() != entry.clusters) {
    return corrupt(what, "it does not match the manifest");
  }
  const auto objects = resolve(cell.chunk.objects);
  if (!objects.ok()) return in_context(what, objects.status());
  cell.elements.reserve(cell.chunk.receivers.size());
  for (const TexelRef& texel : cell.chunk.receivers) {
    const ObjectTexels& object = *(*objects)[texel.slot];
    const size_t at = find_key(object.keys, texel.key);
    if (at == object.keys.size()) return corrupt(what, "a receiver is no texel of its object's surface");
    cell.elements.push_back(object.first_element + static_cast<uint32_t>(at));
  }
  const auto probes = manifest_.cell_probes.begin() + static_cast<int64_t>(entry.first_probe);
  cell.probes.assign(probes, probes + static_cast<int64_t>(entry.probes));
  return cell;
}

absl::StatusOr<std::vector<uint32_t>> AssetSource::relight(uint32_t probe) const {
  const ProbeEntry& entry = manifest_.probes[probe];
  const std::string what = "relight set of probe " + std::to_string(probe);
  const auto bytes = chunk(entry.relight);
  if (!bytes.ok()) return in_context(what, bytes.status());
  auto decoded = decode_relight(*bytes);
  if (!decoded.ok()) return in_context(what, decoded.status());
  if (decoded->rays.size() != static_cast<size_t>(manifest_.params.relight_rays) ||
      decoded->position != entry.position) {
    return corrupt(what, "it does not match the manifest");
  }
  const auto objects = resolve(decoded->objects);
  if (!objects.ok()) return in_context(what, objects.status());

  // First ray code of each object, then of none.
  std::vector<uint64_t> base = {0};
  for (const ObjectTexels* o : *objects) base.push_back(base.back() + 2ull * o->width * o->height);
  std::vector<uint32_t> rays = std::move(decoded->rays);
  for (uint32_t& ray : rays) {
    if (ray == RelightChunk::kDead || ray == RelightChunk::kSky) continue;
    const auto after = std::upper_bound(base.begin(), base.end(), ray);
    const size_t slot = static_cast<size_t>(after - base.begin()) - 1;
    const ObjectTexels& object = *(*objects)[slot];
    const size_t at = find_key(object.keys, static_cast<uint32_t>(ray - base[slot]));
    if (at == object.keys.size()) return corrupt(what, "a ray ends at no texel of its object's surface");
    ray = object.first_element + static_cast<uint32_t>(at);
  }
  return rays;
}

absl::StatusOr<std::vector<uint8_t>> AssetSource::chunk(const ChunkRef& ref) const {
  if (ref.size > kMaxChunkBytes) return corrupt("chunk " + ref.digest.hex(), "its size is above 1 GiB");
  std::vector<uint8_t> bytes(ref.size);
  LL_RETURN_IF_ERROR(read_(ref, bytes));
  if (sha256(bytes) != ref.digest) return corrupt("chunk " + ref.digest.hex(), "its bytes have another SHA-256");
  return bytes;
}

absl::StatusOr<std::vector<const AssetSource::ObjectTexels*>> AssetSource::resolve(
    const std::vector<ChunkObject>& objects) const {
  std::vector<const ObjectTexels*> resolved;
  for (const ChunkObject& o : objects) {
    const auto it = std::lower_bound(objects_.begin(), objects_.end(), o.id,
                                     [](const ObjectTexels& a, const Digest& id) { return a.id < id; });
    if (it == objects_.end() || it->id != o.id || it->width != o.width || it->height != o.height) {
      return corrupt("chunk", "object " + o.id.hex().substr(0, 12) + " is not in the manifest at that size");
    }
    resolved.push_back(&*it);
  }
  return resolved;
}

}  // namespace lightloom
