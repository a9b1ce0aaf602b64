// Coloured lines and triangles over a picture, hidden by what stands before them: overlays.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/vec.h"
#include "core/scene/scene.h"
#include "runtime/renderer/gpu.h"

namespace lightloom::renderer {

using Rgba = std::array<uint8_t, 4>;  ///< as shown: sRGB, straight alpha

struct ColouredVertex {
  Vec3 position;
  Rgba colour{255, 255, 255, 255};
};
static_assert(sizeof(ColouredVertex) == 16);

struct Marks {
  std::vector<ColouredVertex> lines;      ///< two a line
  std::vector<ColouredVertex> triangles;  ///< three each

  void line(Vec3 a, Vec3 b, Rgba colour);
  /// The twelve edges.
  void box(const Aabb& box, Rgba colour);
  /// A square in the plane across `normal`, `half` metres to each side.
  void square(Vec3 centre, Vec3 normal, float half, Rgba colour);
  /// A solid octahedron, its corners `radius` from its centre.
  void octahedron(Vec3 centre, float radius, Rgba colour);
  void append(const Marks& other);
};

class Lines {
 public:
  static absl::StatusOr<Lines> create(Gpu* gpu, VkFormat colour_format);

  /// Nothing recorded may be running.
  absl::Status set(const Marks& marks);
  /// Draws over `target`, which is and stays kColour; `depth`, of the same size, is kDepth with 1 near.
  void record(VkCommandBuffer commands, const Camera& camera, const Texture2D& target, const Texture2D& depth) const;

 private:
  Gpu* gpu_ = nullptr;
  Owned<VkPipelineLayout> layout_;
  Owned<VkPipeline> lines_, triangles_;
  Buffer vertices_;                               ///< the triangles', then the lines'
  uint32_t line_count_ = 0, triangle_count_ = 0;  ///< vertices
};

}  // namespace lightloom::renderer
