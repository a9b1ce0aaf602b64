#include "runtime/resident.h"

#include <memory>
#include <string>

#include "runtime/boundary.h"

namespace lightloom {

absl::StatusOr<AssetIndex::Target> find_chunk(const AssetIndex& index, const Digest& digest) {
  if (const auto target = index.find(digest)) return *target;
  return unknown_chunk("chunk " + digest.hex() + " is not in the manifest; was the level baked anew?");
}

SurfaceKeys keys_of_surface(const SurfaceChunk& chunk, std::pmr::memory_resource* memory) {
  const std::pmr::polymorphic_allocator<std::pmr::vector<uint32_t>> allocator(memory);
  return std::allocate_shared<std::pmr::vector<uint32_t>>(allocator, chunk.keys.begin(), chunk.keys.end());
}

absl::StatusOr<std::vector<SurfaceKeys>> keys_of_objects(const AssetIndex& index, std::span<const uint32_t> objects,
                                                         absl::FunctionRef<SurfaceKeys(uint32_t)> resident) {
  std::vector<SurfaceKeys> keys;
  for (const uint32_t o : objects) {
    keys.push_back(resident(o));
    if (index.objects()[o].surface.size == 0) {
      keys.back() = std::make_shared<const std::pmr::vector<uint32_t>>();
    } else if (keys.back() == nullptr) {
      return not_ready("the surface chunk of object " + std::to_string(o) + " is not resident; load it first");
    }
  }
  return keys;
}

absl::StatusOr<SourceCell> resolve_cell(const AssetIndex& index, uint32_t cell, std::span<const uint8_t> bytes,
                                        absl::FunctionRef<SurfaceKeys(uint32_t)> resident) {
  SourceCell out;
  LL_ASSIGN_OR_RETURN(out.chunk, index.cell(cell, bytes));
  LL_ASSIGN_OR_RETURN(const std::vector<uint32_t> objects, index.objects_of(out.chunk.objects));
  LL_ASSIGN_OR_RETURN(const std::vector<SurfaceKeys> keys, keys_of_objects(index, objects, resident));
  LL_ASSIGN_OR_RETURN(out.elements, index.elements(out.chunk, objects, keys));
  LL_ASSIGN_OR_RETURN(out.near_elements, index.near_elements(out.chunk, objects, keys));
  const auto probes = index.probes_of(cell);
  out.probes.assign(probes.begin(), probes.end());
  return out;
}

absl::StatusOr<std::vector<uint32_t>> resolve_relight(const AssetIndex& index, uint32_t probe,
                                                      std::span<const uint8_t> bytes,
                                                      absl::FunctionRef<SurfaceKeys(uint32_t)> resident) {
  LL_ASSIGN_OR_RETURN(const RelightChunk chunk, index.relight(probe, bytes));
  LL_ASSIGN_OR_RETURN(const std::vector<uint32_t> objects, index.objects_of(chunk.objects));
  LL_ASSIGN_OR_RETURN(const std::vector<SurfaceKeys> keys, keys_of_objects(index, objects, resident));
  return index.elements(chunk, objects, keys);
}

absl::Status late_base() {
  return absl::InvalidArgumentError("a base must be loaded before other details of its chunk; unload that first");
}

lightloom_counts counts_of(const AssetIndex& index) {
  lightloom_counts out{};
  out.surface_elements = index.surface_elements();
  for (const AssetIndex::Cell& c : index.cells()) out.receivers += c.receivers;
  out.probes = static_cast<uint32_t>(index.probes().size());
  out.cells = static_cast<uint32_t>(index.cells().size());
  out.clusters = index.clusters();
  out.sh_order = index.order();
  out.image_width = index.width();
  out.image_height = index.height();
  return out;
}

}  // namespace lightloom
