#include "core/compression/average.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/base/check.h"

namespace lightloom {

Matrix average_with_neighbours(const Matrix& transport, std::span<const Vec3> positions, std::span<const Vec3> normals,
                               float sigma) {
  const size_t n = positions.size();
  LL_CHECK(static_cast<size_t>(transport.rows()) == n && normals.size() == n && sigma > 0);
  const float reach = 3 * sigma;  // beyond, a neighbour would weigh less than 1 %
  std::vector<uint32_t> by_x(n);
  std::iota(by_x.begin(), by_x.end(), 0u);
  std::stable_sort(by_x.begin(), by_x.end(), [&](uint32_t a, uint32_t b) { return positions[a].x < positions[b].x; });

  Matrix out(transport.rows(), transport.cols());
  Eigen::RowVectorXf sum(transport.cols());
  size_t first = 0;  // of by_x, that is in reach
  for (const uint32_t a : by_x) {
    while (positions[by_x[first]].x < positions[a].x - reach) ++first;
    sum.setZero();
    float weights = 0;
    for (size_t i = first; i < n && positions[by_x[i]].x <= positions[a].x + reach; ++i) {
      const uint32_t b = by_x[i];
      const Vec3 apart = positions[b] - positions[a];
      const float d2 = dot(apart, apart), cosine = dot(normals[a], normals[b]);
      if (d2 > reach * reach || cosine <= 0) continue;
      const float weight = std::exp(-d2 / (2 * sigma * sigma)) * cosine * cosine;
      sum += weight * transport.row(b);
      weights += weight;
    }
    out.row(a) = kOwnShare * transport.row(a) + (1 - kOwnShare) / weights * sum;
  }
  return out;
}

}  // namespace lightloom
