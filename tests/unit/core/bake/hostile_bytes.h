// Stored bytes as a hostile sender would change them.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace lightloom::test {

template <class T>
std::vector<uint8_t> with(std::vector<uint8_t> bytes, size_t offset, T value) {
  std::memcpy(bytes.data() + offset, &value, sizeof value);
  return bytes;
}

/// Every proper prefix must be refused, and so must a byte too many.
template <class Decode>
void expect_exact_length(const std::vector<uint8_t>& bytes, const Decode& decode) {
  for (size_t n = 0; n < bytes.size(); ++n) {
    EXPECT_FALSE(decode(std::span(bytes).first(n)).ok()) << n << " of " << bytes.size() << " bytes";
  }
  std::vector<uint8_t> longer = bytes;
  longer.push_back(0);
  EXPECT_FALSE(decode(longer).ok());
}

/// A 32-bit count: whatever else stands there, it must be refused.
template <class Decode>
void expect_count_checked(const std::vector<uint8_t>& bytes, size_t offset, const Decode& decode) {
  uint32_t count = 0;
  std::memcpy(&count, bytes.data() + offset, sizeof count);
  for (const uint32_t wrong : {0u, count - 1, count + 1, count + 4, 0x7fffffffu, 0xffffffffu}) {
    if (wrong == count) continue;
    EXPECT_FALSE(decode(with(bytes, offset, wrong)).ok()) << "count " << wrong << " at " << offset;
  }
  for (int bit = 0; bit < 32; ++bit) {
    EXPECT_FALSE(decode(with(bytes, offset, count ^ (1u << bit))).ok()) << "bit " << bit << " at " << offset;
  }
}

}  // namespace lightloom::test
