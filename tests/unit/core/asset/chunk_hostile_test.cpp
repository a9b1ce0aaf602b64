// Chunks from a hostile hand. Offsets are those of docs/asset-format.md for the samples.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/asset/chunk.h"
#include "core/base/rng.h"
#include "tests/unit/core/asset/samples.h"

namespace lightloom {
namespace {

using ::lightloom::testing::kInf;
using ::lightloom::testing::kNan;
using ::lightloom::testing::peek;
using ::lightloom::testing::poke;
using ::lightloom::testing::sample_cell;
using ::lightloom::testing::sample_relight;
using ::lightloom::testing::sample_surface;
using ::testing::HasSubstr;

using Bytes = std::vector<uint8_t>;

// Where the sample cell's arrays start, and fields of the records.
constexpr size_t kObjects = 64, kReceivers = 144, kUniform = 192, kClusters = 208, kProbes = 304, kCorrection = 320,
                 kProjection = 336, kReconstruction = 416, kNearCounts = 464, kNearTexels = 480, kNearWeights = 496;
constexpr size_t kObjectWidth = 32, kObjectHeight = 36;
constexpr size_t kClusterSize = 48;

void expect_cell_rejected(const Bytes& bytes, const char* why) {
  const auto chunk = decode_cell(bytes);
  ASSERT_FALSE(chunk.ok()) << why;
  EXPECT_EQ(chunk.status().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(chunk.status().message()), HasSubstr(why));
}
void expect_relight_rejected(const Bytes& bytes, const char* why) {
  const auto chunk = decode_relight(bytes);
  ASSERT_FALSE(chunk.ok()) << why;
  EXPECT_THAT(std::string(chunk.status().message()), HasSubstr(why));
}
void expect_surface_rejected(const Bytes& bytes, const char* why) {
  const auto chunk = decode_surface(bytes);
  ASSERT_FALSE(chunk.ok()) << why;
  EXPECT_THAT(std::string(chunk.status().message()), HasSubstr(why));
}

TEST(HostileCell, OffsetsAreWhereTheDocumentSays) {
  const Bytes b = encode_cell(sample_cell());
  EXPECT_EQ(peek<uint32_t>(b, kObjects + 40 + kObjectWidth), 3u);
  EXPECT_EQ(peek<TexelRef>(b, kReceivers + 8), (TexelRef{0, 15}));
  EXPECT_EQ(peek<uint16_t>(b, kUniform + 2), 65535);
  EXPECT_EQ(peek<uint32_t>(b, kClusters + kClusterSize), 3u);
  EXPECT_EQ(peek<float>(b, kClusters + 40), 0.01f);
  EXPECT_EQ(peek<uint32_t>(b, kProbes + 4), 2u);
  EXPECT_EQ(peek<float>(b, kCorrection + 8), 2.0f);
  EXPECT_EQ(peek<Half>(b, kProjection + 2), float_to_half(2));
  EXPECT_EQ(peek<Half>(b, kReconstruction), float_to_half(0.5f));
  EXPECT_EQ(peek<uint16_t>(b, kNearCounts + 6), 1u);
  EXPECT_EQ(peek<uint32_t>(b, kNearTexels + 8), 33u);
  EXPECT_EQ(peek<uint16_t>(b, kNearWeights + 4), 256u);
}

TEST(HostileCell, MagicVersionAndOrder) {
  const Bytes good = encode_cell(sample_cell());
  expect_cell_rejected(encode_relight(sample_relight()), "does not start with LLCC");
  expect_cell_rejected({}, "does not start with LLCC");
  expect_cell_rejected(poke<uint32_t>(good, 4, 1), "version 1 is unknown");
  expect_cell_rejected(poke<uint32_t>(good, 4, 0), "version 0 is unknown");
  expect_cell_rejected(poke<uint32_t>(good, 8, 10), "SH order");
  expect_cell_rejected(poke<uint32_t>(good, 8, 0xffffffff), "SH order");
  expect_cell_rejected(poke<uint32_t>(good, 8, 2), "reaches past");  // a longer stride
}

TEST(HostileCell, EveryCountIsChecked) {
  const Bytes good = encode_cell(sample_cell());
  for (const size_t at : {16u, 20u, 24u, 28u, 48u, 52u}) {  // objects, receivers, clusters, their probes, columns, near
    const uint32_t count = peek<uint32_t>(good, at);
    for (const uint32_t wrong : {0u, count - 1, count + 1, count + 1000, 0x40000000u, 0x7fffffffu, 0xffffffffu}) {
      EXPECT_FALSE(decode_cell(poke(good, at, wrong)).ok()) << at << " " << wrong;
    }
  }
  for (const size_t at : {32u, 40u}) {  // projection, reconstruction halfs
    const uint64_t count = peek<uint64_t>(good, at);
    for (const uint64_t wrong :
         {uint64_t{0}, count - 1, count + 1, uint64_t{1} << 40, uint64_t{1} << 63, ~uint64_t{0}}) {
      EXPECT_FALSE(decode_cell(poke(good, at, wrong)).ok()) << at << " " << wrong;
    }
  }
}

TEST(HostileCell, Indices) {
  const Bytes good = encode_cell(sample_cell());
  expect_cell_rejected(poke<uint32_t>(good, kReceivers, 2), "outside its object's lightmap");  // slot
  expect_cell_rejected(poke<uint32_t>(good, kReceivers + 4, 16),
                       "outside its object's lightmap");  // key of a 4×2
  expect_cell_rejected(poke<uint32_t>(good, kReceivers + 20, 18),
                       "outside its object's lightmap");  // key of a 3×3
  expect_cell_rejected(poke<uint32_t>(good, kReceivers + 4, ~0u), "outside its object's lightmap");
  expect_cell_rejected(poke<uint32_t>(good, kProbes, 3), "probe index");
  expect_cell_rejected(poke<uint32_t>(good, kNearTexels, 34), "near texel");
  expect_cell_rejected(poke<uint32_t>(good, kNearTexels, RelightChunk::kSky), "near texel");
  expect_cell_rejected(poke<uint16_t>(good, kNearCounts, 1), "near texels");
  expect_cell_rejected(poke<uint16_t>(good, kNearCounts, 65535), "near texels");
  expect_cell_rejected(poke<uint32_t>(good, 12, 2), "probe index");  // the cell has fewer probes
}

TEST(HostileCell, LightmapSizes) {
  const Bytes good = encode_cell(sample_cell());
  for (const size_t at : {kObjectWidth, kObjectHeight}) {
    for (const uint32_t side : {0u, 16385u, 0xffffffffu}) {
      expect_cell_rejected(poke(good, kObjects + at, side), "lightmap size is out of range");
    }
  }
}

TEST(HostileCell, CoefficientsMustBeFinite) {
  const Bytes good = encode_cell(sample_cell());
  for (const float v : {kNan, kInf, -kInf}) expect_cell_rejected(poke(good, kCorrection + 4, v), "not finite");
  for (const Half h : {Half{0x7c00}, Half{0xfc00}, Half{0x7e00}, Half{0x7c01}}) {
    expect_cell_rejected(poke(good, kProjection + 6, h), "not finite");
    expect_cell_rejected(poke(good, kReconstruction + 46, h), "not finite");  // padding too
  }
}

TEST(HostileCell, ClustersMustFollowOn) {
  const Bytes good = encode_cell(sample_cell());
  constexpr size_t kSecond = kClusters + kClusterSize;
  expect_cell_rejected(poke<uint32_t>(good, kSecond, 2), "do not follow on");      // overlap
  expect_cell_rejected(poke<uint32_t>(good, kSecond, 4), "do not follow on");      // gap
  expect_cell_rejected(poke<uint32_t>(good, kClusters, 1), "do not follow on");    // not from the start
  expect_cell_rejected(poke<uint32_t>(good, kSecond + 4, 0), "do not follow on");  // empty
  expect_cell_rejected(poke<uint32_t>(good, kSecond + 4, 3), "reaches past");
  expect_cell_rejected(poke<uint32_t>(good, kSecond + 4, ~0u), "reaches past");
  expect_cell_rejected(poke<uint32_t>(good, kSecond + 4, 1), "do not cover");
  expect_cell_rejected(poke<uint32_t>(good, kSecond + 8, 2), "reaches past");  // probes
  expect_cell_rejected(poke<uint32_t>(good, kSecond + 8, ~0u), "reaches past");
  expect_cell_rejected(poke<uint32_t>(good, kSecond + 8, 0), "columns but no probes");
  expect_cell_rejected(poke<uint32_t>(good, kSecond + 12, 2), "reaches past");  // rank
  expect_cell_rejected(poke<uint32_t>(good, kSecond + 12, ~0u), "reaches past");
  expect_cell_rejected(poke<uint32_t>(good, kSecond + 12, 0), "do not cover");
}

TEST(HostileCell, ClusterBoundsAndError) {
  const Bytes good = encode_cell(sample_cell());
  for (size_t field = 16; field <= 40; field += 4) {
    for (const float v : {kNan, kInf, -kInf}) expect_cell_rejected(poke(good, kClusters + field, v), "not finite");
  }
  for (const size_t lo : {16u, 20u, 24u}) expect_cell_rejected(poke(good, kClusters + lo, 1e6f), "bounds are empty");
}

TEST(HostileRelight, Fields) {
  const Bytes good = encode_relight(sample_relight());
  // header 32, 2 objects at 32, 8 rays at 112
  ASSERT_EQ(good.size(), 144u);
  expect_relight_rejected(encode_cell(sample_cell()), "does not start with LLCR");
  expect_relight_rejected(poke<uint32_t>(good, 4, 9), "version 9 is unknown");
  for (const size_t at : {8u, 12u}) {
    const uint32_t count = peek<uint32_t>(good, at);
    for (const uint32_t wrong : {0u, count - 1, count + 1, 0x40000000u, 0xffffffffu}) {
      EXPECT_FALSE(decode_relight(poke(good, at, wrong)).ok()) << at << " " << wrong;
    }
  }
  for (const size_t at : {16u, 20u, 24u}) expect_relight_rejected(poke(good, at, kNan), "position is not finite");
  expect_relight_rejected(poke<uint32_t>(good, 32 + kObjectWidth, 0), "lightmap size is out of range");
  expect_relight_rejected(poke<uint32_t>(good, 72 + kObjectHeight, 20000), "lightmap size is out of range");
  expect_relight_rejected(poke<uint32_t>(good, 112 + 4, 34), "outside its objects' lightmaps");
  expect_relight_rejected(poke<uint32_t>(good, 112 + 4, 0xfffffffd), "outside its objects' lightmaps");
}

TEST(HostileRelight, TexelKeysMustFit32Bits) {
  RelightChunk c;
  c.objects.assign(7, {lightloom::testing::digest_of(1), 16384, 16384});  // 7·2²⁹ keys
  EXPECT_TRUE(decode_relight(encode_relight(c)).ok());
  c.objects.push_back(c.objects[0]);  // 2³²
  expect_relight_rejected(encode_relight(c), "too many texels");
}

TEST(HostileSurface, Fields) {
  const Bytes good = encode_surface(sample_surface());
  // header 56, keys at 64, positions at 80, normals at 128, areas at 144
  ASSERT_EQ(good.size(), 160u);
  expect_surface_rejected(encode_cell(sample_cell()), "does not start with LLCS");
  expect_surface_rejected(poke<uint32_t>(good, 4, 9), "version 9 is unknown");
  for (const uint32_t wrong : {0u, 3u, 5u, 0x40000000u, 0xffffffffu}) {
    EXPECT_FALSE(decode_surface(poke(good, 8, wrong)).ok()) << wrong;
  }
  expect_surface_rejected(poke<uint32_t>(good, 16 + kObjectWidth, 0), "lightmap size is out of range");
  expect_surface_rejected(poke<uint32_t>(good, 16 + kObjectHeight, 16385), "lightmap size is out of range");
  expect_surface_rejected(poke<uint32_t>(good, 64 + 12, 16), "not sorted keys");  // beyond the lightmap
  expect_surface_rejected(poke<uint32_t>(good, 64 + 4, 8), "not sorted keys");    // twice
  expect_surface_rejected(poke<uint32_t>(good, 64, 4), "not sorted keys");        // out of order
  for (const float v : {kNan, kInf, -kInf}) {
    expect_surface_rejected(poke(good, 80 + 16, v), "not finite");
    expect_surface_rejected(poke(good, 144 + 8, v), "not finite");
  }
}

TEST(HostileSurface, AnyNormalBitsDecodeToAUnitVector) {
  const Bytes good = encode_surface(sample_surface());
  Rng rng(5);
  std::vector<uint32_t> patterns = {0, 0x80008000, 0x00008000, 0x80000000, 0x7fff7fff, 0x80007fff, 0xffffffff};
  for (int i = 0; i < 10000; ++i) patterns.push_back(rng.next_u32());
  for (const uint32_t bits : patterns) {
    const auto c = decode_surface(poke(good, 128, bits));
    ASSERT_TRUE(c.ok()) << bits;
    ASSERT_NEAR(length(c->normals[0]), 1, 1e-6f) << bits;
  }
}

/// Decodes as all three kinds; a chunk that is accepted can be encoded again.
bool decode_any(const Bytes& bytes) {
  const auto cell = decode_cell(bytes);
  if (cell.ok()) {
    EXPECT_EQ(encode_cell(*cell).size(), bytes.size());
  }
  const auto relight = decode_relight(bytes);
  if (relight.ok()) {
    EXPECT_EQ(encode_relight(*relight).size(), bytes.size());
  }
  const auto surface = decode_surface(bytes);
  if (surface.ok()) {
    EXPECT_EQ(encode_surface(*surface).size(), bytes.size());
  }
  return cell.ok() || relight.ok() || surface.ok();
}

class HostileBytes : public ::testing::TestWithParam<int> {
 protected:
  static Bytes sample() {
    return GetParam() == 0   ? encode_cell(sample_cell())
           : GetParam() == 1 ? encode_relight(sample_relight())
                             : encode_surface(sample_surface());
  }
};

TEST_P(HostileBytes, EveryTruncationAndAnyExcessIsRejected) {
  const Bytes good = sample();
  ASSERT_TRUE(decode_any(good));
  for (size_t n = 0; n < good.size(); ++n)
    EXPECT_FALSE(decode_any(Bytes(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(n)))) << n;
  Bytes longer = good;
  for (int i = 0; i < 20; ++i) {
    longer.push_back(0);
    EXPECT_FALSE(decode_any(longer));
  }
}

TEST_P(HostileBytes, RandomFlipsNeverCrash) {
  const Bytes good = sample();
  Rng rng(static_cast<uint64_t>(GetParam()));
  int rejected = 0;
  for (int i = 0; i < 10000; ++i) {
    Bytes bytes = good;
    const uint32_t flips = 1 + rng.next_below(4);
    for (uint32_t f = 0; f < flips; ++f) {
      uint8_t& b = bytes[rng.next_below(static_cast<uint32_t>(bytes.size()))];
      b = rng.next_below(2) ? static_cast<uint8_t>(b ^ 1u << rng.next_below(8)) : static_cast<uint8_t>(rng.next_u32());
    }
    rejected += !decode_any(bytes);
  }
  EXPECT_GT(rejected, 1000);
  EXPECT_LT(rejected, 10000) << "payload bytes may change unseen: their digest guards them";
}

INSTANTIATE_TEST_SUITE_P(Kinds, HostileBytes, ::testing::Values(0, 1, 2));

}  // namespace
}  // namespace lightloom
