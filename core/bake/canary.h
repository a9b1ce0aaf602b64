// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0xbc, 0x22, 0x7f, 0x3b, 0x91, 0x08, 0x9a, 0x7a, 0x7e, 0x66, 0x63,
                                 0x4c, 0x30, 0x73, 0x5f, 0x77, 0x4f, 0xfc, 0xcc, 0xd0, 0x34, 0xc6,
                                 0x74, 0x20, 0xf9, 0x65, 0xcb, 0xd9, 0x77, 0x00, 0xea, 0x1d}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
