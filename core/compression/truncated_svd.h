// The leading singular triplets of a matrix.
//
// Halko, Martinsson & Tropp, "Finding Structure with Randomness", SIAM Review 53(2), 2011: Algorithms 4.4 (subspace
// iteration) and 5.1. Small matrices go through the exact eigenproblem of their Gram matrix.
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace lightloom {

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// A ≈ U · (ΣVᵀ), singular values descending.
struct TruncatedSvd {
  Matrix u;               ///< rows(A) × K, orthonormal columns
  Matrix sv;              ///< K × cols(A), row k has norm σ_k
  Eigen::VectorXd sigma;  ///< K
};

/// K = max_rank, less where A has fewer rows, columns or non-zero singular values. Random test vectors depend on `seed`
/// only; the same input gives the same bits on every x86-64-v3 machine.
TruncatedSvd truncated_svd(const Matrix& a, int max_rank, uint64_t seed);

}  // namespace lightloom
