// The library against a Vulkan that fails where it is told to: every error becomes a result, nothing leaks; and frames
// allocate nothing.
#include "tests/unit/runtime/fake_vulkan.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <new>
#include <string>

#include "tests/unit/runtime/synthetic_asset.h"

namespace {

thread_local bool counting = false;
thread_local uint64_t heap_allocations = 0;

}  // namespace

void* operator new(size_t size) {
  if (counting) ++heap_allocations;
  void* memory = std::malloc(size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, size_t) noexcept { std::free(memory); }

namespace lightloom {
namespace {

using testing::fake;
using testing::SyntheticAsset;

/// Counts what is taken from it, and fails when told to.
struct CountingAllocator {
  int64_t live_bytes = 0;
  uint64_t calls = 0, fail_at = 0;

  static void* allocate(void* user, size_t size, size_t alignment) {
    auto* self = static_cast<CountingAllocator*>(user);
    if (++self->calls == self->fail_at) return nullptr;
    self->live_bytes += static_cast<int64_t>(size);
    return std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  }
  static void release(void* user, void* memory, size_t size, size_t) {
    static_cast<CountingAllocator*>(user)->live_bytes -= static_cast<int64_t>(size);
    std::free(memory);
  }
  lightloom_allocator get() { return {this, allocate, release}; }
};

SyntheticAsset small_asset() {
  testing::RandomAssetOptions o;
  o.order = 1;
  o.relight_rays = 8;
  o.objects = 2;
  o.side = 6;
  o.probes = 5;
  o.cells = 3;
  return testing::random_asset(o);
}

class FakeVulkanTest : public ::testing::Test {
 protected:
  void SetUp() override {
    fake.reset();
    callbacks_.pfnAllocation = [](void*, size_t size, size_t, VkSystemAllocationScope) { return std::malloc(size); };
    callbacks_.pfnReallocation = [](void*, void* p, size_t size, size_t, VkSystemAllocationScope) {
      return std::realloc(p, size);
    };
    callbacks_.pfnFree = [](void*, void* p) { std::free(p); };
  }

  lightloom_result create(lightloom_runtime** out) {
    fake.callbacks = &callbacks_;
    lightloom_vulkan_create_info info = fake.create_info();
    info.allocator = allocator_.get();
    info.message = [](void* user, lightloom_message_kind, const char* text) {
      *static_cast<std::string*>(user) = text;
    };
    info.message_user = &message_;
    return lightloom_vulkan_create(&info, out);
  }
  lightloom_result load(lightloom_runtime* runtime) {
    const auto manifest = encode_manifest(asset_.manifest);
    lightloom_asset_info info{};
    info.struct_size = sizeof info;
    info.manifest = manifest.data();
    info.manifest_bytes = manifest.size();
    info.read_chunk = SyntheticAsset::read_chunk;
    info.read_user = &asset_;
    return lightloom_load(runtime, &info);
  }
  /// Every cell twice, the second in place of the first.
  lightloom_result load_parts(lightloom_runtime* runtime) {
    lightloom_detail detail{};
    detail.struct_size = sizeof detail;
    for (const CellEntry& c : asset_.manifest.cells) {
      const std::vector<uint8_t>& bytes = asset_.chunks.at(c.chunk.digest);
      for (detail.max_rank = 0; detail.max_rank < 2; ++detail.max_rank) {
        const lightloom_result result =
            lightloom_load_chunk_part(runtime, c.chunk.digest.bytes.data(), bytes.data(), bytes.size(), &detail);
        if (result != LIGHTLOOM_OK) return result;
      }
    }
    return LIGHTLOOM_OK;
  }
  lightloom_result record(lightloom_runtime* runtime) {
    static int commands;
    return lightloom_vulkan_record(runtime, reinterpret_cast<VkCommandBuffer>(&commands), nullptr);
  }
  /// All that a program does; the first error, whatever it is, ends it. Everything must be free again.
  lightloom_result run() {
    lightloom_runtime* runtime = nullptr;
    lightloom_result result = create(&runtime);
    EXPECT_EQ(runtime != nullptr, result == LIGHTLOOM_OK);
    if (result == LIGHTLOOM_OK) result = load(runtime);
    for (int frame = 0; frame < 6 && result == LIGHTLOOM_OK; ++frame) {
      if (frame == 2) {
        for (const CellEntry& c : asset_.manifest.cells) lightloom_unload_chunk(runtime, c.chunk.digest.bytes.data());
      }
      if (frame == 3) result = load_parts(runtime);
      if (frame == 4 && result == LIGHTLOOM_OK) {
        const auto manifest = encode_manifest(asset_.manifest);
        result = lightloom_reload_manifest(runtime, manifest.data(), manifest.size());
        // Whatever became of it, asking is safe.
        lightloom_counts counts{};
        counts.struct_size = sizeof counts;
        lightloom_get_counts(runtime, &counts);
      }
      if (result != LIGHTLOOM_OK) break;
      result = record(runtime);
    }
    lightloom_destroy(runtime);
    EXPECT_EQ(fake.live, 0);
    EXPECT_EQ(allocator_.live_bytes, 0);
    EXPECT_EQ(fake.wrong_callbacks, 0u);
    return result;
  }

  SyntheticAsset asset_ = small_asset();
  VkAllocationCallbacks callbacks_{};
  CountingAllocator allocator_;
  std::string message_;
};

TEST_F(FakeVulkanTest, EveryObjectIsDestroyed) {
  EXPECT_EQ(run(), LIGHTLOOM_OK) << message_;
  EXPECT_GT(fake.created, 50u);
  EXPECT_GT(allocator_.calls, 10u);
  EXPECT_GT(fake.flushes, 0u);  // the memory is not coherent
}

TEST_F(FakeVulkanTest, EveryCallMayRunOutOfMemoryOrLoseTheDevice) {
  ASSERT_EQ(run(), LIGHTLOOM_OK);
  const uint64_t calls = fake.calls;
  const std::pair<VkResult, lightloom_result> failures[] = {
      {VK_ERROR_OUT_OF_DEVICE_MEMORY, LIGHTLOOM_ERROR_OUT_OF_MEMORY},
      {VK_ERROR_OUT_OF_HOST_MEMORY, LIGHTLOOM_ERROR_OUT_OF_MEMORY},
      {VK_ERROR_DEVICE_LOST, LIGHTLOOM_ERROR_DEVICE_LOST}};
  for (const auto& [failure, expected] : failures) {
    for (uint64_t n = 1; n <= calls; ++n) {
      fake.reset();
      fake.fail_at = n;
      fake.failure = failure;
      ASSERT_EQ(run(), expected) << "call " << n << " of " << calls << ": " << message_;
    }
  }
}

TEST_F(FakeVulkanTest, HostMemoryMayRunOut) {
  ASSERT_EQ(run(), LIGHTLOOM_OK);
  const uint64_t calls = allocator_.calls;
  for (uint64_t n = 1; n <= calls; ++n) {
    fake.reset();
    allocator_ = {};
    allocator_.fail_at = n;
    ASSERT_EQ(run(), LIGHTLOOM_ERROR_OUT_OF_MEMORY) << "allocation " << n << " of " << calls;
  }
}

TEST_F(FakeVulkanTest, FramesAllocateNothingAndCreateNothing) {
  lightloom_runtime* runtime = nullptr;
  ASSERT_EQ(create(&runtime), LIGHTLOOM_OK);
  ASSERT_EQ(load(runtime), LIGHTLOOM_OK);
  ASSERT_EQ(record(runtime), LIGHTLOOM_OK);
  lightloom_counts counts{};
  counts.struct_size = sizeof counts;
  ASSERT_EQ(lightloom_get_counts(runtime, &counts), LIGHTLOOM_OK);
  ASSERT_EQ(counts.pending_bytes, 0u);
  std::vector<float> direct(3 * counts.surface_elements, 1);
  lightloom_light light{};
  light.first_shadow_view = LIGHTLOOM_NO_SHADOW;
  lightloom_frame_info info{};
  info.struct_size = sizeof info;
  info.lights = &light;
  info.light_count = 1;
  static int commands;
  const uint64_t created = fake.created, host = allocator_.calls;
  counting = true;
  heap_allocations = 0;
  bool good = true;
  for (int frame = 0; frame < 20; ++frame) {
    info.direct_source = frame < 10 ? LIGHTLOOM_DIRECT_HOST : LIGHTLOOM_DIRECT_LIGHTS;
    direct[0] = static_cast<float>(frame);
    good &= lightloom_set_direct(runtime, direct.data(), 0, counts.surface_elements) == LIGHTLOOM_OK;
    good &= lightloom_vulkan_record(runtime, reinterpret_cast<VkCommandBuffer>(&commands), &info) == LIGHTLOOM_OK;
  }
  counting = false;
  EXPECT_TRUE(good) << message_;
  EXPECT_EQ(heap_allocations, 0u);
  EXPECT_EQ(allocator_.calls, host);
  EXPECT_EQ(fake.created, created);
  lightloom_destroy(runtime);
}

TEST_F(FakeVulkanTest, FramesAllocateNothingWhileDetailsTakeEachOthersPlace) {
  lightloom_runtime* runtime = nullptr;
  ASSERT_EQ(create(&runtime), LIGHTLOOM_OK);
  ASSERT_EQ(load(runtime), LIGHTLOOM_OK);
  ASSERT_EQ(record(runtime), LIGHTLOOM_OK);
  uint64_t created = 0, host = 0, heap = 0;
  for (uint32_t round = 0; round < 6; ++round) {
    for (const CellEntry& c : asset_.manifest.cells) {
      const std::vector<uint8_t>& bytes = asset_.chunks.at(c.chunk.digest);
      lightloom_detail detail{};
      detail.struct_size = sizeof detail;
      detail.max_rank = round % 3;
      ASSERT_EQ(lightloom_load_chunk_part(runtime, c.chunk.digest.bytes.data(), bytes.data(), bytes.size(), &detail),
                LIGHTLOOM_OK)
          << message_;
    }
    created -= fake.created;
    host -= allocator_.calls;
    heap_allocations = 0;
    counting = true;
    lightloom_result result = LIGHTLOOM_OK;
    for (int frame = 0; frame < 8 && result == LIGHTLOOM_OK; ++frame) result = record(runtime);
    counting = false;
    heap += heap_allocations;
    created += fake.created;
    host += allocator_.calls;
    EXPECT_EQ(result, LIGHTLOOM_OK) << message_;
  }
  EXPECT_EQ(heap, 0u);
  EXPECT_EQ(host, 0u);
  EXPECT_EQ(created, 0u);
  lightloom_destroy(runtime);
}

TEST_F(FakeVulkanTest, WhatADeviceLacksIsNamed) {
  fake.storage_buffers = 4;
  lightloom_runtime* runtime = nullptr;
  EXPECT_EQ(create(&runtime), LIGHTLOOM_ERROR_MISSING_FEATURE);
  EXPECT_EQ(runtime, nullptr);
  EXPECT_NE(message_.find("maxPerStageDescriptorStorageBuffers 4"), std::string::npos) << message_;
  const lightloom_vulkan_create_info create = fake.create_info();
  lightloom_vulkan_check_info info{};
  info.struct_size = sizeof info;
  info.instance = create.instance;
  info.physical_device = create.physical_device;
  info.get_instance_proc_addr = create.get_instance_proc_addr;
  lightloom_vulkan_requirements need{};
  need.struct_size = sizeof need;
  EXPECT_EQ(lightloom_vulkan_check(&info, &need), LIGHTLOOM_ERROR_MISSING_FEATURE);
  EXPECT_EQ(need.api_version, VK_API_VERSION_1_1);
  fake.storage_buffers = need.storage_buffers;
  EXPECT_EQ(lightloom_vulkan_check(&info, &need), LIGHTLOOM_OK);
  info.queue_family = 1;
  EXPECT_EQ(lightloom_vulkan_check(&info, nullptr), LIGHTLOOM_ERROR_MISSING_FEATURE);
}

TEST_F(FakeVulkanTest, WhatNeedsAQueueSaysSo) {
  lightloom_runtime* runtime = nullptr;
  ASSERT_EQ(create(&runtime), LIGHTLOOM_OK);
  ASSERT_EQ(load(runtime), LIGHTLOOM_OK);
  EXPECT_EQ(lightloom_update(runtime, 1), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  lightloom_destroy(runtime);
}

}  // namespace
}  // namespace lightloom
