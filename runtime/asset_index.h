// What a runtime keeps of a manifest: which chunk is what, and how surface elements are numbered; and how chunks are
// checked against it. Everything from outside is checked here.
#pragma once

#include <cstdint>
#include <memory>
#include <memory_resource>
#include <optional>
#include <span>
#include <vector>

#include "core/asset/chunk.h"
#include "core/asset/manifest.h"

namespace lightloom {

/// The texel keys of an object's surface chunk, ascending.
using SurfaceKeys = std::shared_ptr<const std::pmr::vector<uint32_t>>;

/// Immutable, so that any thread may use it.
class AssetIndex {
 public:
  struct Object {
    Digest id;
    uint32_t width = 0, height = 0, x = 0, y = 0;
    ChunkRef surface;
    uint32_t first_element = 0, elements = 0;
  };
  struct Probe {
    Vec3 position;
    ChunkRef relight;
  };
  struct Cell {
    ChunkRef chunk;
    int32_t level = 0;  ///< of the octree: it covers [i, i+1)·cell_side() on each axis
    GridCell place{};
    Aabb bounds;  ///< of its receivers
    uint32_t receivers = 0;
    uint32_t first_cluster = 0, clusters = 0;
    uint32_t first_probe = 0, probes = 0;  ///< range of cell_probes()
  };
  struct Cluster {
    uint32_t receivers = 0, rank = 0, probes = 0;
  };
  enum class Kind { kSurface, kRelight, kCell };
  struct Target {
    Kind kind;
    uint32_t index;
  };

  /// DataLoss: the manifest contradicts itself. Unimplemented: beyond this reader's limits.
  static absl::StatusOr<std::shared_ptr<const AssetIndex>> create_shared(const Manifest& manifest,
                                                                         std::pmr::memory_resource* memory);
  static absl::StatusOr<AssetIndex> create(const Manifest& manifest, std::pmr::memory_resource* memory);

  float spacing() const { return spacing_; }  ///< of probes, metres
  uint32_t order() const { return order_; }
  uint32_t rays() const { return rays_; }
  uint32_t surface_elements() const { return surface_elements_; }
  uint32_t clusters() const { return static_cast<uint32_t>(clusters_.size()); }
  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }
  std::span<const Object> objects() const { return objects_; }
  std::span<const Probe> probes() const { return probes_; }
  std::span<const Cell> cells() const { return cells_; }
  std::span<const Cluster> clusters_of(uint32_t cell) const {
    return std::span(clusters_).subspan(cells_[cell].first_cluster, cells_[cell].clusters);
  }
  std::span<const uint32_t> cell_probes() const { return cell_probes_; }
  std::span<const uint32_t> probes_of(uint32_t cell) const {
    return cell_probes().subspan(cells_[cell].first_probe, cells_[cell].probes);
  }
  /// The cells whose probe list has the probe, ascending; one as often as it is in the list.
  std::span<const uint32_t> cells_of(uint32_t probe) const {
    return std::span(probe_cells_).subspan(first_cell_[probe], first_cell_[probe + 1] - first_cell_[probe]);
  }
  std::optional<Target> find(const Digest& digest) const;

  /// Surface elements that are those of another asset.
  struct Kept {
    uint32_t from = 0, to = 0, count = 0;
  };
  /// Of `before` those whose object is here too. Where a few of an object's texels are others (something has moved onto
  /// them), the rest are taken in their order: neighbours' light, instead of none.
  std::vector<Kept> kept_from(const AssetIndex& before) const;

  /// Decoded and compared with the manifest. DataLoss if anything is wrong; Unimplemented for newer versions.
  absl::StatusOr<SurfaceChunk> surface(uint32_t object, std::span<const uint8_t> bytes) const;
  absl::StatusOr<CellChunk> cell(uint32_t cell, std::span<const uint8_t> bytes) const;
  absl::StatusOr<RelightChunk> relight(uint32_t probe, std::span<const uint8_t> bytes) const;

  /// Indices into objects() of the objects that a chunk names. DataLoss if one is not in the manifest at that size.
  absl::StatusOr<std::vector<uint32_t>> objects_of(const std::vector<ChunkObject>& objects) const;

  /// The surface element of each receiver, or each ray (RelightChunk::kDead and kSky stay). `objects` is the chunk's
  /// objects_of and `keys` theirs, none null. DataLoss if a texel is not in its object's surface.
  absl::StatusOr<std::vector<uint32_t>> elements(const CellChunk& chunk, std::span<const uint32_t> objects,
                                                 std::span<const SurfaceKeys> keys) const;
  absl::StatusOr<std::vector<uint32_t>> elements(const RelightChunk& chunk, std::span<const uint32_t> objects,
                                                 std::span<const SurfaceKeys> keys) const;
  /// Likewise, of CellChunk::near_texels.
  absl::StatusOr<std::vector<uint32_t>> near_elements(const CellChunk& chunk, std::span<const uint32_t> objects,
                                                      std::span<const SurfaceKeys> keys) const;

 private:
  explicit AssetIndex(std::pmr::memory_resource* memory)
      : objects_(memory),
        by_id_(memory),
        probes_(memory),
        cells_(memory),
        clusters_(memory),
        cell_probes_(memory),
        first_cell_(memory),
        probe_cells_(memory),
        by_digest_(memory) {}
  absl::Status add_objects(const Manifest& manifest);
  /// Codes of RelightChunk::rays to elements; false if one is no texel of its object's surface.
  bool to_elements(const std::vector<ChunkObject>& named, std::span<const uint32_t> objects,
                   std::span<const SurfaceKeys> keys, std::vector<uint32_t>* texels) const;
  void list_cells_of_probes();
  absl::Status sort_digests();

  struct Named {
    Digest digest;
    Target target;
  };
  float spacing_ = 0;
  uint32_t order_ = 0, rays_ = 0, surface_elements_ = 0, width_ = 0, height_ = 0;
  std::pmr::vector<Object> objects_;
  std::pmr::vector<uint32_t> by_id_;  ///< into objects_, sorted by id
  std::pmr::vector<Probe> probes_;
  std::pmr::vector<Cell> cells_;
  std::pmr::vector<Cluster> clusters_;
  std::pmr::vector<uint32_t> cell_probes_;
  std::pmr::vector<uint32_t> first_cell_;  ///< per probe and one more: range of probe_cells_
  std::pmr::vector<uint32_t> probe_cells_;
  std::pmr::vector<Named> by_digest_;  ///< sorted
};

}  // namespace lightloom
