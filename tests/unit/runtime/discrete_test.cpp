// The runtime on a device with a discrete GPU's memory (discrete_vulkan.h), with workgroups as on GPUs with subgroups of 8,
// 32 and 64, under the validation layers.
#include "tests/unit/runtime/discrete_vulkan.h"
#include "tests/unit/runtime/test_engine.h"

namespace lightloom {
namespace {

using testing::discrete;
using testing::Engine;

constexpr uint64_t kDeviceHeap = 8 << 20, kHostHeap = 1 << 20;

Engine::Adjust discrete_memory(uint32_t workgroup_size, uint64_t device_heap = kDeviceHeap) {
  return [=](const lightloom_vulkan_device& device, lightloom_vulkan_create_info* info) {
    testing::make_discrete(device, device_heap, kHostHeap, info);
    info->workgroup_size = workgroup_size;
    info->staging_bytes = 64 << 10;  // several frames of uploads
    info->page_bytes = 256 << 10;    // several pools
  };
}

class Discrete : public ::testing::TestWithParam<uint32_t> {};

TEST_P(Discrete, FramesAgreeWithTheDecoder) {
  testing::RandomAssetOptions options;
  options.probes = 100;
  options.cells = 24;
  testing::SyntheticAsset asset = testing::random_asset(options);
  const auto decoder = load_decoder_asset(*asset.open());
  SurfaceLight light = testing::random_light(decoder->surface_elements, 3);
  {
    Engine engine(VK_FORMAT_R16G16B16A16_SFLOAT, LIGHTLOOM_CREATE_VALIDATION, discrete_memory(GetParam()));
    engine.load(asset);
    engine.light(light);
    while (engine.counts().pending_bytes > 0) engine.frame();
    ASSERT_GT(engine.stats().frames, 3u) << "the uploads were to take several frames";
    ASSERT_GT(engine.counts().pages, 1u);
    lightloom_reset_feedback(engine.runtime());
    std::vector<Vec3> expected(decoder->surface_elements);
    const auto expect_frame = [&](const char* what, const lightloom_frame_info* info = nullptr) {
      engine.frame(info);
      if (info != nullptr) light.direct = engine.read_vec3(engine.outputs().direct);
      expected = decode_frame(*decoder, light, expected).irradiance;
      EXPECT_LT(testing::p999_error(engine.read_vec3(engine.outputs().irradiance), expected), 0.005) << what;
    };
    expect_frame("first bounce");
    expect_frame("second bounce");
    for (Vec3& e : light.emission) e = e * 2.0f;
    engine.light(light);
    expect_frame("emission changed");
    // Its lights are written to mapped memory by each record.
    lightloom_light lamp{};
    lamp.type = LIGHTLOOM_LIGHT_POINT;
    lamp.first_shadow_view = LIGHTLOOM_NO_SHADOW;
    lightloom_frame_info info{};
    info.struct_size = sizeof info;
    info.direct_source = LIGHTLOOM_DIRECT_LIGHTS;
    info.lights = &lamp;
    info.light_count = 1;
    for (const float brightness : {1.0f, 5.0f, 2.0f}) {
      std::fill(lamp.intensity, lamp.intensity + 3, brightness);
      lamp.position[2] = brightness;
      const std::vector<Vec3> before = light.direct;
      expect_frame("a lamp", &info);
      EXPECT_TRUE(light.direct != before);
    }
    // Counters are read from mapped memory.
    EXPECT_EQ(engine.stats().updated_probes, decoder->relight.size());
    EXPECT_GT(discrete.flushes, 10u);
    EXPECT_GT(discrete.invalidates, 5u);
    // What is on the device is not on the host: staging, lights and counters only.
    EXPECT_GT(discrete.heaps[0].most, discrete.heaps[1].most);
  }
  EXPECT_EQ(discrete.live, 0u);
  EXPECT_TRUE(discrete.complaints.empty()) << testing::joined(discrete.complaints);
}

INSTANTIATE_TEST_SUITE_P(Workgroups, Discrete, ::testing::Values(8u, 32u, 64u));

TEST(DiscreteMemory, SmallHeapIsAnErrorAndNothingLeaks) {
  testing::SyntheticAsset asset = testing::random_asset({});
  const auto manifest = encode_manifest(asset.manifest);
  {
    Engine engine(VK_FORMAT_UNDEFINED, LIGHTLOOM_CREATE_VALIDATION, discrete_memory(64, 256 << 10));
    lightloom_asset_info info{};
    info.struct_size = sizeof info;
    info.manifest = manifest.data();
    info.manifest_bytes = manifest.size();
    info.read_chunk = testing::SyntheticAsset::read_chunk;
    info.read_user = &asset;
    EXPECT_EQ(lightloom_load(engine.runtime(), &info), LIGHTLOOM_ERROR_OUT_OF_MEMORY);
    EXPECT_EQ(discrete.heaps[0].used, 0u);
  }
  EXPECT_EQ(discrete.live, 0u);
  EXPECT_TRUE(discrete.complaints.empty()) << testing::joined(discrete.complaints);
}

/// The memory itself: what is not flushed or invalidated does not arrive, and broken rules are heard of.
TEST(DiscreteMemory, WhatIsNotFlushedDoesNotArrive) {
  Engine engine;
  Context context = engine.context();
  lightloom_vulkan_create_info info{};
  {
    lightloom_vulkan_device device{};
    device.instance = engine.instance();
    device.device = context.device;
    device.get_instance_proc_addr = engine.instance_proc();
    testing::make_discrete(device, kDeviceHeap, kHostHeap, &info);
  }
  ASSERT_TRUE(context.vk.load_instance(engine.instance(), info.get_instance_proc_addr).ok());
  ASSERT_TRUE(context.vk.load_device(context.device, nullptr).ok());
  VkPhysicalDeviceProperties properties;
  context.vk.GetPhysicalDeviceProperties(engine.physical_device(), &properties);
  context.limits = properties.limits;
  context.vk.GetPhysicalDeviceMemoryProperties(engine.physical_device(), &context.memory);
  {
    const Buffer from = *Buffer::create(&context, 1024, BufferUse::kHost);
    const Buffer to = *Buffer::create(&context, 1024, BufferUse::kHost);
    const auto copied = [&] {
      engine.run([&](VkCommandBuffer commands) {
        const VkBufferCopy copy{0, 0, 1024};
        context.vk.CmdCopyBuffer(commands, from.handle(), to.handle(), 1, &copy);
        barrier_after(context, commands);
      });
    };
    from.mapped()[300] = 7;
    copied();
    ASSERT_TRUE(to.invalidate(300, 1).ok());
    EXPECT_NE(to.mapped()[300], 7);
    ASSERT_TRUE(from.flush(300, 1).ok());
    copied();
    EXPECT_NE(to.mapped()[300], 7);
    ASSERT_TRUE(to.invalidate(300, 1).ok());
    EXPECT_EQ(to.mapped()[300], 7);
    EXPECT_TRUE(discrete.complaints.empty()) << testing::joined(discrete.complaints);
    // With lavapipe's own atoms ranges are too fine.
    context.limits.nonCoherentAtomSize = 64;
    ASSERT_TRUE(from.flush(300, 1).ok());
    EXPECT_EQ(discrete.complaints.size(), 1u);
  }
}

}  // namespace
}  // namespace lightloom
