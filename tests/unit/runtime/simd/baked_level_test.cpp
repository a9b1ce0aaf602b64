// A level as the baker writes it, lit by the SIMD runtime and by the decoder.
#include <gtest/gtest.h>

#include "core/scene/builtin.h"
#include "tests/support/baked_level.h"
#include "tests/unit/runtime/simd/simd_level.h"

namespace lightloom {
namespace {

TEST(SimdRuntime, SameLightAsTheDecoderInABakedLevel) {
  BakeParams params;
  params.texels_per_metre = 4;
  const auto level = test::bake_level(test::value_or_die(builtin_scene("cornell")), params);
  const SurfaceInputs inputs = test::value_or_die(light_surfaces(*level->tracer, level->elements, 16, {}));

  const ChunkStore store = chunk_store(level->loom());
  const auto source = AssetSource::open(encode_manifest(level->manifest),
                                        [&](const ChunkRef& ref, std::span<uint8_t> out) -> absl::Status {
                                          LL_ASSIGN_OR_RETURN(const auto bytes, store.get(ref));
                                          std::copy(bytes.begin(), bytes.end(), out.begin());
                                          return absl::OkStatus();
                                        });
  ASSERT_TRUE(source.ok()) << source.status();
  const SurfaceLight light{inputs.direct, inputs.albedo, inputs.emission, level->scene->environment};
  const auto expected = testing::decoded_frames(*source, light, 4);
  const simd::KernelList& sets = simd::available_kernels();
  for (size_t k = 0; k < sets.count; ++k) {
    SimdOptions options;
    options.kernels = sets.sets[k];
    const auto runtime = testing::simd_runtime(*source, options);
    testing::set_light(light, runtime.get());
    for (const std::vector<Vec3>& e : expected) {
      runtime->update();
      EXPECT_LT(testing::largest_error(testing::irradiance(*runtime), e), 1e-4) << sets.sets[k]->name;
    }
  }
}

}  // namespace
}  // namespace lightloom
