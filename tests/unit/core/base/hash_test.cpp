#include "core/base/hash.h"

#include <gtest/gtest.h>

namespace lightloom {
namespace {

TEST(Hash, KnownDigests) {  // FIPS 180-4's examples
  EXPECT_EQ(sha256(std::string_view("")).hex(), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256(std::string_view("abc")).hex(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(Hash, PiecesHashAsTheWhole) {
  EXPECT_EQ(Hasher().bytes("a", 1).bytes("", 0).bytes("bc", 2).finish(), sha256(std::string_view("abc")));
}

TEST(Hash, StringsAndArraysCarryTheirLength) {
  EXPECT_NE(Hasher().string("ab").string("c").finish(), Hasher().string("a").string("bc").finish());
  const std::vector<uint8_t> one{1}, none;
  EXPECT_NE(Hasher().array(one).array(none).finish(), Hasher().array(none).array(one).finish());
}

TEST(Hash, Low64IsTheFirstEightBytesLittleEndian) {
  EXPECT_EQ(sha256(std::string_view("abc")).low64(), 0xeacf018fbf1678bau);
}

}  // namespace
}  // namespace lightloom
