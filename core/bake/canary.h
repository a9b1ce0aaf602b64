// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0x3d, 0x37, 0x43, 0x1e, 0x46, 0xb2, 0x8e, 0x1c, 0x43, 0xfc, 0xbe,
                                 0x15, 0x36, 0xb2, 0xcf, 0x5b, 0xb5, 0x58, 0x9f, 0xcc, 0x76, 0x0c,
                                 0x4b, 0xf1, 0xc8, 0x8e, 0xc2, 0x70, 0x9a, 0xee, 0x46, 0xa7}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
