// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0xb8, 0x7c, 0xa8, 0xc0, 0x03, 0x0d, 0x65, 0xb1, 0x55, 0x9b, 0xae,
                                 0xa6, 0xac, 0xdf, 0x5e, 0x7d, 0x49, 0x3c, 0xde, 0xef, 0xc7, 0x9d,
                                 0xcb, 0xcf, 0x4f, 0x9d, 0x98, 0xdf, 0xa6, 0x25, 0x50, 0xdd}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level made awkward, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
