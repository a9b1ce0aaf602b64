// Rows of transport averaged with those of their neighbours.
#pragma once

#include <span>

#include "core/base/vec.h"
#include "core/compression/truncated_svd.h"

namespace lightloom {

constexpr float kOwnShare = 0.2f;  ///< of a receiver's own row in its average

/// S = a·T + (1 − a)·K·T, a = kOwnShare. Rows of K sum to 1 and weigh a receiver at distance d, its normal turned by θ, by
/// exp(−d²/2σ²)·max(0, cos θ)². `sigma` in metres, > 0.
///
/// The noise of the gather rays differs from one receiver to the next, transport hardly does: rows of S have as much of
/// what receivers share and far less noise.
Matrix average_with_neighbours(const Matrix& transport, std::span<const Vec3> positions, std::span<const Vec3> normals,
                               float sigma);

}  // namespace lightloom
