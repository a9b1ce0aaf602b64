// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0x62, 0x51, 0x65, 0x91, 0x4e, 0x1d, 0x3b, 0x85, 0xc4, 0xb0, 0x76,
                                 0x85, 0xdf, 0x19, 0xfd, 0x6e, 0xde, 0x00, 0x6f, 0xd8, 0x41, 0x12,
                                 0xab, 0x3e, 0x12, 0xd7, 0x41, 0xf9, 0x02, 0x64, 0xde, 0x92}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
