#include "core/asset/asset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <functional>
#include <string>

#include "core/base/file.h"
#include "tests/unit/core/asset/samples.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using ::lightloom::testing::digest_of;
using ::lightloom::testing::sample_cell;
using ::lightloom::testing::sample_manifest;
using ::lightloom::testing::sample_surface;
using ::lightloom::testing::write_sample;
using ::testing::HasSubstr;

class AssetTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = ::testing::TempDir() + "lightloom-asset-XXXXXX";
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    loom_ = name;
  }
  void TearDown() override { fs::remove_all(loom_); }

  /// Without fsync: thousands of times.
  static void overwrite(const fs::path& path, const std::vector<uint8_t>& bytes) {
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    ASSERT_TRUE(file.good());
  }
  std::vector<fs::path> chunks() const {
    std::vector<fs::path> out;
    for (const auto& entry : fs::recursive_directory_iterator(loom_ / "chunks")) {
      if (entry.is_regular_file()) out.push_back(entry.path());
    }
    return out;
  }

  fs::path loom_;
};

const std::vector<uint8_t> kBytes = {1, 2, 3, 4, 5};

TEST_F(AssetTest, StoreGivesBackWhatWasPut) {
  const ChunkStore store(loom_);
  const auto ref = store.put(kBytes);
  ASSERT_TRUE(ref.ok()) << ref.status();
  EXPECT_EQ(ref->digest, sha256(kBytes));
  EXPECT_EQ(ref->size, 5u);
  const std::string hex = ref->digest.hex();
  EXPECT_EQ(store.path(ref->digest), loom_ / hex.substr(0, 2) / hex.substr(2));
  EXPECT_EQ(*store.get(*ref), kBytes);
}

TEST_F(AssetTest, PuttingTwiceLeavesTheFileAlone) {
  const ChunkStore store(loom_);
  const ChunkRef ref = *store.put(kBytes);
  const fs::path path = store.path(ref.digest);
  fs::last_write_time(path, fs::file_time_type{});
  ASSERT_TRUE(store.put(kBytes).ok());
  EXPECT_EQ(fs::last_write_time(path), fs::file_time_type{});
}

TEST_F(AssetTest, PuttingMendsADamagedChunk) {
  const ChunkStore store(loom_);
  const ChunkRef ref = *store.put(kBytes);
  for (const std::vector<uint8_t>& damaged : {std::vector<uint8_t>{1, 2, 3, 4, 6}, std::vector<uint8_t>{1, 2}}) {
    overwrite(store.path(ref.digest), damaged);
    EXPECT_FALSE(store.get(ref).ok());
    ASSERT_TRUE(store.put(kBytes).ok());
    EXPECT_TRUE(store.get(ref).ok());
  }
}

TEST_F(AssetTest, GetRejectsDamagedMissingAndMisnamedChunks) {
  const ChunkStore store(loom_);
  const ChunkRef ref = *store.put(kBytes);
  EXPECT_EQ(store.get({digest_of(1), 5}).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store.get({ref.digest, 4}).status().code(), absl::StatusCode::kDataLoss);
  overwrite(store.path(ref.digest), {1, 2, 3, 4, 6});
  const auto damaged = store.get(ref);
  EXPECT_EQ(damaged.status().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(damaged.status().message()), HasSubstr(store.path(ref.digest).string()));
}

TEST_F(AssetTest, ManifestRoundTrip) {
  ASSERT_TRUE(write_manifest(loom_, sample_manifest()).ok());
  const auto m = read_manifest(loom_);
  ASSERT_TRUE(m.ok()) << m.status();
  EXPECT_EQ(encode_manifest(*m), encode_manifest(sample_manifest()));
}

TEST_F(AssetTest, ManifestErrorsNameTheFile) {
  EXPECT_EQ(read_manifest(loom_).status().code(), absl::StatusCode::kNotFound);
  overwrite(loom_ / "manifest", {1, 2, 3});
  EXPECT_THAT(std::string(read_manifest(loom_).status().message()), HasSubstr((loom_ / "manifest").string()));
}

TEST_F(AssetTest, VerifyAcceptsTheSample) {
  write_sample(loom_);
  EXPECT_EQ(chunks().size(), 5u);
  EXPECT_TRUE(verify_asset(loom_).ok()) << verify_asset(loom_);
}

TEST_F(AssetTest, VerifyFindsAnyFlippedByte) {
  write_sample(loom_);
  for (const fs::path& path : chunks()) {
    const std::vector<uint8_t> good = *read_file(path);
    for (size_t at = 0; at < good.size(); ++at) {
      std::vector<uint8_t> bad = good;
      bad[at] ^= static_cast<uint8_t>(1 << at % 8);
      overwrite(path, bad);
      const absl::Status status = verify_asset(loom_);
      ASSERT_EQ(status.code(), absl::StatusCode::kDataLoss) << path << " " << at;
      ASSERT_THAT(std::string(status.message()), HasSubstr(path.string()));
    }
    overwrite(path, good);
  }
  EXPECT_TRUE(verify_asset(loom_).ok());
}

TEST_F(AssetTest, VerifyFindsAMissingChunk) {
  write_sample(loom_);
  for (const fs::path& path : chunks()) {
    fs::rename(path, loom_ / "away");
    const absl::Status status = verify_asset(loom_);
    EXPECT_EQ(status.code(), absl::StatusCode::kNotFound) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(path.string()));
    fs::rename(loom_ / "away", path);
  }
  EXPECT_TRUE(verify_asset(loom_).ok());
}

TEST_F(AssetTest, VerifyFindsTheChunkOfAnotherObject) {
  write_sample(loom_);
  Manifest m = sample_manifest();
  std::swap(m.objects[0].surface, m.objects[1].surface);
  ASSERT_TRUE(write_manifest(loom_, m).ok());
  const absl::Status status = verify_asset(loom_);
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("surface of object 'floor'"));
}

TEST_F(AssetTest, VerifyFindsAChunkOfAnotherKind) {
  write_sample(loom_);
  Manifest m = sample_manifest();
  m.cells[0].chunk = m.probes[0].relight;
  ASSERT_TRUE(write_manifest(loom_, m).ok());
  EXPECT_THAT(std::string(verify_asset(loom_).message()), HasSubstr("cell 0: cell chunk is corrupt"));
}

TEST_F(AssetTest, VerifyFindsTexelsThatNoSurfaceHas) {
  struct Case {
    const char* message;
    std::function<void(CellChunk&)> edit;
  };
  const std::vector<Case> cases = {
      {"a receiver that no surface has", [](CellChunk& c) { c.receivers[4].key = 8; }},
      {"a receiver that is there twice", [](CellChunk& c) { c.receivers[4] = c.receivers[1]; }},
      {"a texel that no surface has", [](CellChunk& c) { c.near_texels[0] = 1; }},
  };
  for (const Case& each : cases) {
    write_sample(loom_);
    CellChunk cell = sample_cell();
    each.edit(cell);
    Manifest m = sample_manifest();
    m.cells[0].chunk = *chunk_store(loom_).put(encode_cell(cell));
    ASSERT_TRUE(write_manifest(loom_, m).ok());
    EXPECT_THAT(std::string(verify_asset(loom_).message()), HasSubstr(each.message));
  }
  write_sample(loom_);
  RelightChunk relight = testing::sample_relight();
  relight.rays[3] = 17;
  Manifest m = sample_manifest();
  m.probes[0].relight = *chunk_store(loom_).put(encode_relight(relight));
  ASSERT_TRUE(write_manifest(loom_, m).ok());
  EXPECT_THAT(std::string(verify_asset(loom_).message()), HasSubstr("relight set of probe 0: a texel that no surface"));
}

TEST_F(AssetTest, VerifyFindsEveryDisagreement) {
  write_sample(loom_);
  const std::vector<std::function<void(Manifest&)>> edits = {
      [](Manifest& m) { m.params.order = 2; },
      [](Manifest& m) { m.params.relight_rays = 7; },
      [](Manifest& m) { m.probes[0].position.x += 1; },
      [](Manifest& m) { std::swap(m.probes[0].relight, m.probes[1].relight); },
      [](Manifest& m) { m.cells[0].receivers = 4; },
      [](Manifest& m) { m.cells[0].probes = 2; },
      [](Manifest& m) { m.cells[0].clusters = 1, m.clusters.pop_back(); },
      [](Manifest& m) { m.clusters[0].receivers = 2; },
      [](Manifest& m) { m.clusters[1].rank = 2; },
      [](Manifest& m) { m.clusters[1].probes = 2; },
      [](Manifest& m) { m.objects[0].width = 3; },   // of the surface, the relight sets and the cell
      [](Manifest& m) { m.objects[1].height = 2; },  // of the relight sets and the cell
      [](Manifest& m) { m.objects[1].id = digest_of(9); },
      [](Manifest& m) { m.objects.pop_back(); },
  };
  for (size_t i = 0; i < edits.size(); ++i) {
    Manifest m = sample_manifest();
    edits[i](m);
    ASSERT_TRUE(write_manifest(loom_, m).ok());
    const absl::Status status = verify_asset(loom_);
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << i << ": " << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("does not match the manifest")) << i;
  }
}

}  // namespace
}  // namespace lightloom
