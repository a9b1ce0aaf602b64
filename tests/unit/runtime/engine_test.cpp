// The library on an engine's own device and command buffers: E as image and the direct light pass, under the validation
// layers.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "tests/unit/runtime/test_engine.h"

namespace lightloom {
namespace {

using testing::Engine;
using testing::p999_error;
using testing::SyntheticAsset;

void expect_frames_agree(uint32_t device_flags, const testing::RandomAssetOptions& options, int frames) {
  SyntheticAsset asset = testing::random_asset(options);
  const auto decoder = load_decoder_asset(*asset.open());
  const SurfaceLight light = testing::random_light(decoder->surface_elements, 3);
  Engine engine(VK_FORMAT_UNDEFINED, device_flags);
  engine.load(asset);
  engine.light(light);
  std::vector<Vec3> expected(decoder->surface_elements);
  for (int frame = 0; frame < frames; ++frame) {
    engine.frame();
    expected = decode_frame(*decoder, light, expected).irradiance;
    EXPECT_LT(p999_error(engine.read_vec3(engine.outputs().irradiance), expected), 1e-4) << frame;
  }
}

TEST(Engine, FramesInItsCommandBuffers) { expect_frames_agree(LIGHTLOOM_CREATE_VALIDATION, {}, 5); }

TEST(Engine, GpuAssistedValidationFindsNothing) {
  testing::RandomAssetOptions options;
  options.order = 2;
  options.relight_rays = 40;
  options.side = 8;
  expect_frames_agree(LIGHTLOOM_CREATE_VALIDATION | LIGHTLOOM_CREATE_GPU_ASSISTED, options, 2);
}

TEST(Engine, ImageShowsEAndFillsGutters) {
  SyntheticAsset asset = testing::random_asset({});
  // Objects side by side with a gap.
  int32_t x = 0;
  for (ObjectEntry& o : asset.manifest.objects) {
    o.x = x;
    x += o.width + 3;
  }
  asset.manifest.width = x;
  asset.manifest.height = 24;
  Engine engine(VK_FORMAT_R32G32B32A32_SFLOAT);
  engine.load(asset);
  const SurfaceLight light = testing::random_light(engine.outputs().surface_elements, 3);
  engine.light(light);
  engine.frame();
  engine.frame();
  const lightloom_vulkan_outputs out = engine.outputs();
  ASSERT_EQ(out.image_layers, 2u);
  ASSERT_EQ(out.image_width, static_cast<uint32_t>(x));
  const size_t texels = size_t{out.image_width} * out.image_height;
  const std::vector<float> image = engine.read_image();
  const std::vector<Vec3> e = engine.read_vec3(out.irradiance);
  const auto pixel = [&](size_t layer, int px, int py) {
    return &image[4 * (layer * texels + static_cast<size_t>(py) * out.image_width + static_cast<size_t>(px))];
  };
  uint32_t element = 0;
  std::vector<bool> valid(2 * texels);
  for (const ObjectEntry& o : asset.manifest.objects) {
    const SurfaceChunk surface = *decode_surface(asset.chunks.at(o.surface.digest));
    for (const uint32_t key : surface.keys) {
      const uint32_t n = static_cast<uint32_t>(o.width * o.height), w = static_cast<uint32_t>(o.width);
      const int px = o.x + static_cast<int>(key % n % w), py = o.y + static_cast<int>(key % n / w);
      const float* p = pixel(key / n, px, py);
      ASSERT_EQ((Vec3{p[0], p[1], p[2]}), e[element]);
      ASSERT_EQ(p[3], 1.0f);
      valid[key / n * texels + static_cast<size_t>(py) * out.image_width + static_cast<size_t>(px)] = true;
      ++element;
    }
  }
  // An invalid texel beside a valid one shows one of its valid neighbours; one far from all shows nothing.
  uint32_t filled = 0, empty = 0;
  for (size_t layer = 0; layer < 2; ++layer) {
    for (int py = 0; py < static_cast<int>(out.image_height); ++py) {
      for (int px = 0; px < x; ++px) {
        const auto is_valid = [&](int a, int b) {
          return a >= 0 && b >= 0 && a < x && b < static_cast<int>(out.image_height) &&
                 valid[layer * texels + static_cast<size_t>(b) * out.image_width + static_cast<size_t>(a)];
        };
        if (is_valid(px, py)) continue;
        const float* p = pixel(layer, px, py);
        EXPECT_EQ(p[3], 0.0f);
        const Vec3 shown{p[0], p[1], p[2]};
        bool near = false, found = false;
        for (int dy = -2; dy <= 2; ++dy) {
          for (int dx = -2; dx <= 2; ++dx) {
            if (!is_valid(px + dx, py + dy)) continue;
            near = true;
            const float* q = pixel(layer, px + dx, py + dy);
            found |= shown == Vec3{q[0], q[1], q[2]};
          }
        }
        if (near) {
          EXPECT_TRUE(found);
          ++filled;
        } else {
          EXPECT_EQ(shown, Vec3{});
          ++empty;
        }
      }
    }
  }
  EXPECT_GT(filled, 0u);
  EXPECT_GT(empty, 0u);
}

TEST(Engine, ImageIsExposed) {
  SyntheticAsset asset = testing::random_asset({});
  asset.lay_out_in_a_row(24);
  Engine engine(VK_FORMAT_R32G32B32A32_SFLOAT);
  engine.load(asset);
  engine.light(testing::random_light(engine.outputs().surface_elements, 3));
  lightloom_frame_info info{};
  info.struct_size = sizeof info;
  for (int frame = 0; frame < 60; ++frame) engine.frame();  // until frames have nothing to do
  const uint64_t frames = engine.stats().frames;
  engine.frame();
  ASSERT_EQ(engine.stats().frames, frames);
  const std::vector<Vec3> e = engine.read_vec3(engine.outputs().irradiance);
  const std::vector<float> image = engine.read_image();
  ASSERT_TRUE(std::any_of(image.begin(), image.end(), [](float v) { return v > 1.5f; }));
  for (const float exposure : {4.0f, 0.25f, 0.0f}) {  // exact; 0: none
    info.image_exposure = exposure;
    engine.frame(&info);
    const std::vector<float> exposed = engine.read_image();
    for (size_t i = 0; i < image.size(); ++i) {
      ASSERT_EQ(exposed[i], i % 4 == 3 || exposure == 0 ? image[i] : exposure * image[i]) << exposure << ' ' << i;
    }
    EXPECT_EQ(engine.read_vec3(engine.outputs().irradiance), e) << "the buffer is not exposed";
  }
  for (const float exposure : {-1.0f, INFINITY, NAN}) {
    info.image_exposure = exposure;
    engine.run([&](VkCommandBuffer commands) {
      EXPECT_EQ(lightloom_vulkan_record(engine.runtime(), commands, &info), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
    });
  }
}

/// A row of four surface elements at (i, 0, 0) that look up, and no probes.
SyntheticAsset row_of_four() {
  SyntheticAsset asset = testing::empty_asset(1, 4);
  const ChunkObject object = asset.add_object(4, 1, {0, 1, 2, 3});
  SurfaceChunk surface;
  surface.object = object;
  surface.keys = {0, 1, 2, 3};
  surface.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
  surface.normals.assign(4, {0, 1, 0});
  surface.areas.assign(4, 0.01f);
  asset.manifest.objects[0].surface = asset.put(encode_surface(surface));
  return asset;
}

TEST(Engine, DirectLightByHand) {
  SyntheticAsset asset = row_of_four();
  Engine engine;
  engine.load(asset);
  lightloom_light lights[3]{};
  for (lightloom_light& l : lights) l.first_shadow_view = LIGHTLOOM_NO_SHADOW;
  // A point light 2 m above element 0, which reaches 2.5 m.
  lights[0].type = LIGHTLOOM_LIGHT_POINT;
  lights[0].position[1] = 2;
  lights[0].range = 2.5f;
  lights[0].intensity[0] = 4;
  // The sun, from 60 degrees off the vertical.
  lights[1].type = LIGHTLOOM_LIGHT_DIRECTIONAL;
  lights[1].direction[0] = std::sqrt(0.75f);
  lights[1].direction[1] = -0.5f;
  lights[1].intensity[1] = 3;
  // A spot 1 m above element 3; its outer cone does not reach element 2.
  lights[2].type = LIGHTLOOM_LIGHT_SPOT;
  lights[2].position[0] = 3;
  lights[2].position[1] = 1;
  lights[2].direction[1] = -1;
  lights[2].inner_cone = 0.2f;
  lights[2].outer_cone = 0.5f;
  lights[2].intensity[2] = 7;
  lightloom_frame_info info{};
  info.struct_size = sizeof info;
  info.direct_source = LIGHTLOOM_DIRECT_LIGHTS;
  info.lights = lights;
  info.light_count = 3;
  engine.frame(&info);
  const std::vector<Vec3> direct = engine.read_vec3(engine.outputs().direct);
  // I cosθ/d²: θ = 0 and d = 2; d = √5 and cosθ = 2/√5; out of range at √8.
  EXPECT_NEAR(direct[0].x, 1, 1e-3);
  EXPECT_NEAR(direct[1].x, 4 * (2 / std::sqrt(5.0)) / 5, 1e-3);
  EXPECT_EQ(direct[2].x, 0);
  for (const Vec3 d : direct) EXPECT_NEAR(d.y, 1.5, 1e-3);
  EXPECT_EQ(direct[2].z, 0);
  EXPECT_NEAR(direct[3].z, 7, 1e-2);
  // Without its surface chunk the object gets none.
  lightloom_unload_chunk(engine.runtime(), asset.manifest.objects[0].surface.digest.bytes.data());
  engine.frame(&info);
  for (const Vec3 d : engine.read_vec3(engine.outputs().direct)) EXPECT_EQ(d, Vec3{});
  // Wrong lights are refused.
  lights[0].first_shadow_view = 0;
  EXPECT_TRUE(engine.queue()
                  .run([&](VkCommandBuffer commands) -> absl::Status {
                    EXPECT_EQ(lightloom_vulkan_record(engine.runtime(), commands, &info),
                              LIGHTLOOM_ERROR_INVALID_ARGUMENT);
                    return absl::OkStatus();
                  })
                  .ok());
}

TEST(Engine, ShadowMapsDecide) {
  SyntheticAsset asset = row_of_four();
  Engine engine;
  engine.load(asset);
  const Context& c = engine.context();
  // Two depth images: layer 0 has everything near (all in shadow), layer 1 everything far.
  VkImage image = VK_NULL_HANDLE;
  auto create = vulkan_struct<VkImageCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO);
  create.imageType = VK_IMAGE_TYPE_2D;
  create.format = VK_FORMAT_D32_SFLOAT;
  create.extent = {64, 64, 1};
  create.mipLevels = 1;
  create.arrayLayers = 2;
  create.samples = VK_SAMPLE_COUNT_1_BIT;
  create.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  ASSERT_EQ(c.vk.CreateImage(c.device, &create, nullptr, &image), VK_SUCCESS);
  VkMemoryRequirements need;
  c.vk.GetImageMemoryRequirements(c.device, image, &need);
  auto allocate = vulkan_struct<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  allocate.allocationSize = need.size;
  VkDeviceMemory memory = VK_NULL_HANDLE;
  ASSERT_EQ(c.vk.AllocateMemory(c.device, &allocate, nullptr, &memory), VK_SUCCESS);
  ASSERT_EQ(c.vk.BindImageMemory(c.device, image, memory, 0), VK_SUCCESS);
  auto view_info = vulkan_struct<VkImageViewCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO);
  view_info.image = image;
  view_info.viewType = VK_IMAGE_VIEW_TYPE_2D_ARRAY;
  view_info.format = VK_FORMAT_D32_SFLOAT;
  view_info.subresourceRange = {VK_IMAGE_ASPECT_DEPTH_BIT, 0, 1, 0, 2};
  VkImageView view = VK_NULL_HANDLE;
  ASSERT_EQ(c.vk.CreateImageView(c.device, &view_info, nullptr, &view), VK_SUCCESS);
  const auto clear = engine.function<PFN_vkCmdClearDepthStencilImage>("vkCmdClearDepthStencilImage");
  ASSERT_TRUE(engine.queue()
                  .run([&](VkCommandBuffer commands) -> absl::Status {
                    auto barrier = vulkan_struct<VkImageMemoryBarrier>(VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER);
                    barrier.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
                    barrier.newLayout = VK_IMAGE_LAYOUT_GENERAL;
                    barrier.image = image;
                    barrier.subresourceRange = view_info.subresourceRange;
                    c.vk.CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT,
                                            0, 0, nullptr, 0, nullptr, 1, &barrier);
                    for (uint32_t layer = 0; layer < 2; ++layer) {
                      const VkClearDepthStencilValue depth{layer == 0 ? 0.0f : 1.0f, 0};
                      const VkImageSubresourceRange range{VK_IMAGE_ASPECT_DEPTH_BIT, 0, 1, layer, 1};
                      clear(commands, image, VK_IMAGE_LAYOUT_GENERAL, &depth, 1, &range);
                    }
                    barrier_after(c, commands);
                    return absl::OkStatus();
                  })
                  .ok());

  // The sun straight down; the view looks down on x in [-1, 5], so the elements are at depth 0.5.
  lightloom_shadow_view shadow{};
  shadow.view_projection[0] = 1.0f / 3;  // x/3 - 2/3
  shadow.view_projection[12] = -2.0f / 3;
  shadow.view_projection[9] = 1.0f / 3;  // z/3
  shadow.view_projection[6] = -0.1f;     // depth 0.5 - y/10
  shadow.view_projection[14] = 0.5f;
  shadow.view_projection[15] = 1;
  lightloom_light sun{};
  sun.type = LIGHTLOOM_LIGHT_DIRECTIONAL;
  sun.direction[1] = -1;
  sun.intensity[0] = 2;
  lightloom_frame_info info{};
  info.struct_size = sizeof info;
  info.direct_source = LIGHTLOOM_DIRECT_LIGHTS;
  info.lights = &sun;
  info.light_count = 1;
  info.shadow_views = &shadow;
  info.shadow_view_count = 1;
  info.shadow_maps = view;
  info.shadow_layout = VK_IMAGE_LAYOUT_GENERAL;
  info.shadow_map_size = 64;
  for (uint32_t layer = 0; layer < 2; ++layer) {
    shadow.layer = layer;
    engine.frame(&info);
    for (const Vec3 d : engine.read_vec3(engine.outputs().direct)) EXPECT_NEAR(d.x, layer == 0 ? 0 : 2, 1e-5);
  }
  c.vk.DestroyImageView(c.device, view, nullptr);
  c.vk.DestroyImage(c.device, image, nullptr);
  c.vk.FreeMemory(c.device, memory, nullptr);
}

}  // namespace
}  // namespace lightloom
