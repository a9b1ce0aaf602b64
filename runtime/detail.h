// How much of a chunk is resident. Columns are ordered by singular value, so a prefix is a coarser cell; few of a
// probe's rays are a noisier relight set.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/asset_source.h"

namespace lightloom {

struct Detail {
  uint32_t max_rank = UINT32_MAX;  ///< of cells: columns of each cluster, at most; the uniform one is always there
  uint32_t bands = UINT32_MAX;     ///< of cells: of the probes' harmonics, at most; at least 1
  bool all_rays = true;            ///< of relight sets; else coarse_rays()
  bool base = false;  ///< stays resident beneath what is loaded later, and lights again once that is dropped

  bool operator==(const Detail&) const = default;
};

/// Keeps the first columns of each cluster, and of their projection the first bands; the chunk's `order` is then the lower one. A
/// base gives all of a receiver's near field to its greatest texel: less to keep, and no less energy.
void limit(SourceCell* cell, const Detail& detail);

/// Which of N relight rays stand for all when they are far away: about 256, one of each run of as many successive rays
/// (a band of equal area), the one nearest to a golden spiral of so few points. All, if N is not much more.
std::vector<uint32_t> coarse_rays(uint32_t rays);
/// 0..rays-1.
std::vector<uint32_t> every_ray(uint32_t rays);

}  // namespace lightloom
