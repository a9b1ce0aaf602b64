// The transform of a glTF node.
#pragma once

#include <vector>

#include "core/base/status.h"
#include "core/scene/affine.h"

namespace lightloom {

/// A node's own transform: its matrix, or T·R·S (glTF 2.0, 3.5.3). What a node does not have is empty.
inline absl::StatusOr<Transform> local_transform(const std::vector<double>& matrix,
                                                 const std::vector<double>& translation,
                                                 const std::vector<double>& rotation,
                                                 const std::vector<double>& scale) {
  const auto sized = [](const std::vector<double>& v, size_t n) { return v.empty() || v.size() == n; };
  if (!sized(matrix, 16) || !sized(translation, 3) || !sized(rotation, 4) || !sized(scale, 3)) {
    return absl::InvalidArgumentError("its transform has the wrong number of values; export the file again");
  }
  Transform m = kIdentity;
  if (!matrix.empty()) {
    std::copy(matrix.begin(), matrix.end(), m.begin());
    return m;
  }
  if (!rotation.empty()) {
    const auto& q = rotation;
    const double square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    if (!(square > 1e-12)) {
      return absl::InvalidArgumentError("its rotation is not a unit quaternion; export the file again");
    }
    const double s = 2 / square, x = q[0], y = q[1], z = q[2], w = q[3];
    m = {1 - s * (y * y + z * z),
         s * (x * y + z * w),
         s * (x * z - y * w),
         0,
         s * (x * y - z * w),
         1 - s * (x * x + z * z),
         s * (y * z + x * w),
         0,
         s * (x * z + y * w),
         s * (y * z - x * w),
         1 - s * (x * x + y * y),
         0,
         0,
         0,
         0,
         1};
  }
  for (size_t column = 0; column < 3; ++column) {
    for (size_t row = 0; row < 3 && !scale.empty(); ++row) m[4 * column + row] *= scale[column];
    if (!translation.empty()) m[12 + column] = translation[column];
  }
  return m;
}

}  // namespace lightloom
