#include "bake-server/blobs/blob_store.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <fstream>
#include <string>
#include <thread>

#include "core/base/rng.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

std::vector<uint8_t> some_bytes(size_t n, uint64_t seed) {
  Rng rng(seed);
  std::vector<uint8_t> out(n);
  for (uint8_t& b : out) b = static_cast<uint8_t>(256 * rng.next_float());
  return out;
}

class Blobs : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "lightloom-blobs-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
    open();
  }
  void TearDown() override { fs::remove_all(folder_); }
  void open() {
    auto opened = BlobStore::open(folder_ / "blobs");
    ASSERT_TRUE(opened.ok()) << opened.status();
    store_ = *std::move(opened);
  }
  size_t parts() const {
    return static_cast<size_t>(
        std::distance(fs::directory_iterator(folder_ / "blobs/uploads"), fs::directory_iterator()));
  }

  fs::path folder_;
  std::unique_ptr<BlobStore> store_;
};

TEST_F(Blobs, WhatWasPutIsThere) {
  const auto bytes = some_bytes(100'000, 1);
  const auto digest = store_->put(bytes);
  ASSERT_TRUE(digest.ok()) << digest.status();
  EXPECT_EQ(*digest, sha256(bytes));
  EXPECT_TRUE(store_->has(*digest));
  EXPECT_EQ(*store_->size(*digest), bytes.size());
  EXPECT_EQ(*store_->read(*digest, 0, 1 << 20), bytes);
  EXPECT_EQ(*store_->read(*digest, 99'000, 5'000), std::vector<uint8_t>(bytes.begin() + 99'000, bytes.end()));
  EXPECT_TRUE(store_->read(*digest, 100'000, 10)->empty());
  EXPECT_EQ(*store_->put(bytes), *digest);
  EXPECT_EQ(store_->read(sha256("other"), 0, 1).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(Blobs, AnUploadThatWasCutGoesOn) {
  const auto bytes = some_bytes(3000, 2);
  const std::span<const uint8_t> all(bytes);
  const Digest digest = sha256(bytes);
  EXPECT_EQ(store_->uploaded(digest), 0u);
  ASSERT_TRUE(store_->append(digest, 3000, 0, all.first(1000)).ok());
  open();  // the server restarts
  EXPECT_EQ(store_->uploaded(digest), 1000u);
  EXPECT_FALSE(store_->has(digest));
  EXPECT_EQ(store_->append(digest, 3000, 500, all.subspan(500)).code(), absl::StatusCode::kAborted);
  ASSERT_TRUE(store_->append(digest, 3000, 1000, all.subspan(1000)).ok());
  EXPECT_TRUE(store_->has(digest));
  EXPECT_EQ(*store_->read(digest, 0, 4000), bytes);
  EXPECT_EQ(parts(), 0u);
  EXPECT_TRUE(store_->append(digest, 3000, 0, all).ok()) << "sending it again is harmless";
}

TEST_F(Blobs, WrongBytesAreDropped) {
  const auto bytes = some_bytes(1000, 3);
  const Digest other = sha256("something else");
  EXPECT_EQ(store_->append(other, 1000, 0, bytes).code(), absl::StatusCode::kDataLoss);
  EXPECT_FALSE(store_->has(other));
  EXPECT_EQ(parts(), 0u);
  EXPECT_EQ(store_->append(other, 10, 0, bytes).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(store_->append(other, BlobStore::kMostBytes + 1, 0, bytes).code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(Blobs, AnEmptyBlobIsABlob) {
  const Digest digest = sha256("");
  ASSERT_TRUE(store_->append(digest, 0, 0, {}).ok());
  EXPECT_TRUE(store_->has(digest));
  EXPECT_EQ(*store_->size(digest), 0u);
}

TEST_F(Blobs, ManyUploadsOfOneBlobAtOnceMakeIt) {
  const auto bytes = some_bytes(200'000, 4);
  const Digest digest = sha256(bytes);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      while (!store_->has(digest)) {
        const uint64_t at = store_->uploaded(digest);
        const size_t n = std::min<size_t>(10'000, bytes.size() - std::min<size_t>(at, bytes.size()));
        const auto status = store_->append(digest, bytes.size(), at, std::span(bytes).subspan(at, n));
        EXPECT_TRUE(status.ok() || absl::IsAborted(status)) << status;
      }
    });
  }
  for (auto& t : threads) t.join();
  EXPECT_EQ(*store_->read(digest, 0, 1 << 20), bytes);
}

TEST_F(Blobs, AFolderThatCannotBeMadeIsNamed) {
  std::ofstream(folder_ / "file") << "x";
  const auto opened = BlobStore::open(folder_ / "file/blobs");
  ASSERT_FALSE(opened.ok());
  EXPECT_NE(std::string(opened.status().message()).find("file/blobs"), std::string::npos);
}

}  // namespace
}  // namespace lightloom
