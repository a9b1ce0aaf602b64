#include "core/compression/average.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "core/base/check.h"

namespace lightloom {

Matrix average_with_neighbours(const Matrix& transport, std::span<const Vec3> positions, std::span<const Vec3> normals,
                               std::span<const float> sigma) {
  const size_t n = positions.size();
  LL_CHECK(static_cast<size_t>(transport.rows()) == n && normals.size() == n && sigma.size() == n);
  std::vector<uint32_t> by_x(n);
  std::iota(by_x.begin(), by_x.end(), 0u);
  std::stable_sort(by_x.begin(), by_x.end(), [&](uint32_t a, uint32_t b) { return positions[a].x < positions[b].x; });

  Matrix out(transport.rows(), transport.cols());
  Eigen::RowVectorXf sum(transport.cols());
  for (const uint32_t a : by_x) {
    const float reach = 3 * sigma[a], x = positions[a].x;
    if (!(reach > 0)) {
      out.row(a) = transport.row(a);
      continue;
    }
    sum.setZero();
    float weights = 0;
    auto at = std::lower_bound(by_x.begin(), by_x.end(), x - reach,
                               [&](uint32_t b, float least) { return positions[b].x < least; });
    for (; at != by_x.end() && positions[*at].x <= x + reach; ++at) {
      const uint32_t b = *at;
      const Vec3 apart = positions[b] - positions[a];
      const float d2 = dot(apart, apart), cosine = dot(normals[a], normals[b]);
      if (d2 > reach * reach || cosine <= 0) continue;
      const float inside = 1 - d2 / (reach * reach), inside2 = inside * inside;
      const float weight = inside2 * inside2 * cosine * cosine;
      sum += weight * transport.row(b);
      weights += weight;
    }
    out.row(a) = kOwnShare * transport.row(a) + (1 - kOwnShare) / weights * sum;
  }
  return out;
}

}  // namespace lightloom
