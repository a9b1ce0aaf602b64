// A manifest that takes another's place while the level is lit.
#include <gtest/gtest.h>

#include "tests/unit/runtime/test_runtime.h"

namespace lightloom {
namespace {

using testing::joined;
using testing::p999_error;
using testing::SyntheticAsset;
using testing::TestRuntime;

class ReloadTest : public ::testing::TestWithParam<uint32_t> {
 protected:
  ReloadTest() {
    testing::RandomAssetOptions o;
    o.objects = 6;
    o.side = 12;
    before_ = testing::random_asset(o);
    // The same objects in another order, and one more.
    after_ = before_;
    auto& objects = after_.manifest.objects;
    std::rotate(objects.begin(), objects.begin() + 2, objects.end());
    after_.add_object(5, 5, {0, 3, 7});
    std::swap(objects.front(), objects.back());
    const auto ranges = [](const SyntheticAsset& asset) {
      std::map<Digest, std::pair<uint32_t, uint32_t>> found;
      const auto index = AssetIndex::create(asset.manifest, std::pmr::get_default_resource());
      for (const auto& object : index->objects()) found[object.id] = {object.first_element, object.elements};
      return found;
    };
    const auto old_ranges = ranges(before_);
    for (const auto& [id, range] : ranges(after_)) {
      for (uint32_t i = 0; i < range.second; ++i) {
        const uint32_t element = range.first + i;
        from_.resize(std::max<size_t>(from_.size(), element + 1), UINT32_MAX);
        if (old_ranges.count(id) > 0) from_[element] = old_ranges.at(id).first + i;
      }
    }
    light_ = testing::random_light((*before_.open()).surface_elements(), 5);
  }
  /// Values of the old elements at their new numbers, 0 at new ones.
  std::vector<Vec3> moved(const std::vector<Vec3>& old) const {
    std::vector<Vec3> out(from_.size());
    for (size_t i = 0; i < out.size(); ++i) {
      if (from_[i] != UINT32_MAX) out[i] = old[from_[i]];
    }
    return out;
  }
  lightloom_result reload(TestRuntime& runtime, const std::vector<uint8_t>& manifest) {
    return lightloom_reload_manifest(runtime.get(), manifest.data(), manifest.size());
  }
  void load_chunks(TestRuntime& runtime) {
    for (const ObjectEntry& o : after_.manifest.objects) load(runtime, o.surface.digest);
    for (const ProbeEntry& p : after_.manifest.probes) load(runtime, p.relight.digest);
    for (const CellEntry& c : after_.manifest.cells) load(runtime, c.chunk.digest);
  }
  void load(TestRuntime& runtime, const Digest& digest) {
    const std::vector<uint8_t>& bytes = after_.chunks.at(digest);
    ASSERT_EQ(lightloom_load_chunk(runtime.get(), digest.bytes.data(), bytes.data(), bytes.size()), LIGHTLOOM_OK)
        << joined(runtime.received().errors);
  }

  SyntheticAsset before_, after_;
  std::vector<uint32_t> from_;  ///< per element after: the one before
  SurfaceLight light_;
};

TEST_P(ReloadTest, WhatStaysGoesOnAsItWasLit) {
  for (const uint32_t smoothing : {0u, uint32_t{LIGHTLOOM_CREATE_SMOOTHING}}) {
    TestRuntime runtime(GetParam() | smoothing);
    ASSERT_EQ(runtime.load(before_), LIGHTLOOM_OK);
    runtime.light(light_);
    runtime.settle();
    const std::vector<Vec3> lit = moved(runtime.irradiance());

    ASSERT_EQ(reload(runtime, encode_manifest(after_.manifest)), LIGHTLOOM_OK) << joined(runtime.received().errors);
    EXPECT_EQ(runtime.counts().surface_elements, lit.size());
    EXPECT_EQ(runtime.counts().resident_cells, 0u);
    ASSERT_EQ(lightloom_update(runtime.get(), 3), LIGHTLOOM_OK);
    EXPECT_EQ(runtime.irradiance(), lit);

    // Albedo, emission, direct light and sky have stayed too: with its chunks the level is lit as before.
    load_chunks(runtime);
    ASSERT_EQ(lightloom_update(runtime.get(), 1), LIGHTLOOM_OK);
    EXPECT_LT(p999_error(runtime.irradiance(), lit), 1e-4);
    ASSERT_EQ(lightloom_reset_feedback(runtime.get()), LIGHTLOOM_OK);
    runtime.settle();
    EXPECT_LT(p999_error(runtime.irradiance(), lit), 1e-4);
  }
}

TEST_P(ReloadTest, TwiceInARowAndAtOnceAfterAReset) {
  TestRuntime runtime(GetParam());
  ASSERT_EQ(runtime.load(before_), LIGHTLOOM_OK);
  runtime.light(light_);
  runtime.settle();
  const std::vector<Vec3> lit = runtime.irradiance();
  ASSERT_EQ(reload(runtime, encode_manifest(after_.manifest)), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_update(runtime.get(), 1), LIGHTLOOM_OK);
  ASSERT_EQ(reload(runtime, encode_manifest(before_.manifest)), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_update(runtime.get(), 1), LIGHTLOOM_OK);
  EXPECT_EQ(runtime.irradiance(), lit);
  ASSERT_EQ(reload(runtime, encode_manifest(after_.manifest)), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_reset_feedback(runtime.get()), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_update(runtime.get(), 1), LIGHTLOOM_OK);
  EXPECT_EQ(runtime.irradiance(), std::vector<Vec3>(from_.size()));
}

/// Something has moved onto one of its texels.
TEST_P(ReloadTest, AnObjectWithOtherTexelsIsNotBlack) {
  TestRuntime runtime(GetParam());
  ASSERT_EQ(runtime.load(before_), LIGHTLOOM_OK);
  runtime.light(light_);
  runtime.settle();
  const std::vector<Vec3> lit = runtime.irradiance();
  SyntheticAsset fewer = testing::empty_asset(4, 200);
  const ObjectEntry& old = before_.manifest.objects[0];
  SurfaceChunk surface = *decode_surface(before_.chunks.at(old.surface.digest));
  surface.keys.pop_back();
  surface.positions.pop_back();
  surface.normals.pop_back();
  surface.areas.pop_back();
  fewer.manifest.objects.push_back(old);
  fewer.manifest.objects[0].surface = fewer.put(encode_surface(surface));
  fewer.manifest.width = before_.manifest.width;
  fewer.manifest.height = before_.manifest.height;
  ASSERT_EQ(reload(runtime, encode_manifest(fewer.manifest)), LIGHTLOOM_OK) << joined(runtime.received().errors);
  ASSERT_EQ(lightloom_update(runtime.get(), 1), LIGHTLOOM_OK);
  // The first half in its place; of the second, the last is gone.
  std::vector<Vec3> expected(surface.keys.size());
  const size_t front = expected.size() / 2;
  for (size_t i = 0; i < expected.size(); ++i) expected[i] = lit[i < front ? i : i + 1];
  EXPECT_EQ(runtime.irradiance(), expected);
}

TEST_P(ReloadTest, ABadManifestChangesNothing) {
  TestRuntime runtime(GetParam());
  std::vector<uint8_t> manifest = encode_manifest(after_.manifest);
  EXPECT_EQ(reload(runtime, manifest), LIGHTLOOM_ERROR_NO_ASSET);
  ASSERT_EQ(runtime.load(before_), LIGHTLOOM_OK);
  runtime.light(light_);
  runtime.settle();
  const std::vector<Vec3> lit = runtime.irradiance();
  manifest[100] ^= 1;
  EXPECT_EQ(reload(runtime, manifest), LIGHTLOOM_ERROR_CORRUPT_ASSET);
  EXPECT_EQ(lightloom_reload_manifest(runtime.get(), nullptr, 5), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(runtime.irradiance(), lit);
  EXPECT_EQ(runtime.counts().active_cells, before_.manifest.cells.size());
}

INSTANTIATE_TEST_SUITE_P(Backends, ReloadTest, ::testing::Values(0u, uint32_t{LIGHTLOOM_CREATE_CPU}),
                         [](const auto& test) { return test.param == 0 ? "Vulkan" : "Cpu"; });

}  // namespace
}  // namespace lightloom
