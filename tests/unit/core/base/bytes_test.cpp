#include "core/base/bytes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace lightloom {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<uint8_t> sample() {
  ByteWriter w;
  w.value<uint32_t>(0x04030201);
  w.array(std::vector<uint16_t>{0x0605, 0x0807});
  w.array(std::vector<uint32_t>{});
  w.array(std::vector<uint8_t>{9});
  return std::move(w).take();
}

TEST(Bytes, WritesLittleEndianAndStartsArraysAtMultiplesOf16) {
  std::vector<uint8_t> expected(33, 0);
  for (size_t i = 0; i < 4; ++i) expected[i] = static_cast<uint8_t>(i + 1);
  for (size_t i = 0; i < 4; ++i) expected[16 + i] = static_cast<uint8_t>(i + 5);
  expected[32] = 9;
  EXPECT_EQ(sample(), expected);
}

TEST(Bytes, ReadsWhatWasWritten) {
  const auto bytes = sample();
  ByteReader r(bytes);
  EXPECT_EQ(r.value<uint32_t>(), 0x04030201u);
  EXPECT_THAT(r.array<uint16_t>(2), ElementsAre(0x0605, 0x0807));
  EXPECT_THAT(r.array<uint32_t>(0), IsEmpty());
  EXPECT_FALSE(r.at_end());
  EXPECT_THAT(r.array<uint8_t>(1), ElementsAre(9));
  EXPECT_TRUE(r.at_end());
}

TEST(Bytes, EveryTruncationFails) {
  const auto bytes = sample();
  for (size_t n = 0; n < bytes.size(); ++n) {
    ByteReader r({bytes.data(), n});
    r.value<uint32_t>();
    r.array<uint16_t>(2);
    r.array<uint32_t>(0);
    r.array<uint8_t>(1);
    EXPECT_FALSE(r.ok()) << n;
    EXPECT_FALSE(r.at_end()) << n;
  }
}

TEST(Bytes, FailureSticks) {
  const auto bytes = sample();
  ByteReader r(bytes);
  r.array<uint64_t>(1000);
  ASSERT_FALSE(r.ok());
  EXPECT_EQ(r.value<uint32_t>(), 0u) << "there are bytes left, but the reader has failed";
  EXPECT_THAT(r.array<uint8_t>(1), IsEmpty());
  EXPECT_THAT(r.array<uint8_t>(0), IsEmpty());
  EXPECT_FALSE(r.ok());
  EXPECT_FALSE(r.at_end());
}

TEST(Bytes, CountsBeyondTheDataFailWithoutAllocating) {
  const auto bytes = sample();
  for (const uint64_t count : {uint64_t{5}, uint64_t{1} << 40, std::numeric_limits<uint64_t>::max() / 8,
                               std::numeric_limits<uint64_t>::max()}) {
    ByteReader r(bytes);
    EXPECT_NO_THROW(EXPECT_THAT(r.array<uint64_t>(count), IsEmpty()));
    EXPECT_FALSE(r.ok()) << count;
  }
}

TEST(Bytes, PaddingMustBeZero) {
  auto bytes = sample();
  for (const size_t at : {size_t{4}, size_t{15}, size_t{20}, size_t{31}}) {
    bytes[at] = 1;
    ByteReader r(bytes);
    r.value<uint32_t>();
    r.array<uint16_t>(2);
    r.array<uint8_t>(1);
    EXPECT_FALSE(r.ok()) << at;
    bytes[at] = 0;
  }
}

TEST(Bytes, NothingReadsAsNothing) {
  ByteReader r({});
  EXPECT_TRUE(r.at_end());
  EXPECT_THAT(r.array<uint32_t>(0), IsEmpty());
  EXPECT_TRUE(r.at_end());
  EXPECT_EQ(r.value<uint8_t>(), 0);
  EXPECT_FALSE(r.ok());
}

}  // namespace
}  // namespace lightloom
