// A bake cell as the GPU reads it: one block of bytes with its own tables (shaders/layout.h), which may lie anywhere in a
// pool.
#pragma once

#include <cstdint>
#include <memory_resource>
#include <vector>

#include "runtime/asset_source.h"
#include "runtime/shaders/layout.h"

namespace lightloom {

struct CellBlock {
  uint64_t bytes = 0;         ///< of the block, the coefficients that the project pass writes included
  uint64_t upload_bytes = 0;  ///< of `data`, without them
  uint32_t jobs = 0, octets = 0;
  uint64_t projection_bytes = 0, reconstruction_bytes = 0;  ///< in the asset; near fields, too
  std::pmr::vector<uint8_t> data;
};

/// Unimplemented if the block would exceed `max_bytes`.
absl::StatusOr<CellBlock> make_cell_block(const SourceCell& cell, uint64_t max_bytes,
                                          std::pmr::memory_resource* memory);

/// Y_j(ω_r) of the chosen of N relight rays, for the relight pass: [r/4][j][r%4], j < sh_stride(order), r up to a
/// multiple of gpu::kRayTile; padding 0.
std::pmr::vector<uint8_t> sh_table(uint32_t order, uint32_t rays, std::span<const uint32_t> chosen,
                                   std::pmr::memory_resource* memory);

}  // namespace lightloom
