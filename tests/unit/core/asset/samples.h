// A small asset made by hand, and chunks whose bytes are read and broken at known offsets.
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <vector>

#include "core/asset/asset.h"
#include "core/asset/chunk.h"
#include "core/asset/manifest.h"

namespace lightloom::testing {

inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
inline constexpr float kInf = std::numeric_limits<float>::infinity();

/// Order 1; two objects (4×2, 3×3); five receivers in two clusters: 3 receivers, probes {0,2}, rank 2, and 2
/// receivers, probe {1}, rank 1.
CellChunk sample_cell();
/// The same objects; 8 rays, of which one is dead and one hits the sky.
RelightChunk sample_relight();
/// The first of the objects; four texels.
SurfaceChunk sample_surface();
/// Names the chunks above: two objects (the second without surface), two probes, one cell.
Manifest sample_manifest();

/// An object identity whose 32 bytes are all `byte`.
Digest digest_of(uint8_t byte);

/// Writes the whole sample asset.
void write_sample(const std::filesystem::path& loom);

template <class T>
T peek(const std::vector<uint8_t>& bytes, size_t at) {
  T v{};
  std::memcpy(&v, bytes.data() + at, sizeof v);
  return v;
}

template <class T>
std::vector<uint8_t> poke(std::vector<uint8_t> bytes, size_t at, T v) {
  std::memcpy(bytes.data() + at, &v, sizeof v);
  return bytes;
}

}  // namespace lightloom::testing
