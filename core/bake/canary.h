// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0x95, 0x8c, 0x26, 0x73, 0xb5, 0xe8, 0xc4, 0xf1, 0x49, 0x90, 0x1c,
                                 0x1d, 0x9d, 0x0c, 0xbe, 0xd1, 0xef, 0xfa, 0x98, 0x0b, 0x84, 0x58,
                                 0x01, 0xdb, 0x26, 0x2d, 0x9a, 0x93, 0xd0, 0x82, 0xef, 0x0e}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
