// Where each object's lightmap lies in the image that users see.
//
// Receivers are keyed by (object, local texel); the placement of an object's texels in the output image is a
// separate table, so that moving one object in the image rebakes nothing.
#pragma once

#include <map>
#include <vector>

#include "core/base/status.h"
#include "core/receivers/atlas.h"
#include "core/scene/scene.h"

namespace lightloom {

enum class LayoutMode : uint8_t {
  kScene,      ///< one TEXCOORD_1 atlas shared by all objects; local texels are those of the image
  kPerObject,  ///< a lightmap per object, packed
};

inline constexpr int kMaxLightmapSide = 8192;  ///< of a scene atlas, or of one object's lightmap; texels

struct Placement {
  int x = 0, y = 0;  ///< of local texel (0,0), texels of the image
  bool operator==(const Placement&) const = default;
};

/// Per-object arrays follow Scene::objects. Objects without a lightmap (dynamic, volume, none) have
/// uv.corners empty and size 0.
struct AtlasLayout {
  LayoutMode mode = LayoutMode::kScene;
  int width = 0, height = 0;   ///< of the output image; 0 if no object has a lightmap
  float texels_per_metre = 0;  ///< what the sizes follow, before Object::texel_scale
  std::vector<LightmapUv> uv;
  std::vector<Placement> placements;
};

struct LayoutOptions {
  int lightmap_size = 0;  ///< side of the scene atlas, texels; 0: from texels_per_metre
  /// 0: chosen from the scene's area so that its objects have about lightmap_size² texels, 2^16 if that is 0
  /// too, and rounded so that small edits do not change it.
  float texels_per_metre = 0;
  /// Placements of an earlier layout of mode kPerObject, by object id with the size it had; objects found
  /// here with equal size keep their place, others take free space, the image grows in height only. With
  /// earlier_width > 0 the mode stays kPerObject.
  struct Earlier {
    Placement placement;
    int width = 0, height = 0;
  };
  std::map<Digest, Earlier> earlier;
  int earlier_width = 0, earlier_height = 0;
};

/// kScene if every receiving object has TEXCOORD_1 in [0,1] and charts of different objects do not share
/// texels, else kPerObject (objects with their own TEXCOORD_1 that does not overlap itself keep it, others
/// get generate_atlas()). "Share" is judged by texel centres and forgives one in a thousand. Errors:
/// lightmaps too large for an image of 16384 × 16384, numbers out of range.
absl::StatusOr<AtlasLayout> make_layout(const Scene& scene, const LayoutOptions& options);

}  // namespace lightloom
