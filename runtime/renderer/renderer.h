// A small forward renderer without a window, as an engine would have one: shadow maps, direct light per pixel, and
// indirect light from the irradiance E of a lightmap image. It stands on the engine's side of lightloom.h.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "core/receivers/layout.h"
#include "core/scene/picture.h"
#include "core/scene/scene.h"
#include "runtime/renderer/gpu.h"
#include "runtime/renderer/materials.h"
#include "runtime/renderer/mesh.h"
#include "runtime/renderer/pipelines.h"
#include "runtime/renderer/shadow_maps.h"
#include "runtime/renderer/shadow_views.h"

namespace lightloom::renderer {

struct PictureOptions {
  int width = 960;  ///< pixels; height = width ÷ aspect of the camera
  int samples = 4;  ///< per pixel, rounded down to a square number
  Layer layer = Layer::kFull;
};

class Renderer {
 public:
  /// Uploads the static triangles and the textures. Keeps references to `gpu` and `scene`. What may change between
  /// pictures: light positions, directions, colours; material factors; the sky. `shadow_size`: texels along a side of
  /// each shadow map, 0: by the number of lights.
  static absl::StatusOr<std::unique_ptr<Renderer>> create(Gpu* gpu, const Scene& scene, const AtlasLayout& layout,
                                                          uint32_t shadow_size = 0);

  /// E per texel of the lightmap image, W/m²; R, G, B, A: 1 where E was computed, 0 where it was filled in.
  absl::Status set_irradiance(const Image& fronts, const Image& backs);
  /// The same as a 2D array of two layers that someone else writes, in `layout` when record_forward() runs.
  void use_irradiance(VkImageView view, VkImageLayout layout);

  /// Takes over lights, factors and sky as they are now. Nothing recorded may be running.
  absl::Status update_lights();
  /// After update_lights().
  const ShadowViews& shadow_views() const { return views_; }
  const ShadowMaps& shadow_maps() const { return *shadow_maps_; }
  /// Only those whose light has moved since. What is recorded must run.
  void record_shadows(VkCommandBuffer commands) const;

  /// A whole frame: update_lights, shadow maps, what `between` records (lightloom, for instance), the forward pass.
  /// Linear values, R, G, B.
  absl::StatusOr<Image> render(const Camera& camera, const PictureOptions& options,
                               const std::function<absl::Status(VkCommandBuffer)>& between = nullptr);

  /// The same in steps, for pictures that stay on the device. Nothing recorded may be running in the first two.
  absl::Status set_size(uint32_t width, uint32_t height);
  absl::Status set_view(const Camera& camera, Layer layer);
  /// Leaves colour() as kSampled and depth() as kDepth.
  absl::Status record(VkCommandBuffer commands, const std::function<absl::Status(VkCommandBuffer)>& between) const;
  const Texture2D& colour() const { return colour_; }  ///< kColourFormat, linear radiance
  const Texture2D& depth() const { return depth_; }    ///< kDepthFormat, 1 near
  /// colour() as it was drawn last. Waits.
  absl::StatusOr<Image> read() const;

  /// Takes over where an object's vertices are now; its triangles are as many as they were.
  absl::Status update_object(size_t object);

 private:
  Renderer(Gpu* gpu, const Scene& scene) : gpu_(gpu), scene_(scene) {}
  absl::Status make_frame_set();
  void bind_image(uint32_t binding, VkSampler sampler, VkImageView view, VkImageLayout layout) const;
  void record_forward(VkCommandBuffer commands) const;
  void record_read(VkCommandBuffer commands) const;
  Image resolve(int width, int height, int side) const;

  Gpu* gpu_;
  const Scene& scene_;
  AtlasLayout layout_;
  Pipelines pipelines_;
  Mesh mesh_;  ///< its vertices are on the device only
  Buffer vertices_;
  std::unique_ptr<Materials> materials_;
  std::unique_ptr<ShadowMaps> shadow_maps_;
  ShadowViews views_;
  mutable std::optional<std::vector<gpu::ViewData>> drawn_;  ///< what the shadow maps hold; none: nothing of use
  std::vector<LightType> light_types_;
  Aabb bounds_;
  Buffer frame_data_, light_data_, view_data_;
  Texture2D irradiance_;
  Owned<VkSampler> nearest_;
  Owned<VkDescriptorPool> pool_;
  VkDescriptorSet frame_set_ = VK_NULL_HANDLE;
  Texture2D colour_, depth_;
  Vec3 background_;
  Buffer readback_;
};

}  // namespace lightloom::renderer
