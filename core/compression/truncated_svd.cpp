#include "core/compression/truncated_svd.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include <algorithm>
#include <cmath>
#include <mutex>

#include "core/base/rng.h"

namespace lightloom {
namespace {

constexpr int kOversampling = 12;
constexpr int kPowerIterations = 3;
constexpr Eigen::Index kExactSize = 96;  // up to here the Gram matrix is cheap

// Eigen blocks products by cache size, which it reads from the CPU: fix it, or sums would differ between machines.
void fix_blocking() {
  static std::once_flag once;
  std::call_once(once, [] { Eigen::setCpuCacheSizes(32 << 10, 1 << 20, 16 << 20); });
}

using ColMatrix = Eigen::MatrixXf;

ColMatrix orthonormalise(const ColMatrix& y) {
  const Eigen::HouseholderQR<ColMatrix> qr(y);
  return qr.householderQ() * ColMatrix::Identity(y.rows(), std::min(y.rows(), y.cols()));
}

/// Triplets of A = Q·C from the eigenproblem of the small C·Cᵀ.
TruncatedSvd from_factor(const ColMatrix& q, const Matrix& c, int max_rank) {
  const Eigen::MatrixXd cd = c.cast<double>();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(cd * cd.transpose());
  const Eigen::Index n = c.rows();
  // Ascending eigenvalues; those below float rounding of the largest are noise.
  const double largest = std::max(0.0, eigen.eigenvalues()(n - 1));
  Eigen::Index rank = 0;
  while (rank < std::min<Eigen::Index>(n, max_rank) && eigen.eigenvalues()(n - 1 - rank) > 1e-12 * largest) ++rank;

  TruncatedSvd svd;
  const Eigen::MatrixXd e = eigen.eigenvectors().rightCols(rank).rowwise().reverse();
  svd.sigma = eigen.eigenvalues().tail(rank).reverse().cwiseSqrt();
  svd.u = (q.cast<double>() * e).cast<float>();
  svd.sv = (e.transpose() * cd).cast<float>();
  return svd;
}

}  // namespace

TruncatedSvd truncated_svd(const Matrix& a, int max_rank, uint64_t seed) {
  fix_blocking();
  if (a.rows() == 0 || a.cols() == 0 || max_rank <= 0) {
    return {Matrix(a.rows(), 0), Matrix(0, a.cols()), Eigen::VectorXd(0)};
  }
  if (a.rows() <= kExactSize) return from_factor(ColMatrix::Identity(a.rows(), a.rows()), a, max_rank);
  if (a.cols() <= kExactSize) {
    // A = (Q·R): the columns span everything.
    const ColMatrix q = orthonormalise(a);
    return from_factor(q, q.transpose() * a, max_rank);
  }

  const Eigen::Index l = std::min<Eigen::Index>({max_rank + kOversampling, a.rows(), a.cols()});
  Rng rng(seed);
  ColMatrix omega(a.cols(), l);
  for (Eigen::Index i = 0; i < omega.size(); ++i) omega.data()[i] = rng.next_u64() & 1 ? 1.0f : -1.0f;
  ColMatrix q = orthonormalise(a * omega);
  for (int i = 0; i < kPowerIterations; ++i) {
    const ColMatrix z = orthonormalise(a.transpose() * q);
    q = orthonormalise(a * z);
  }
  return from_factor(q, q.transpose() * a, max_rank);
}

}  // namespace lightloom
