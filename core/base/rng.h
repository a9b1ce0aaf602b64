// Counter-based random numbers. A stream is named by what it is for (a receiver, a probe, a cell), never by the thread
// or the order in which it is drawn.
#pragma once

#include <cstdint>

namespace lightloom {

/// Finalizer of SplitMix64 (Steele, Lea & Flood 2014): a bijection of 64 bits with good avalanche.
inline uint64_t mix64(uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

/// Combines two keys into one; not symmetric.
inline uint64_t hash_combine(uint64_t a, uint64_t b) { return mix64(a + 0x9e3779b97f4a7c15ull * (mix64(b) | 1)); }

/// SplitMix64 stream. Two streams with different keys are independent for all our purposes.
class Rng {
 public:
  explicit Rng(uint64_t key) : state_(mix64(key + 0x9e3779b97f4a7c15ull)) {}

  uint64_t next_u64() { return mix64(state_ += 0x9e3779b97f4a7c15ull); }
  uint32_t next_u32() { return static_cast<uint32_t>(next_u64() >> 32); }
  /// Uniform in [0, 1), a multiple of 2^-24: exact in float.
  float next_float() { return static_cast<float>(next_u64() >> 40) * 0x1p-24f; }
  /// Uniform in [0, n). REQUIRES: n > 0. Bias below 2^-32 n.
  uint32_t next_below(uint32_t n) { return static_cast<uint32_t>((static_cast<uint64_t>(next_u32()) * n) >> 32); }

 private:
  uint64_t state_;
};

}  // namespace lightloom
