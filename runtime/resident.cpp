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

}  // namespace lightloom
