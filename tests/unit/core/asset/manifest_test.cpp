#include "core/asset/manifest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "core/base/rng.h"
#include "tests/unit/core/asset/samples.h"

namespace lightloom {
namespace {

using ::lightloom::testing::kInf;
using ::lightloom::testing::kNan;
using ::lightloom::testing::peek;
using ::lightloom::testing::poke;
using ::lightloom::testing::sample_manifest;
using ::testing::HasSubstr;
using ::testing::Not;

using Bytes = std::vector<uint8_t>;

/// CRC-32 of IEEE 802.3, bit by bit: an oracle for zlib's use and for the document.
uint32_t slow_crc(const uint8_t* data, size_t size) {
  uint32_t c = ~0u;
  for (size_t i = 0; i < size; ++i) {
    c ^= data[i];
    for (int bit = 0; bit < 8; ++bit) c = c >> 1 ^ (c & 1 ? 0xedb88320u : 0);
  }
  return ~c;
}

Bytes with_crc(Bytes bytes) { return poke(bytes, bytes.size() - 4, slow_crc(bytes.data(), bytes.size() - 4)); }

std::string error_of(const Bytes& bytes) {
  const auto m = decode_manifest(bytes);
  return m.ok() ? "accepted" : std::string(m.status().message());
}

TEST(Manifest, RoundTrip) {
  const Manifest m = sample_manifest();
  const Bytes bytes = encode_manifest(m);
  const auto back = decode_manifest(bytes);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->method_version, m.method_version);
  EXPECT_EQ(back->scene_hash, m.scene_hash);
  EXPECT_EQ(back->params, m.params);
  EXPECT_EQ(back->layout_mode, m.layout_mode);
  EXPECT_EQ(back->width, m.width);
  EXPECT_EQ(back->height, m.height);
  EXPECT_EQ(back->bounds.lo, m.bounds.lo);
  EXPECT_EQ(back->bounds.hi, m.bounds.hi);
  EXPECT_EQ(back->objects, m.objects);
  EXPECT_EQ(back->probes, m.probes);
  EXPECT_EQ(back->cell_probes, m.cell_probes);
  ASSERT_EQ(back->cells.size(), 1u);
  EXPECT_EQ(back->cells[0].level, -1);
  EXPECT_EQ(back->cells[0].cell, m.cells[0].cell);
  EXPECT_EQ(back->cells[0].chunk, m.cells[0].chunk);
  EXPECT_EQ(back->cells[0].unseen, 0.5f);
  ASSERT_EQ(back->clusters.size(), 2u);
  EXPECT_EQ(back->clusters[0].rank, 2u);
  EXPECT_EQ(encode_manifest(*back), bytes);
}

TEST(Manifest, OfAnEmptyLevel) {
  Manifest m;
  m.params.spacing = 1;
  m.params.near_field = 0.5f;
  const auto back = decode_manifest(encode_manifest(m));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_TRUE(back->bounds.empty());
}

TEST(Manifest, EndsWithTheCrcOfAllBefore) {
  const Bytes bytes = encode_manifest(sample_manifest());
  EXPECT_EQ(bytes.size() % 16, 4u);
  EXPECT_EQ(peek<uint32_t>(bytes, bytes.size() - 4), slow_crc(bytes.data(), bytes.size() - 4));
}

TEST(Manifest, EveryTruncationIsRejected) {
  const Bytes good = encode_manifest(sample_manifest());
  for (size_t n = 0; n < good.size(); ++n) {
    const Bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(n));
    EXPECT_FALSE(decode_manifest(cut).ok()) << n;
    if (n >= 4) {
      EXPECT_FALSE(decode_manifest(with_crc(cut)).ok()) << n << " with a right CRC";
    }
  }
}

TEST(Manifest, EveryFlippedBitIsRejected) {
  const Bytes good = encode_manifest(sample_manifest());
  for (size_t at = 0; at < good.size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      EXPECT_FALSE(decode_manifest(poke(good, at, static_cast<uint8_t>(good[at] ^ 1 << bit))).ok()) << at;
    }
    EXPECT_FALSE(decode_manifest(poke(good, at, static_cast<uint8_t>(~good[at]))).ok()) << at;
  }
}

TEST(Manifest, MagicAndVersion) {
  const Bytes good = encode_manifest(sample_manifest());
  EXPECT_THAT(error_of(poke<uint32_t>(good, 0, 0)), HasSubstr("does not start with LOOM"));
  const auto newer = decode_manifest(poke<uint32_t>(good, 4, 6));
  EXPECT_EQ(newer.status().code(), absl::StatusCode::kUnimplemented);
  EXPECT_THAT(std::string(newer.status().message()), HasSubstr("version 6"));
}

TEST(Manifest, EveryCountIsChecked) {
  const Bytes good = encode_manifest(sample_manifest());
  for (const size_t at : {8u, 12u, 16u, 20u, 24u, 28u, 140u}) {  // six counts, bytes of the method version
    const uint32_t count = peek<uint32_t>(good, at);
    for (const uint32_t wrong : {count - 1, count + 1, count + 100, 0x20000000u, 0x7fffffffu, 0xffffffffu}) {
      if (at == 24 && wrong == 4) continue;  // a fourth, unused entry lies where zeros pad the three: harmless
      EXPECT_FALSE(decode_manifest(with_crc(poke(good, at, wrong))).ok()) << at << " " << wrong;
    }
  }
}

TEST(Manifest, NameLengthsMustAddUp) {
  const Bytes good = encode_manifest(sample_manifest());
  const size_t name_bytes = 176 + 88;  // of the first object
  ASSERT_EQ(peek<uint32_t>(good, name_bytes), 5u);
  for (const uint32_t wrong : {4u, 6u, 0xffffffffu}) {
    EXPECT_THAT(error_of(with_crc(poke(good, name_bytes, wrong))), HasSubstr("strings")) << wrong;
  }
}

struct Edit {
  const char* name;
  std::function<void(Manifest&)> apply;
};

TEST(Manifest, FieldsOutOfRangeAreRejected) {
  const std::vector<Edit> edits = {
      {"order", [](Manifest& m) { m.params.order = -1; }},
      {"order", [](Manifest& m) { m.params.order = 10; }},
      {"spacing", [](Manifest& m) { m.params.spacing = 0; }},
      {"spacing", [](Manifest& m) { m.params.spacing = kNan; }},
      {"spacing", [](Manifest& m) { m.params.spacing = kInf; }},
      {"near field", [](Manifest& m) { m.params.near_field = -1; }},
      {"near field", [](Manifest& m) { m.params.near_field = kNan; }},
      {"average", [](Manifest& m) { m.params.average = -1; }},
      {"average", [](Manifest& m) { m.params.average = kNan; }},
      {"links", [](Manifest& m) { m.params.links = 0; }},
      {"rays", [](Manifest& m) { m.params.rays = 0; }},
      {"relight rays", [](Manifest& m) { m.params.relight_rays = 0; }},
      {"rank", [](Manifest& m) { m.params.max_rank = -1; }},
      {"threshold", [](Manifest& m) { m.params.threshold = kNan; }},
      {"threshold", [](Manifest& m) { m.params.threshold = -1; }},
      {"cell receivers", [](Manifest& m) { m.params.cell_receivers = 0; }},
      {"density", [](Manifest& m) { m.params.texels_per_metre = kInf; }},
      {"lightmap size", [](Manifest& m) { m.params.lightmap_size = -1; }},
      {"width", [](Manifest& m) { m.width = -1; }},
      {"height", [](Manifest& m) { m.height = (1 << 16) + 1; }},
      {"bounds", [](Manifest& m) { m.bounds.lo.y = kNan; }},
      {"bounds", [](Manifest& m) { m.bounds.hi.z = kInf; }},
      {"object x", [](Manifest& m) { m.objects[0].x = -1; }},
      {"object x", [](Manifest& m) { m.objects[0].x = 13; }},
      {"object y", [](Manifest& m) { m.objects[0].y = std::numeric_limits<int32_t>::max(); }},
      {"object width", [](Manifest& m) { m.objects[0].width = 16; }},
      {"object height", [](Manifest& m) { m.objects[0].height = -2; }},
      {"probe position", [](Manifest& m) { m.probes[1].position.z = kNan; }},
      {"first cluster", [](Manifest& m) { m.cells[0].first_cluster = 1; }},
      {"clusters", [](Manifest& m) { m.cells[0].clusters = 3; }},
      {"clusters", [](Manifest& m) { m.cells[0].clusters = 0xffffffff; }},
      {"clusters without a cell", [](Manifest& m) { m.cells[0].clusters = 1; }},
      {"first probe", [](Manifest& m) { m.cells[0].first_probe = 1; }},
      {"first probe", [](Manifest& m) { m.cells[0].first_probe = 0xffffffff; }},
      {"probes", [](Manifest& m) { m.cells[0].probes = 4; }},
      {"cell bounds", [](Manifest& m) { m.cells[0].bounds.lo.x = -kInf; }},
      {"cell error", [](Manifest& m) { m.cells[0].error = kNan; }},
      {"cell unseen", [](Manifest& m) { m.cells[0].unseen = kInf; }},
      {"cluster bounds", [](Manifest& m) { m.clusters[1].bounds.hi.y = kNan; }},
      {"cluster error", [](Manifest& m) { m.clusters[0].error = kInf; }},
      {"cell probe", [](Manifest& m) { m.cell_probes[2] = 2; }},
  };
  for (size_t i = 0; i < edits.size(); ++i) {
    Manifest m = sample_manifest();
    edits[i].apply(m);
    const auto back = decode_manifest(encode_manifest(m));
    EXPECT_EQ(back.status().code(), absl::StatusCode::kDataLoss) << i << ": " << edits[i].name;
  }
}

TEST(Manifest, ErrorsAreOneLineWhateverTheNamesAre) {
  Manifest m = sample_manifest();
  m.objects[0].name = "two\nlines\x1b[31m";
  m.objects[0].x = 100;
  const std::string error = error_of(encode_manifest(m));
  EXPECT_THAT(error, HasSubstr("outside the lightmap image"));
  EXPECT_THAT(error, Not(HasSubstr("\n")));
  EXPECT_THAT(error, Not(HasSubstr("\x1b")));
}

TEST(Manifest, RandomFlipsWithARightCrcNeverCrash) {
  const Bytes good = encode_manifest(sample_manifest());
  Rng rng(9);
  int rejected = 0;
  for (int i = 0; i < 10000; ++i) {
    Bytes bytes = good;
    const uint32_t flips = 1 + rng.next_below(4);
    for (uint32_t f = 0; f < flips; ++f) {
      bytes[rng.next_below(static_cast<uint32_t>(bytes.size()))] = static_cast<uint8_t>(rng.next_u32());
    }
    const auto m = decode_manifest(with_crc(bytes));
    if (m.ok()) {
      EXPECT_EQ(encode_manifest(*m).size(), bytes.size());
    } else {
      ++rejected;
    }
  }
  EXPECT_GT(rejected, 1000);
}

}  // namespace
}  // namespace lightloom
