// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0x8a, 0x88, 0x1d, 0x04, 0x74, 0x4a, 0x03, 0x3b, 0x69, 0xe5, 0x08,
                                 0x9f, 0x33, 0xd0, 0x38, 0x4b, 0x63, 0x27, 0x8b, 0xaf, 0x73, 0x56,
                                 0xa5, 0x8d, 0xfe, 0x94, 0x55, 0x9a, 0x04, 0x83, 0x71, 0xf9}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
