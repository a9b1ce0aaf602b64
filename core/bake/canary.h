// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0xec, 0xf4, 0x15, 0x5c, 0x6f, 0x6e, 0x14, 0x02, 0x7c, 0x35, 0xe3,
                                 0xed, 0x48, 0xd3, 0x71, 0x53, 0x0e, 0x2e, 0x13, 0x3f, 0x67, 0xc4,
                                 0xe4, 0x1f, 0xd7, 0x57, 0xd7, 0xf2, 0x37, 0x86, 0xc8, 0x00}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
