// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0x57, 0x52, 0xf9, 0x07, 0x4d, 0x5e, 0x63, 0xba, 0x37, 0x50, 0x37,
                                 0xc0, 0xda, 0x54, 0x12, 0x6a, 0x91, 0x7f, 0x01, 0x7a, 0xcf, 0xde,
                                 0xf8, 0xb8, 0xed, 0xc4, 0x66, 0xea, 0x44, 0x01, 0xdf, 0xc3}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
