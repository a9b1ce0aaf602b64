// What can be seen from where: the relight rays of the probes around a point end at what is visible from about there.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/half.h"
#include "runtime/asset_index.h"

namespace lightloom {

class Sight {
 public:
  explicit Sight(const AssetIndex& index);

  /// Where an object's surface elements are. Before the probes that see it.
  void add_surface(uint32_t object, std::span<const Vec3> positions);
  /// A probe's rays: surface elements, RelightChunk::kDead or kSky.
  void add_probe(uint32_t probe, std::span<const uint32_t> rays);

  /// Per cell, how much of it there is to see from `eye`: the root of the share of all directions in which it is seen,
  /// about: between the error on the screen, where what is far is small, and the error of E, where it is not. And a little
  /// for each cell that is near, for as long as no probes are known.
  std::vector<float> importance(Vec3 eye) const;

 private:
  struct Seen {
    uint32_t cell;
    float share;  ///< of the probe's rays
  };
  struct Probe {
    std::vector<Seen> cells;  ///< empty: not known
    std::vector<Half> free;   ///< per coarse ray, metres to where it ends; 65504 for the sky
  };
  uint32_t find_cell(Vec3 position) const;
  bool sees(uint32_t probe, Vec3 eye, float distance) const;

  const AssetIndex& index_;
  std::vector<uint32_t> coarse_;    ///< coarse_rays()
  std::vector<Vec3> directions_;    ///< of these
  std::vector<Vec3> positions_;     ///< per surface element
  std::vector<uint32_t> cell_of_;   ///< per surface element
  std::vector<int32_t> levels_;     ///< of the octree, those that cells have
  std::vector<uint32_t> by_place_;  ///< cells by level and place
  std::vector<Probe> probes_;
};

}  // namespace lightloom
