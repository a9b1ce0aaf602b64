// The penumbra of the direct pass: an occluder that covers half of the shadow map, and elements across its edge.
#include <cmath>
#include <set>

#include "tests/unit/runtime/test_engine.h"

namespace lightloom {
namespace {

using testing::Engine;

constexpr uint32_t kMapSize = 64;
/// The view is 6.4 m wide.
constexpr double kTexel = 0.1;
constexpr int kElements = 121;
constexpr double kStep = 0.0093;  // no multiple of a texel, so that no lookup lies on an edge of texels

/// Depth images that shaders read: layer 0 is near in columns [0, 32), layer 1 in rows [0, 32); the rest is far.
class HalfPlanes {
 public:
  explicit HalfPlanes(Engine* engine) : context_(engine->context()) {
    const VulkanTable& vk = context_.vk;
    auto create = vulkan_struct<VkImageCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO);
    create.imageType = VK_IMAGE_TYPE_2D;
    create.format = VK_FORMAT_D32_SFLOAT;
    create.extent = {kMapSize, kMapSize, 1};
    create.mipLevels = 1;
    create.arrayLayers = 2;
    create.samples = VK_SAMPLE_COUNT_1_BIT;
    create.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
    EXPECT_EQ(vk.CreateImage(context_.device, &create, nullptr, &image_), VK_SUCCESS);
    VkMemoryRequirements need;
    vk.GetImageMemoryRequirements(context_.device, image_, &need);
    auto allocate = vulkan_struct<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
    allocate.allocationSize = need.size;
    EXPECT_EQ(vk.AllocateMemory(context_.device, &allocate, nullptr, &memory_), VK_SUCCESS);
    EXPECT_EQ(vk.BindImageMemory(context_.device, image_, memory_, 0), VK_SUCCESS);
    auto view = vulkan_struct<VkImageViewCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO);
    view.image = image_;
    view.viewType = VK_IMAGE_VIEW_TYPE_2D_ARRAY;
    view.format = VK_FORMAT_D32_SFLOAT;
    view.subresourceRange = {VK_IMAGE_ASPECT_DEPTH_BIT, 0, 1, 0, 2};
    EXPECT_EQ(vk.CreateImageView(context_.device, &view, nullptr, &view_), VK_SUCCESS);
    fill(engine);
  }
  ~HalfPlanes() {
    context_.vk.DestroyImageView(context_.device, view_, nullptr);
    context_.vk.DestroyImage(context_.device, image_, nullptr);
    context_.vk.FreeMemory(context_.device, memory_, nullptr);
  }
  HalfPlanes(const HalfPlanes&) = delete;
  HalfPlanes& operator=(const HalfPlanes&) = delete;
  VkImageView view() const { return view_; }

 private:
  void fill(Engine* engine) {
    constexpr uint64_t kTexels = uint64_t{kMapSize} * kMapSize;
    const Buffer depths = *Buffer::create(&context_, 2 * kTexels * sizeof(float), BufferUse::kHost);
    float* const d = reinterpret_cast<float*>(depths.mapped());
    for (uint64_t t = 0; t < kTexels; ++t) {
      d[t] = t % kMapSize < kMapSize / 2 ? 0.25f : 1.0f;
      d[kTexels + t] = t / kMapSize < kMapSize / 2 ? 0.25f : 1.0f;
    }
    const auto copy_image = engine->function<PFN_vkCmdCopyBufferToImage>("vkCmdCopyBufferToImage");
    engine->run([&](VkCommandBuffer commands) {
      auto barrier = vulkan_struct<VkImageMemoryBarrier>(VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER);
      barrier.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
      barrier.newLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
      barrier.image = image_;
      barrier.subresourceRange = {VK_IMAGE_ASPECT_DEPTH_BIT, 0, 1, 0, 2};
      context_.vk.CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0,
                                     nullptr, 0, nullptr, 1, &barrier);
      VkBufferImageCopy region{};
      region.imageSubresource = {VK_IMAGE_ASPECT_DEPTH_BIT, 0, 0, 2};
      region.imageExtent = {kMapSize, kMapSize, 1};
      copy_image(commands, depths.handle(), image_, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region);
      barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
      barrier.dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
      barrier.oldLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
      barrier.newLayout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
      context_.vk.CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0,
                                     0, nullptr, 0, nullptr, 1, &barrier);
    });
  }

  Context& context_;
  VkImage image_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  VkImageView view_ = VK_NULL_HANDLE;
};

/// Elements of `area` m² that look up, `kStep` apart along `axis` (0: x, 2: z) and across the origin.
testing::SyntheticAsset row_across_the_edge(int axis, float area) {
  testing::SyntheticAsset asset = testing::empty_asset(1, 4);
  SurfaceChunk surface;
  for (uint32_t i = 0; i < kElements; ++i) {
    surface.keys.push_back(i);
    Vec3 p{};
    p[axis] = static_cast<float>(kStep * (static_cast<int>(i) - kElements / 2));
    surface.positions.push_back(p);
  }
  surface.object = asset.add_object(kElements, 1, surface.keys);
  surface.normals.assign(kElements, {0, 1, 0});
  surface.areas.assign(kElements, area);
  asset.manifest.objects[0].surface = asset.put(encode_surface(surface));
  return asset;
}

/// Of three by three comparisons `spread` texels apart, `at` texels behind the edge: the share that is lit.
double lit(double at, double spread, bool linear) {
  double sum = 0;
  for (int tap = -1; tap <= 1; ++tap) {
    const double t = at + tap * spread;
    // Between the centres of the two texels beside the edge a filter goes from dark to lit.
    sum += linear ? std::min(1.0, std::max(0.0, t + 0.5)) : (t > 0 ? 1.0 : 0.0);
  }
  return sum / 3;
}

struct Case {
  int axis;
  float area;
  double spread;  ///< of the comparisons, texels
};

TEST(Shadow, PenumbraAcrossAnEdge) {
  // Half an element's side in texels, at least a half and at most four, times two thirds.
  for (const Case& c : {Case{0, 1e-6f, 0.5 * 2 / 3}, Case{2, 1e-6f, 0.5 * 2 / 3}, Case{0, 0.04f, 1.0 * 2 / 3},
                        Case{2, 0.16f, 2.0 * 2 / 3}, Case{0, 4.0f, 4.0 * 2 / 3}}) {
    SCOPED_TRACE(std::to_string(c.axis) + ", " + std::to_string(c.area) + " m2");
    testing::SyntheticAsset asset = row_across_the_edge(c.axis, c.area);
    Engine engine;
    engine.load(asset);
    const HalfPlanes maps(&engine);
    VkFormatProperties format;
    engine.context().vk.GetPhysicalDeviceFormatProperties(engine.physical_device(), VK_FORMAT_D32_SFLOAT, &format);
    const bool linear = (format.optimalTilingFeatures & VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT) != 0;

    // The sun straight down: x to the right, z down the image, elements at depth 0.5 and nearer if higher.
    const float scale = static_cast<float>(2 / (kTexel * kMapSize));
    lightloom_shadow_view view{};
    view.view_projection[0] = scale;
    view.view_projection[9] = scale;
    view.view_projection[6] = -0.01f;
    view.view_projection[14] = 0.5f;
    view.view_projection[15] = 1;
    view.layer = c.axis == 0 ? 0 : 1;
    lightloom_light sun{};
    sun.type = LIGHTLOOM_LIGHT_DIRECTIONAL;
    sun.direction[1] = -1;
    sun.intensity[0] = 2;
    lightloom_frame_info info{};
    info.struct_size = sizeof info;
    info.direct_source = LIGHTLOOM_DIRECT_LIGHTS;
    info.lights = &sun;
    info.light_count = 1;
    info.shadow_views = &view;
    info.shadow_view_count = 1;
    info.shadow_maps = maps.view();
    info.shadow_layout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
    info.shadow_map_size = kMapSize;
    engine.frame(&info);

    const std::vector<Vec3> direct = engine.read_vec3(engine.outputs().direct);
    ASSERT_EQ(direct.size(), static_cast<size_t>(kElements));
    std::set<int> levels;
    for (int i = 0; i < kElements; ++i) {
      const double at = kStep * (i - kElements / 2) / kTexel;
      const double share = static_cast<double>(direct[static_cast<size_t>(i)].x) / 2;
      levels.insert(static_cast<int>(std::lround(share * 1000)));
      if (linear) {
        // Filters have at least 8 bits of a texel.
        EXPECT_NEAR(share, lit(at, c.spread, true), 1.0 / 128) << at;
      } else if (lit(at - 1e-3, c.spread, false) == lit(at + 1e-3, c.spread, false)) {
        EXPECT_NEAR(share, lit(at, c.spread, false), 1e-5) << at;
      }
    }
    EXPECT_EQ(direct.front().x, 0) << "on the side of the occluder";
    EXPECT_EQ(direct.back().x, 2) << "on the other side";
    EXPECT_GE(levels.size(), 4u) << "nothing is half in shadow";
  }
}

}  // namespace
}  // namespace lightloom
