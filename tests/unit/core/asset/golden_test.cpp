// The stored bytes of version 1, pinned. A change here is a change of the format: it needs a new version
// number in the encoder (chunk.cpp, manifest.cpp), a reader that still knows the old one, and a line in
// docs/asset-format.md.
#include <gtest/gtest.h>

#include <string>

#include "core/base/hash.h"
#include "tests/unit/core/asset/samples.h"

namespace lightloom {
namespace {

using ::lightloom::testing::sample_cell;
using ::lightloom::testing::sample_manifest;
using ::lightloom::testing::sample_relight;
using ::lightloom::testing::sample_surface;

/// The first 64 bytes, in groups of four.
std::string excerpt(const std::vector<uint8_t>& bytes) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string out;
  for (size_t i = 0; i < 64; ++i) {
    if (i > 0 && i % 4 == 0) out += ' ';
    out += kDigits[bytes.at(i) >> 4];
    out += kDigits[bytes[i] & 15];
  }
  return out;
}

TEST(Golden, Cell) {
  const auto bytes = encode_cell(sample_cell());
  EXPECT_EQ(excerpt(bytes),
            "4c4c4343 02000000 01000000 03000000 02000000 05000000 02000000 03000000 28000000 00000000 "
            "18000000 00000000 03000000 03000000 00000000 00000000");
  EXPECT_EQ(sha256(bytes).hex(), "526b43c18437b3c4c2e9316e878911fba4d11b96dcb7e885c7e8d08c0a153075");
}

TEST(Golden, Relight) {
  const auto bytes = encode_relight(sample_relight());
  EXPECT_EQ(excerpt(bytes),
            "4c4c4352 01000000 02000000 08000000 0000c03f 000000c0 0000803e 00000000 11111111 11111111 "
            "11111111 11111111 11111111 11111111 11111111 11111111");
  EXPECT_EQ(sha256(bytes).hex(), "cf70897f51df3fb2459b209b88f176feedb84884faa8cc137a3f062304ecf664");
}

TEST(Golden, Surface) {
  const auto bytes = encode_surface(sample_surface());
  EXPECT_EQ(excerpt(bytes),
            "4c4c4353 01000000 04000000 00000000 11111111 11111111 11111111 11111111 11111111 11111111 "
            "11111111 11111111 04000000 02000000 00000000 00000000");
  EXPECT_EQ(sha256(bytes).hex(), "7f2627705237955d4a82a152ba88fc5017e9e88fb0d18b11c4ccfe6176ddc25d");
}

TEST(Golden, Manifest) {
  const auto bytes = encode_manifest(sample_manifest());
  EXPECT_EQ(excerpt(bytes),
            "4c4f4f4d 05000000 02000000 02000000 01000000 02000000 03000000 11000000 33333333 33333333 "
            "33333333 33333333 33333333 33333333 33333333 33333333");
  EXPECT_EQ(sha256(bytes).hex(), "609b293e7e515d93ed3e7c93dd9dd9e5c9e6ac9297195f1c17e53f2c3a24877a");
}

}  // namespace
}  // namespace lightloom
