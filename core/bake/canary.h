// A tiny bake whose bytes are known: a machine or a build that gives other bytes would spoil what others bake.
#pragma once

#include "core/asset/manifest.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// What bake_canary() gives. Goes with kMethodVersion: a method that stores other bytes has another one.
inline constexpr Digest kCanary{{0xe4, 0xf6, 0xcb, 0x36, 0xd3, 0xdb, 0x3d, 0xa5, 0x75, 0x95, 0x2c,
                                 0xa2, 0x85, 0x79, 0xd8, 0xaa, 0x9e, 0x65, 0xe5, 0x83, 0xe2, 0x35,
                                 0xbf, 0xa8, 0xfb, 0xf9, 0x6d, 0x21, 0xd0, 0xa9, 0x26, 0xf8}};

/// Every part of the method has something to do, and little.
BakeParams canary_params();

/// Bakes parts of a built-in level made awkward, about 0.1 s: SHA-256 of the plan's digest, and of what a cell, a relight set and the
/// surfaces store. `threads` as in BakeControl; the result does not depend on it. Errors: those of BakeSession.
absl::StatusOr<Digest> bake_canary(int threads = 0, const BakeParams& params = canary_params());

}  // namespace lightloom
