// Rows of transport averaged with those of their neighbours.
#pragma once

#include <span>

#include "core/base/vec.h"
#include "core/compression/truncated_svd.h"

namespace lightloom {

constexpr float kOwnShare = 0.2f;  ///< of a receiver's own row in its average

/// S = a·T + (1 − a)·K·T, a = kOwnShare. Rows of K sum to 1 and weigh a receiver at distance d, its normal turned by θ, by
/// (1 − d²/9σ²)⁴·max(0, cos θ)², 0 beyond 3σ: nearly a Gaussian, but without exp(), whose last bit is the C library's
/// (docs/adr/0001). `sigma`: σ of each receiver, metres; with 0 its row stays.
///
/// The noise of the gather rays differs from one receiver to the next, transport hardly does: rows of S have as much of
/// what receivers share and far less noise.
Matrix average_with_neighbours(const Matrix& transport, std::span<const Vec3> positions, std::span<const Vec3> normals,
                               std::span<const float> sigma);

}  // namespace lightloom
