// How much work a frame does: nothing without a change, only what saw one, at most so much.
#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <thread>

#include "runtime/decoder.h"
#include "tests/unit/runtime/test_runtime.h"

namespace lightloom {
namespace {

using testing::joined;
using testing::p999_error;
using testing::SyntheticAsset;
using testing::TestRuntime;

/// Many tiles, few of which each probe sees.
SyntheticAsset sparse_asset() {
  testing::RandomAssetOptions o;
  o.order = 2;
  o.relight_rays = 12;
  o.objects = 12;
  o.side = 20;
  o.probes = 150;
  o.cells = 40;
  o.max_rank = 8;
  return testing::random_asset(o);
}

class Amortised : public ::testing::Test {
 protected:
  Amortised() : asset_(sparse_asset()), source_(*asset_.open()) {
    light_ = testing::random_light(source_.surface_elements(), 5);
  }
  void start() {
    ASSERT_EQ(runtime_.load(asset_), LIGHTLOOM_OK) << joined(runtime_.received().errors);
    runtime_.light(light_);
  }
  std::vector<uint32_t> rays_of(uint32_t probe) const {
    absl::StatusOr<std::vector<uint32_t>> rays = source_.relight(probe);
    EXPECT_TRUE(rays.ok()) << rays.status();
    return *std::move(rays);
  }
  int settle(int at_most = 400) { return runtime_.settle(at_most); }

  SyntheticAsset asset_;
  AssetSource source_;
  SurfaceLight light_;
  TestRuntime runtime_{LIGHTLOOM_CREATE_SMOOTHING};
};

TEST_F(Amortised, NoChangeNoWork) {
  start();
  settle();
  const std::vector<Vec3> e = runtime_.irradiance();
  ASSERT_EQ(lightloom_update(runtime_.get(), 10), LIGHTLOOM_OK);
  EXPECT_EQ(runtime_.stats().skipped, 1u);
  EXPECT_EQ(runtime_.stats().updated_probes, 0u);
  EXPECT_EQ(runtime_.irradiance(), e);
  // The same values again are no change either.
  runtime_.light(light_);
  ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  EXPECT_EQ(runtime_.stats().skipped, 1u);
}

/// A cell that has an element in a near field, but no probe that sees it.
class NearField : public ::testing::TestWithParam<uint32_t> {};

TEST_P(NearField, AChangeThatNoProbeSeesIsReceived) {
  SyntheticAsset asset = testing::empty_asset(0, 4);
  std::vector<uint32_t> keys(200);
  for (uint32_t k = 0; k < keys.size(); ++k) keys[k] = k;
  const ChunkObject object = asset.add_object(20, 20, keys);
  RelightChunk probe;
  probe.objects = {object};
  probe.rays.assign(4, 0);
  asset.add_probe(probe);
  for (uint32_t c = 0; c < 2; ++c) {
    CellChunk cell;
    cell.probe_count = 1;
    cell.objects = {object};
    cell.receivers = {{0, c}};
    cell.uniform = {30000};
    cell.near_counts = {static_cast<uint16_t>(c)};
    if (c == 1) cell.near_texels = {150}, cell.near_weights = {13107};
    CellChunk::Cluster cluster;
    cluster.receivers = 1;
    cluster.probes = {0};
    cluster.bounds.extend({0, 0, 0});
    cell.clusters = {cluster};
    asset.add_cell(cell, {0});
  }
  TestRuntime runtime(GetParam());
  ASSERT_EQ(runtime.load(asset), LIGHTLOOM_OK) << joined(runtime.received().errors);
  SurfaceLight light = testing::random_light(200, 3);
  light.albedo.assign(200, {});
  runtime.light(light);
  ASSERT_EQ(lightloom_update(runtime.get(), 3), LIGHTLOOM_OK);
  const std::vector<Vec3> before = runtime.irradiance();
  light.emission[150] += Vec3{5, 0, 10};
  runtime.light(light);
  ASSERT_EQ(lightloom_update(runtime.get(), 1), LIGHTLOOM_OK);
  EXPECT_EQ(runtime.stats().updated_probes, 0u);
  EXPECT_EQ(runtime.stats().updated_cells, 1u);
  const std::vector<Vec3> after = runtime.irradiance();
  EXPECT_EQ(after[0], before[0]);
  EXPECT_NEAR(after[1].x - before[1].x, 3.14159265f, 1e-4);
  EXPECT_NEAR(after[1].z - before[1].z, 2 * 3.14159265f, 1e-4);
}

INSTANTIATE_TEST_SUITE_P(Devices, NearField, ::testing::Values(0u, uint32_t{LIGHTLOOM_CREATE_CPU}),
                         [](const auto& param) { return param.param == 0 ? "Vulkan" : "Simd"; });

TEST_F(Amortised, OnlyProbesThatSeeTheChangeAreRelit) {
  for (Vec3& a : light_.albedo) a = {};  // no second bounce
  start();
  settle();
  const uint32_t element = 7, tile = element / 64;
  std::set<uint32_t> probes;
  for (uint32_t p = 0; p < asset_.manifest.probes.size(); ++p) {
    const std::vector<uint32_t> rays = rays_of(p);
    for (const uint32_t ray : rays) {
      if (ray < RelightChunk::kSky && ray / 64 == tile) probes.insert(p);
    }
  }
  uint32_t cells = 0;
  for (const CellEntry& c : asset_.manifest.cells) {
    bool reads = false;
    for (uint32_t i = 0; i < c.probes; ++i) reads |= probes.count(asset_.manifest.cell_probes[c.first_probe + i]) > 0;
    cells += reads;
  }
  ASSERT_GT(probes.size(), 0u);
  ASSERT_LT(probes.size(), asset_.manifest.probes.size() / 2);
  const Vec3 bright{50, 40, 30};
  ASSERT_EQ(lightloom_set_emission(runtime_.get(), &bright.x, element, 1), LIGHTLOOM_OK);
  // By itself, so that the upload is no frame of its own.
  ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  EXPECT_EQ(runtime_.stats().changed_tiles, 1u);
  EXPECT_EQ(runtime_.stats().updated_probes, probes.size());
  EXPECT_EQ(runtime_.stats().updated_cells, cells);
  EXPECT_EQ(runtime_.stats().relight_bytes, probes.size() * 12 * 4);
  light_.emission[element] = bright;
  const auto decoder = load_decoder_asset(source_);
  const auto expected = decode_frame(*decoder, light_, std::vector<Vec3>(light_.albedo.size())).irradiance;
  EXPECT_LT(p999_error(runtime_.irradiance(), expected), 1e-4);
}

TEST_F(Amortised, SkyReachesProbesThatSeeIt) {
  for (Vec3& a : light_.albedo) a = {};
  start();
  settle();
  uint32_t probes = 0;
  for (uint32_t p = 0; p < asset_.manifest.probes.size(); ++p) {
    const std::vector<uint32_t> rays = rays_of(p);
    probes += std::count(rays.begin(), rays.end(), RelightChunk::kSky) > 0;
  }
  const float sky[] = {3, 2, 1};
  ASSERT_EQ(lightloom_set_environment(runtime_.get(), sky), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  EXPECT_EQ(runtime_.stats().updated_probes, probes);
}

TEST_F(Amortised, FewPerFrameConvergeToTheSame) {
  start();
  settle();
  const std::vector<Vec3> all_at_once = runtime_.irradiance();
  ASSERT_EQ(lightloom_reset_feedback(runtime_.get()), LIGHTLOOM_OK);
  runtime_.options(37, 11);
  ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  EXPECT_EQ(runtime_.stats().updated_probes, 37u);
  EXPECT_GT(runtime_.stats().waiting_probes, 0u);
  EXPECT_LE(runtime_.stats().updated_cells, 11u);
  settle();
  EXPECT_LT(p999_error(runtime_.irradiance(), all_at_once), 1e-5);
}

TEST_F(Amortised, OneProbeAndOneCellPerFrameConverge) {
  for (Vec3& a : light_.albedo) a = {};
  start();
  settle();
  const std::vector<Vec3> all_at_once = runtime_.irradiance();
  for (Vec3& l : light_.emission) l *= 2;
  for (Vec3& d : light_.direct) d *= 2;
  light_.environment *= 2;
  runtime_.light(light_);
  runtime_.options(1, 1);
  settle(400);
  std::vector<Vec3> doubled = all_at_once;
  for (Vec3& e : doubled) e *= 2;
  EXPECT_LT(p999_error(runtime_.irradiance(), doubled), 1e-5);
}

TEST_F(Amortised, EpsilonBoundsTheError) {
  start();
  settle();
  const std::vector<Vec3> exact = runtime_.irradiance();
  ASSERT_EQ(lightloom_reset_feedback(runtime_.get()), LIGHTLOOM_OK);
  runtime_.options(0, 0, 0.01f);
  EXPECT_LT(settle(), 12);
  const double error = p999_error(runtime_.irradiance(), exact);
  EXPECT_LT(error, 0.05);
  EXPECT_GT(error, 0);
}

TEST_F(Amortised, SmoothingGoesAShareOfTheWay) {
  for (Vec3& a : light_.albedo) a = {};
  start();
  settle();
  const std::vector<Vec3> before = runtime_.irradiance();
  for (Vec3& l : light_.emission) l *= 3;
  for (Vec3& d : light_.direct) d *= 3;
  light_.environment *= 3;
  runtime_.light(light_);
  runtime_.options(0, 0, 0, 0.25f);
  ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  std::vector<Vec3> expected = before;
  for (Vec3& e : expected) e *= 1.5f;  // a quarter of the way from 1 to 3
  EXPECT_LT(p999_error(runtime_.irradiance(), expected), 1e-5);
  // And at once again.
  runtime_.options(0, 0);
  ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  for (size_t i = 0; i < expected.size(); ++i) expected[i] = before[i] * 3;
  EXPECT_LT(p999_error(runtime_.irradiance(), expected), 1e-5);
}

TEST_F(Amortised, SmoothingArrives) {
  for (Vec3& a : light_.albedo) a = {};
  start();
  settle();
  const std::vector<Vec3> before = runtime_.irradiance();
  const SurfaceLight dim = light_;
  SurfaceLight bright = light_;
  for (Vec3& l : bright.emission) l *= 3;
  runtime_.light(bright);
  ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  ASSERT_NE(runtime_.irradiance(), before);
  runtime_.light(dim);
  runtime_.options(0, 0, 0, 0.25f);
  ASSERT_EQ(lightloom_update(runtime_.get(), 60), LIGHTLOOM_OK);
  EXPECT_EQ(runtime_.irradiance(), before);
}

class Streaming : public Amortised {
 protected:
  lightloom_result load_chunk(const Digest& digest) {
    const auto& bytes = asset_.chunks.at(digest);
    return lightloom_load_chunk(runtime_.get(), digest.bytes.data(), bytes.data(), bytes.size());
  }
  void load_manifest() {
    const auto manifest = encode_manifest(asset_.manifest);
    ASSERT_EQ(lightloom_load_manifest(runtime_.get(), manifest.data(), manifest.size()), LIGHTLOOM_OK);
  }
  void load_surfaces() {
    for (const ObjectEntry& o : asset_.manifest.objects) ASSERT_EQ(load_chunk(o.surface.digest), LIGHTLOOM_OK);
  }
};

TEST_F(Streaming, CellsWorkOnceTheirProbesAreThere) {
  load_manifest();
  EXPECT_EQ(load_chunk(asset_.manifest.cells[0].chunk.digest), LIGHTLOOM_ERROR_NOT_READY);
  load_surfaces();
  runtime_.light(light_);
  ASSERT_EQ(load_chunk(asset_.manifest.cells[0].chunk.digest), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_update(runtime_.get(), 2), LIGHTLOOM_OK);
  EXPECT_EQ(runtime_.counts().resident_cells, 1u);
  EXPECT_EQ(runtime_.counts().active_cells, 0u);
  for (const ProbeEntry& p : asset_.manifest.probes) ASSERT_EQ(load_chunk(p.relight.digest), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_update(runtime_.get(), 2), LIGHTLOOM_OK);
  EXPECT_EQ(runtime_.counts().active_cells, 1u);
  const std::vector<uint32_t> elements = source_.cell(0)->elements;
  const std::vector<Vec3> e = runtime_.irradiance();
  EXPECT_FALSE(e[elements[0]] == Vec3{});
  // After the cell is gone its E stays.
  ASSERT_EQ(lightloom_unload_chunk(runtime_.get(), asset_.manifest.cells[0].chunk.digest.bytes.data()), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_update(runtime_.get(), 3), LIGHTLOOM_OK);
  EXPECT_EQ(runtime_.counts().resident_cells, 0u);
  EXPECT_EQ(runtime_.irradiance(), e);
  Digest unknown;
  EXPECT_EQ(lightloom_unload_chunk(runtime_.get(), unknown.bytes.data()), LIGHTLOOM_ERROR_UNKNOWN_CHUNK);
}

TEST_F(Streaming, OutAndInAgainGivesTheSame) {
  start();
  settle();
  const std::vector<Vec3> e = runtime_.irradiance();
  const uint64_t bytes = runtime_.counts().gpu_bytes;
  for (int round = 0; round < 3; ++round) {
    for (size_t i = 0; i < asset_.manifest.probes.size(); i += 2) {
      const Digest& d = asset_.manifest.probes[i].relight.digest;
      ASSERT_EQ(lightloom_unload_chunk(runtime_.get(), d.bytes.data()), LIGHTLOOM_OK);
    }
    for (size_t i = 1; i < asset_.manifest.cells.size(); i += 2) {
      const Digest& d = asset_.manifest.cells[i].chunk.digest;
      ASSERT_EQ(lightloom_unload_chunk(runtime_.get(), d.bytes.data()), LIGHTLOOM_OK);
    }
    ASSERT_EQ(lightloom_update(runtime_.get(), 6), LIGHTLOOM_OK);
    for (const ProbeEntry& p : asset_.manifest.probes) ASSERT_EQ(load_chunk(p.relight.digest), LIGHTLOOM_OK);
    for (const CellEntry& c : asset_.manifest.cells) ASSERT_EQ(load_chunk(c.chunk.digest), LIGHTLOOM_OK);
  }
  settle();
  EXPECT_EQ(runtime_.irradiance(), e);
  EXPECT_EQ(runtime_.counts().gpu_bytes, bytes);
}

TEST_F(Streaming, ThreadsLoadAndUnloadWhileFramesRun) {
  start();
  std::atomic<bool> failed = false;
  const auto load = [&](const Digest& d) {
    const lightloom_result result = load_chunk(d);
    // All memory may be waiting for frames to finish.
    if (result != LIGHTLOOM_OK && result != LIGHTLOOM_ERROR_NOT_READY) failed = true;
  };
  const auto churn = [&](size_t first) {
    for (int round = 0; round < 6; ++round) {
      for (size_t i = first; i < asset_.manifest.cells.size(); i += 3) {
        const Digest& d = asset_.manifest.cells[i].chunk.digest;
        if (lightloom_unload_chunk(runtime_.get(), d.bytes.data()) != LIGHTLOOM_OK) failed = true;
        load(d);
      }
      for (size_t i = first; i < asset_.manifest.probes.size(); i += 3) {
        const Digest& d = asset_.manifest.probes[i].relight.digest;
        if (lightloom_unload_chunk(runtime_.get(), d.bytes.data()) != LIGHTLOOM_OK) failed = true;
        load(d);
      }
    }
  };
  std::vector<std::thread> threads;
  for (size_t t = 0; t < 3; ++t) threads.emplace_back(churn, t);
  for (int frame = 0; frame < 20; ++frame) {
    if (lightloom_update(runtime_.get(), 1) != LIGHTLOOM_OK) failed = true;
    (void)runtime_.counts();
    (void)runtime_.stats();
  }
  for (std::thread& t : threads) t.join();
  EXPECT_FALSE(failed) << joined(runtime_.received().errors);
  ASSERT_EQ(lightloom_update(runtime_.get(), 5), LIGHTLOOM_OK);
  for (const ProbeEntry& p : asset_.manifest.probes) ASSERT_EQ(load_chunk(p.relight.digest), LIGHTLOOM_OK);
  for (const CellEntry& c : asset_.manifest.cells) ASSERT_EQ(load_chunk(c.chunk.digest), LIGHTLOOM_OK);
  settle();
  EXPECT_EQ(runtime_.counts().active_cells, asset_.manifest.cells.size());
}

TEST(Budget, IsKeptAndTheRestStaysUsable) {
  SyntheticAsset asset = sparse_asset();
  const auto manifest = encode_manifest(asset.manifest);
  uint64_t without_cells = 0, cells = 0;
  for (const CellEntry& c : asset.manifest.cells) cells += c.chunk.size;
  {
    TestRuntime all;
    ASSERT_EQ(all.load(asset), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_update(all.get(), 1), LIGHTLOOM_OK);
    for (const CellEntry& c : asset.manifest.cells) lightloom_unload_chunk(all.get(), c.chunk.digest.bytes.data());
    ASSERT_EQ(lightloom_update(all.get(), 12), LIGHTLOOM_OK);
    without_cells = all.counts().gpu_bytes;
    EXPECT_EQ(all.counts().pages, 0u);
  }
  lightloom_create_info info{};
  info.struct_size = sizeof info;
  info.byte_budget = without_cells + cells / 2;
  lightloom_runtime* runtime = nullptr;
  ASSERT_EQ(lightloom_create(&info, &runtime), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_load_manifest(runtime, manifest.data(), manifest.size()), LIGHTLOOM_OK);
  const auto load = [&](const Digest& d) {
    const auto& bytes = asset.chunks.at(d);
    return lightloom_load_chunk(runtime, d.bytes.data(), bytes.data(), bytes.size());
  };
  for (const ObjectEntry& o : asset.manifest.objects) ASSERT_EQ(load(o.surface.digest), LIGHTLOOM_OK);
  for (const ProbeEntry& p : asset.manifest.probes) ASSERT_EQ(load(p.relight.digest), LIGHTLOOM_OK);
  size_t fit = 0;
  while (fit < asset.manifest.cells.size() && load(asset.manifest.cells[fit].chunk.digest) == LIGHTLOOM_OK) ++fit;
  ASSERT_LT(fit, asset.manifest.cells.size());
  ASSERT_GT(fit, 0u);
  EXPECT_EQ(load(asset.manifest.cells[fit].chunk.digest), LIGHTLOOM_ERROR_OVER_BUDGET);
  lightloom_counts counts{};
  counts.struct_size = sizeof counts;
  ASSERT_EQ(lightloom_get_counts(runtime, &counts), LIGHTLOOM_OK);
  EXPECT_EQ(counts.resident_cells, fit);
  EXPECT_LE(counts.gpu_bytes, info.byte_budget);
  // Room is made, and is there once the frames in flight are over.
  for (size_t i = 0; i < fit; ++i) {
    lightloom_unload_chunk(runtime, asset.manifest.cells[i].chunk.digest.bytes.data());
  }
  ASSERT_EQ(lightloom_update(runtime, 6), LIGHTLOOM_OK);
  EXPECT_EQ(load(asset.manifest.cells[fit].chunk.digest), LIGHTLOOM_OK);
  lightloom_destroy(runtime);
}

}  // namespace
}  // namespace lightloom
