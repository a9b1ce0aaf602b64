// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0xc0, 0x56, 0x92, 0x4b, 0xab, 0xa8, 0x1a, 0x80, 0x63, 0x55, 0x48,
                                 0x5a, 0xff, 0x2a, 0xe2, 0x26, 0x0e, 0x45, 0xe9, 0x33, 0xe6, 0x02,
                                 0x06, 0xff, 0x74, 0x50, 0x0f, 0x2e, 0x9a, 0xd4, 0xd2, 0x08}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
