// A level as a regular grid of voxels: which ones surfaces cross, and which of the empty ones connect to given points.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/vec.h"
#include "core/scene/scene.h"

namespace lightloom {

class Voxels {
 public:
  using Index = std::array<int32_t, 3>;

  /// Of the scene's static triangles, with an empty layer around. `side` in metres.
  /// REQUIRES: count_for(bounds, side) ≤ kMost.
  Voxels(const Scene& scene, float side);
  static constexpr double kMost = 1 << 26;
  static double count_for(const Aabb& bounds, float side);

  /// Connects the voxel at p, and what empty voxels reach from it through their faces, unless a surface crosses it.
  void flood(Vec3 p);
  bool empty(Vec3 p) const;

  /// Centres of the connected voxels with a surface in one of the 26 voxels around, in x, y, z order.
  std::vector<Vec3> connected_near_surfaces() const;

 private:
  enum State : uint8_t { kEmpty, kSurface, kConnected };

  Index index_of(Vec3 p) const;
  Vec3 centre(Index i) const;
  size_t at(Index i) const;
  bool inside(Index i) const;
  void mark(Vec3 a, Vec3 b, Vec3 c);

  Vec3 origin_;
  float side_;
  Index size_{};
  std::vector<uint8_t> state_;
};

}  // namespace lightloom
