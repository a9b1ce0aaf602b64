// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0x4b, 0x5f, 0xf3, 0xa0, 0xc1, 0x03, 0xd8, 0x35, 0x95, 0x5c, 0xc2,
                                 0x73, 0x3d, 0xb6, 0xdb, 0xad, 0x0c, 0x5a, 0x45, 0xf6, 0xf5, 0x33,
                                 0xb8, 0xf7, 0x20, 0x46, 0x65, 0x12, 0x37, 0x93, 0x3a, 0x37}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level made awkward, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
