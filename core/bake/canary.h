// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0xc4, 0x9b, 0x89, 0x2a, 0x7d, 0x73, 0xd1, 0xe0, 0x2a, 0x1d, 0x0d,
                                 0xa7, 0xd0, 0xf4, 0xdf, 0x83, 0x11, 0x04, 0xa2, 0x0e, 0x87, 0x75,
                                 0x5b, 0x61, 0xb8, 0x93, 0x07, 0x32, 0xca, 0xb5, 0x42, 0x33}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
