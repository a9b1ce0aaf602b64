// The streaming functions of the C API, on both backends.
#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <set>

#include "tests/unit/runtime/test_runtime.h"

namespace lightloom {
namespace {

using testing::joined;
using testing::p999_error;
using testing::SyntheticAsset;
using testing::TestRuntime;

/// Reads from an asset; some chunks cannot be read, or are not what they should be.
struct Reader {
  const SyntheticAsset* asset;
  std::mutex mutex;
  std::set<Digest> missing, damaged;
  std::atomic<int> reads{0};

  static int read(void* user, const uint8_t digest[32], uint64_t size, void* out) {
    auto* self = static_cast<Reader*>(user);
    ++self->reads;
    Digest d;
    std::copy(digest, digest + 32, d.bytes.begin());
    const std::vector<uint8_t>& bytes = self->asset->chunks.at(d);
    EXPECT_EQ(bytes.size(), size);
    const std::lock_guard lock(self->mutex);
    if (self->missing.count(d) > 0) return 1;
    std::copy(bytes.begin(), bytes.end(), static_cast<uint8_t*>(out));
    if (self->damaged.count(d) > 0) static_cast<uint8_t*>(out)[size / 2] ^= 1;
    return 0;
  }
};

class StreamTest : public ::testing::TestWithParam<uint32_t> {
 protected:
  StreamTest() {
    testing::RandomAssetOptions o;
    o.order = 5;
    o.relight_rays = 1024;
    o.objects = 8;
    o.side = 20;
    o.probes = 60;
    o.cells = 16;
    asset_ = testing::random_asset(o);
    manifest_ = encode_manifest(asset_.manifest);
    light_ = testing::random_light((*asset_.open()).surface_elements(), 5);
    reader_.asset = &asset_;
    EXPECT_EQ(lightloom_load_manifest(runtime_.get(), manifest_.data(), manifest_.size()), LIGHTLOOM_OK);
    runtime_.light(light_);
  }
  ~StreamTest() override { lightloom_stream_destroy(stream_); }
  void create(uint32_t flags, uint64_t byte_budget = 0) {
    lightloom_stream_info info{};
    info.struct_size = sizeof info;
    info.flags = flags;
    info.read_chunk = Reader::read;
    info.read_user = &reader_;
    info.byte_budget = byte_budget;
    ASSERT_EQ(lightloom_stream_create(runtime_.get(), &info, &stream_), LIGHTLOOM_OK);
  }
  void see(Vec3 position) {
    lightloom_stream_view view{};
    view.struct_size = sizeof view;
    std::copy(&position.x, &position.x + 3, view.position);
    ASSERT_EQ(lightloom_stream_set_view(stream_, &view), LIGHTLOOM_OK);
  }
  lightloom_stream_state state() const {
    lightloom_stream_state s{};
    s.struct_size = sizeof s;
    EXPECT_EQ(lightloom_stream_get_state(stream_, &s), LIGHTLOOM_OK);
    return s;
  }
  /// Views and frames until the stream has nothing to do.
  void finish() {
    for (int frame = 0; frame < 500; ++frame) {
      see({0, 0, 0});
      uint32_t more = 1;
      ASSERT_EQ(lightloom_stream_work(stream_, UINT64_MAX, &more), LIGHTLOOM_OK);
      ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
      if (more == 0) return;
    }
    FAIL() << "the stream does not end";
  }
  std::vector<Vec3> settled() {
    runtime_.settle();
    return runtime_.irradiance();
  }
  std::vector<Vec3> whole() {
    TestRuntime other(GetParam() | LIGHTLOOM_CREATE_SMOOTHING);
    EXPECT_EQ(other.load(asset_), LIGHTLOOM_OK);
    other.light(light_);
    other.settle();
    return other.irradiance();
  }

  SyntheticAsset asset_;
  std::vector<uint8_t> manifest_;
  SurfaceLight light_;
  Reader reader_;
  TestRuntime runtime_{GetParam() | LIGHTLOOM_CREATE_SMOOTHING};
  lightloom_stream* stream_ = nullptr;
};

TEST_P(StreamTest, WithoutABudgetAllOfItArrives) {
  create(LIGHTLOOM_STREAM_NO_THREAD);
  finish();
  EXPECT_EQ(state().done, 1u);
  EXPECT_EQ(state().all_cells, asset_.manifest.cells.size());
  EXPECT_EQ(state().failing, 0u);
  EXPECT_LT(p999_error(settled(), whole()), 1e-4);
  const int reads = reader_.reads;
  finish();
  EXPECT_EQ(reader_.reads, reads);
}

/// Then a base has all rays, and there is nothing above it.
TEST_P(StreamTest, ProbesOfFewRays) {
  testing::RandomAssetOptions o;
  o.relight_rays = 64;
  asset_ = testing::random_asset(o);
  manifest_ = encode_manifest(asset_.manifest);
  light_ = testing::random_light((*asset_.open()).surface_elements(), 5);
  ASSERT_EQ(lightloom_load_manifest(runtime_.get(), manifest_.data(), manifest_.size()), LIGHTLOOM_OK);
  runtime_.light(light_);
  create(LIGHTLOOM_STREAM_NO_THREAD);
  finish();
  EXPECT_EQ(state().done, 1u);
  EXPECT_LT(p999_error(settled(), whole()), 1e-4);
}

TEST_P(StreamTest, WithATinyBudgetNothingIsBlack) {
  create(LIGHTLOOM_STREAM_NO_THREAD, 1);
  finish();
  EXPECT_EQ(state().base_cells, asset_.manifest.cells.size());
  EXPECT_EQ(runtime_.counts().active_cells, asset_.manifest.cells.size());
  EXPECT_EQ(state().some_cells + state().all_cells + state().all_probes, 0u);
}

TEST_P(StreamTest, PinnedCellsComeFirst) {
  // All cells are at the same place but one.
  asset_.manifest.cells[3].bounds = {{50, 0, 0}, {51, 1, 1}};
  manifest_ = encode_manifest(asset_.manifest);
  ASSERT_EQ(lightloom_load_manifest(runtime_.get(), manifest_.data(), manifest_.size()), LIGHTLOOM_OK);
  create(LIGHTLOOM_STREAM_NO_THREAD, 1);
  finish();
  const uint64_t bases = state().bytes;
  lightloom_stream_destroy(stream_);
  ASSERT_EQ(lightloom_load_manifest(runtime_.get(), manifest_.data(), manifest_.size()), LIGHTLOOM_OK);
  create(LIGHTLOOM_STREAM_NO_THREAD, bases + asset_.manifest.cells[3].chunk.size * 5 / 4);
  const float lo[] = {49, 0, 0}, hi[] = {50.5f, 1, 1};
  ASSERT_EQ(lightloom_stream_pin(stream_, lo, hi, 1), LIGHTLOOM_OK);
  finish();
  std::vector<uint8_t> levels(asset_.manifest.cells.size());
  ASSERT_EQ(lightloom_stream_get_levels(stream_, levels.data(), static_cast<uint32_t>(levels.size())), LIGHTLOOM_OK);
  EXPECT_EQ(levels[3], 3);
  EXPECT_EQ(std::count(levels.begin(), levels.end(), 3), 1);
  EXPECT_EQ(lightloom_stream_get_levels(stream_, levels.data(), 1), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_stream_pin(stream_, nullptr, hi, 1), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
}

TEST_P(StreamTest, ChunksThatCannotBeReadAreTriedAgainAndDoNotStopTheRest) {
  reader_.missing = {asset_.manifest.cells[2].chunk.digest, asset_.manifest.objects[1].surface.digest};
  reader_.damaged = {asset_.manifest.probes[5].relight.digest};
  create(LIGHTLOOM_STREAM_NO_THREAD);
  for (int frame = 0; frame < 3; ++frame) {
    see({0, 0, 0});
    ASSERT_EQ(lightloom_stream_work(stream_, UINT64_MAX, nullptr), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  }
  EXPECT_GE(state().failing, 3u);
  const std::string errors = joined(runtime_.received().errors);
  EXPECT_NE(errors.find(asset_.manifest.cells[2].chunk.digest.hex()), std::string::npos) << errors;
  EXPECT_NE(errors.find("probe 5"), std::string::npos) << errors;
  const size_t messages = runtime_.received().errors.size();
  {
    const std::lock_guard lock(reader_.mutex);
    reader_.missing.clear();
    reader_.damaged.clear();
  }
  for (int frame = 0; frame < 300 && (state().done == 0 || state().failing > 0); ++frame) {
    see({0, 0, 0});
    ASSERT_EQ(lightloom_stream_work(stream_, UINT64_MAX, nullptr), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  }
  EXPECT_EQ(state().failing, 0u);
  EXPECT_EQ(runtime_.received().errors.size(), messages);
  EXPECT_LT(p999_error(settled(), whole()), 1e-4);
}

TEST_P(StreamTest, AThreadOfItsOwn) {
  create(0);
  EXPECT_EQ(lightloom_stream_work(stream_, 1, nullptr), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  // Frames go on meanwhile.
  while (state().done == 0) {
    see({0, 0, 0});
    ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  }
  EXPECT_LT(p999_error(settled(), whole()), 1e-4);
}

TEST_P(StreamTest, DestroyedInTheMiddle) {
  for (int times = 0; times < 10; ++times) {
    create(0);
    see({0, 0, 0});
    while (reader_.reads < 3 * times) see({0, 0, 0});
    lightloom_stream_destroy(stream_);
    stream_ = nullptr;
    ASSERT_EQ(lightloom_load_manifest(runtime_.get(), manifest_.data(), manifest_.size()), LIGHTLOOM_OK);
    reader_.reads = 0;
  }
}

/// Its own pages, and more probe lists than would fit some fixed room.
TEST_P(StreamTest, AHardBudgetThatIsTooSmallIsLivedWith) {
  const uint64_t empty = runtime_.counts().gpu_bytes;
  uint64_t chunks = 0;
  for (const CellEntry& c : asset_.manifest.cells) chunks += c.chunk.size;
  lightloom_create_info info{};
  info.struct_size = sizeof info;
  info.flags = GetParam() | LIGHTLOOM_CREATE_SMOOTHING;
  info.byte_budget = empty + chunks * 2 / 3;  // bases and some
  info.page_bytes = 32 << 10;
  lightloom_runtime* small = nullptr;
  ASSERT_EQ(lightloom_create(&info, &small), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_load_manifest(small, manifest_.data(), manifest_.size()), LIGHTLOOM_OK);
  lightloom_stream_info stream_info{};
  stream_info.struct_size = sizeof stream_info;
  stream_info.flags = LIGHTLOOM_STREAM_NO_THREAD;
  stream_info.read_chunk = Reader::read;
  stream_info.read_user = &reader_;
  ASSERT_EQ(lightloom_stream_create(small, &stream_info, &stream_), LIGHTLOOM_OK);
  for (int frame = 0; frame < 200; ++frame) {
    see({0, 0, 0});
    ASSERT_EQ(lightloom_stream_work(stream_, UINT64_MAX, nullptr), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_update(small, 1), LIGHTLOOM_OK);
    lightloom_counts counts{};
    counts.struct_size = sizeof counts;
    ASSERT_EQ(lightloom_get_counts(small, &counts), LIGHTLOOM_OK);
    ASSERT_LE(counts.gpu_bytes, info.byte_budget);
  }
  EXPECT_EQ(state().base_cells + state().some_cells + state().all_cells, asset_.manifest.cells.size());
  EXPECT_GT(state().some_cells + state().all_cells + state().all_probes, 0u);
  lightloom_stream_destroy(stream_);
  stream_ = nullptr;
  lightloom_destroy(small);
}

TEST_P(StreamTest, ASecondStreamNeedsAnEmptyRuntime) {
  create(LIGHTLOOM_STREAM_NO_THREAD);
  finish();
  lightloom_stream_destroy(stream_);
  stream_ = nullptr;
  lightloom_stream_info info{};
  info.struct_size = sizeof info;
  info.read_chunk = Reader::read;
  info.read_user = &reader_;
  EXPECT_EQ(lightloom_stream_create(runtime_.get(), &info, &stream_), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  ASSERT_EQ(lightloom_reload_manifest(runtime_.get(), manifest_.data(), manifest_.size()), LIGHTLOOM_OK);
  create(LIGHTLOOM_STREAM_NO_THREAD);
  finish();
  EXPECT_LT(p999_error(settled(), whole()), 1e-4);
}

TEST_P(StreamTest, BadArguments) {
  lightloom_stream_info info{};
  EXPECT_EQ(lightloom_stream_create(runtime_.get(), &info, &stream_), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(stream_, nullptr);
  info.struct_size = sizeof info;
  EXPECT_EQ(lightloom_stream_create(runtime_.get(), &info, &stream_), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  info.read_chunk = Reader::read;
  EXPECT_EQ(lightloom_stream_create(nullptr, &info, &stream_), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_stream_create(runtime_.get(), &info, nullptr), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  info.flags = 8;
  EXPECT_EQ(lightloom_stream_create(runtime_.get(), &info, &stream_), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  create(LIGHTLOOM_STREAM_NO_THREAD);
  lightloom_stream_view view{};
  view.struct_size = sizeof view;
  view.velocity[1] = std::nanf("");
  EXPECT_EQ(lightloom_stream_set_view(stream_, &view), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_stream_set_view(stream_, nullptr), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_stream_get_state(stream_, nullptr), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  TestRuntime bare(GetParam());
  lightloom_stream* none = nullptr;
  info.flags = 0;
  EXPECT_EQ(lightloom_stream_create(bare.get(), &info, &none), LIGHTLOOM_ERROR_NO_ASSET);
}

INSTANTIATE_TEST_SUITE_P(Backends, StreamTest, ::testing::Values(0u, uint32_t{LIGHTLOOM_CREATE_CPU}),
                         [](const auto& test) { return test.param == 0 ? "Vulkan" : "Cpu"; });

}  // namespace
}  // namespace lightloom
