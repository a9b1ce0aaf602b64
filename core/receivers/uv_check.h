// Judges the TEXCOORD_1 that objects bring.
#pragma once

#include <cstdint>
#include <vector>

#include "core/receivers/atlas.h"
#include "core/scene/scene.h"

namespace lightloom {

/// True if the object has a TEXCOORD_1 for every vertex, all in [0,1] up to rounding.
bool has_unit_uv1(const Object& object);

/// The object's TEXCOORD_1 in texels of a width × height image. REQUIRES: has_unit_uv1(object).
LightmapUv scaled_uv1(const Object& object, int width, int height);

/// Sum of the triangles' areas in [0,1]².
double uv1_area(const Object& object);

/// Counts texel centres that different owners cover.
class TexelClaims {
 public:
  TexelClaims(int width, int height);

  /// Covers the triangles' texels for `owner`.
  void claim(const LightmapUv& uv, uint32_t owner);
  /// The same, each triangle an owner of its own: overlap within one object counts.
  void claim_each(const LightmapUv& uv);

  /// True if no more than one in a thousand of the covered texels has two owners: exporters leave a few such
  /// texels where charts come close. Also false if texels were painted over so often that the count was given
  /// up.
  bool disjoint() const;

 private:
  void paint(const std::array<Vec2, 3>& corners, uint32_t owner);

  int width_, height_;
  std::vector<uint32_t> owner_;  // 0: nobody
  uint64_t painted_ = 0, covered_ = 0, shared_ = 0;
};

}  // namespace lightloom
