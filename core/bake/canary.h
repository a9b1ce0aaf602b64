// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0x96, 0x00, 0xbb, 0x52, 0x20, 0xaf, 0x3c, 0x0b, 0x06, 0xd8, 0x4f,
                                 0x6c, 0x5e, 0x33, 0xdf, 0x8d, 0x19, 0xdc, 0x57, 0x59, 0x8d, 0x84,
                                 0x3f, 0xbd, 0xdd, 0x0e, 0x28, 0x38, 0xe5, 0x52, 0xa3, 0x8b}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
