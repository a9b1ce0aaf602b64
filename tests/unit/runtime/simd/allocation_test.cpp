// A frame allocates nothing; what stays allocated comes from the caller's resource and goes back to it.
#include <gtest/gtest.h>

#include <new>

#include "tests/unit/runtime/simd/counting_new.h"
#include "tests/unit/runtime/simd/simd_level.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom {
namespace {

/// Counts bytes, and has none left from a given allocation on.
class CountingResource : public std::pmr::memory_resource {
 public:
  int64_t bytes = 0;
  int64_t left = INT64_MAX;

 private:
  void* do_allocate(size_t size, size_t alignment) override {
    if (left-- <= 0) throw std::bad_alloc();
    bytes += static_cast<int64_t>(size);
    return std::pmr::new_delete_resource()->allocate(size, alignment);
  }
  void do_deallocate(void* p, size_t size, size_t alignment) override {
    bytes -= static_cast<int64_t>(size);
    std::pmr::new_delete_resource()->deallocate(p, size, alignment);
  }
  bool do_is_equal(const memory_resource& other) const noexcept override { return this == &other; }
};

TEST(SimdAllocation, FramesAllocateNothing) {
  const testing::SyntheticAsset asset = testing::random_asset({});
  const auto source = asset.open();
  ASSERT_TRUE(source.ok()) << source.status();
  CountingResource memory;
  SimdOptions options;
  options.memory = &memory;
  options.threads = 3;
  options.smoothing = true;
  const auto runtime = testing::simd_runtime(*source, options);
  SurfaceLight light = testing::random_light(source->surface_elements(), 1);
  std::vector<float> e(size_t{3} * source->surface_elements());

  const uint64_t before = testing::allocations();
  const int64_t bytes = memory.bytes;
  SimdFrameOptions frame;
  for (int i = 0; i < 30; ++i) {
    for (Vec3& d : light.direct) d = d * 1.1f;
    testing::set_light(light, runtime.get());
    frame.max_probes = static_cast<uint32_t>(i % 3) * 5;
    frame.max_cells = static_cast<uint32_t>(i % 2) * 3;
    frame.smoothing = i % 4 == 0 ? 0.5f : 1.0f;
    EXPECT_GT(runtime->update(frame).updated_cells, 0u);
    runtime->read_irradiance(e);
    if (i == 20) runtime->reset_feedback();
  }
  EXPECT_EQ(testing::allocations() - before, 0u);
  EXPECT_EQ(memory.bytes, bytes);
}

TEST(SimdAllocation, EverythingGoesBack) {
  const testing::SyntheticAsset asset = testing::random_asset({});
  const auto source = asset.open();
  ASSERT_TRUE(source.ok()) << source.status();
  CountingResource memory;
  SimdOptions options;
  options.memory = &memory;
  {
    const auto runtime = testing::simd_runtime(*source, options);
    EXPECT_GE(memory.bytes, static_cast<int64_t>(runtime->counts().bytes));
  }
  EXPECT_EQ(memory.bytes, 0);
}

TEST(SimdAllocation, NoMemoryAtAnyPointLeavesNothingBehind) {
  const testing::SyntheticAsset asset = testing::random_asset({});
  const auto source = asset.open();
  ASSERT_TRUE(source.ok()) << source.status();
  CountingResource memory;
  SimdOptions options;
  options.memory = &memory;
  options.threads = 1;
  options.smoothing = true;
  int failures = 0;
  for (;; ++failures) {
    memory.left = failures;
    try {
      testing::simd_runtime(*source, options);
      break;
    } catch (const std::bad_alloc&) {
      ASSERT_EQ(memory.bytes, 0) << "after " << failures << " allocations";
    }
  }
  EXPECT_GT(failures, 30);
}

}  // namespace
}  // namespace lightloom
