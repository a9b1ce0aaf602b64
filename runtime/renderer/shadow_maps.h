// Depth as the lights see it: an array of D32_SFLOAT images, nearer is smaller, no bias in them.
#pragma once

#include <vector>

#include "core/scene/scene.h"
#include "runtime/renderer/gpu.h"
#include "runtime/renderer/materials.h"
#include "runtime/renderer/mesh.h"
#include "runtime/renderer/pipelines.h"
#include "runtime/renderer/shadow_views.h"

namespace lightloom::renderer {

class ShadowMaps {
 public:
  /// `size` texels along a side; 0: as many as a fixed amount of memory allows, 2048 at most.
  static absl::StatusOr<ShadowMaps> create(const Gpu& gpu, uint32_t views, uint32_t size);

  uint32_t size() const { return image_.width; }
  /// A 2D array, one layer per view.
  VkImageView view() const { return image_.view.get(); }

  /// Draws these views and leaves the array to be sampled (kSampled). Both sides of every triangle block; the holes
  /// of masked materials do not. `keep`: layers of other views hold what was drawn before.
  void record(VkCommandBuffer commands, const std::vector<gpu::ViewData>& views, bool keep, const Pipelines& pipelines,
              VkBuffer vertices, const Mesh& mesh, const Scene& scene, const Materials& materials) const;

 private:
  Texture2D image_;
  std::vector<Owned<VkImageView>> layers_;
};

}  // namespace lightloom::renderer
