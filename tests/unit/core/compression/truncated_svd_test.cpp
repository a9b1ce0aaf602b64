#include "core/compression/truncated_svd.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/base/rng.h"

namespace lightloom {
namespace {

using Eigen::Index;

Matrix noise(Index rows, Index cols, uint64_t seed) {
  Rng rng(seed);
  Matrix a(rows, cols);
  for (Index i = 0; i < a.size(); ++i) a.data()[i] = rng.next_float() - 0.5f;
  return a;
}

/// Singular values fall by `decay` each.
Matrix decaying(Index rows, Index cols, float decay, uint64_t seed) {
  const Index n = std::min(rows, cols);
  const Eigen::MatrixXf u =
      Eigen::HouseholderQR<Eigen::MatrixXf>(noise(rows, n, seed)).householderQ() * Eigen::MatrixXf::Identity(rows, n);
  const Eigen::MatrixXf v = Eigen::HouseholderQR<Eigen::MatrixXf>(noise(cols, n, seed + 1)).householderQ() *
                            Eigen::MatrixXf::Identity(cols, n);
  Eigen::VectorXf sigma(n);
  float s = 1;
  for (Index i = 0; i < n; ++i, s *= decay) sigma(i) = s;
  return u * sigma.asDiagonal() * v.transpose();
}

/// By Jacobi rotations, which the code under test has no part in. Zeros make the matrix square: the decompositions that
/// Eigen would make it square with take half a minute to compile.
Eigen::VectorXd singular_values(const Matrix& a) {
  const Index n = std::max(a.rows(), a.cols());
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(n, n);
  square.topLeftCorner(a.rows(), a.cols()) = a.cast<double>();
  const Eigen::JacobiSVD<Eigen::MatrixXd, Eigen::NoQRPreconditioner> svd(square);
  return svd.singularValues().head(std::min(a.rows(), a.cols()));
}

double residual(const Matrix& a, const TruncatedSvd& svd) {
  return (a.cast<double>() - svd.u.cast<double>() * svd.sv.cast<double>()).norm();
}

struct Shape {
  Index rows, cols;
};
/// Small rows, small columns and large ones go different ways.
constexpr Shape kShapes[] = {{1, 1},   {1, 50},   {50, 1},  {5, 7},     {40, 300},
                             {96, 97}, {300, 40}, {97, 96}, {150, 200}, {200, 150}};

TEST(TruncatedSvd, AgreesWithJacobi) {
  for (const auto [rows, cols] : kShapes) {
    const Matrix a = decaying(rows, cols, 0.7f, 3);
    const Eigen::VectorXd exact = singular_values(a);
    const int rank = static_cast<int>(std::min<Index>({10, rows, cols}));
    const TruncatedSvd svd = truncated_svd(a, rank, 1);
    ASSERT_EQ(svd.sigma.size(), rank) << rows << "×" << cols;
    ASSERT_EQ(svd.u.rows(), rows);
    ASSERT_EQ(svd.u.cols(), rank);
    ASSERT_EQ(svd.sv.rows(), rank);
    ASSERT_EQ(svd.sv.cols(), cols);
    for (Index k = 0; k < rank; ++k) {
      EXPECT_NEAR(svd.sigma(k), exact(k), 1e-4 * exact(k)) << k;
      EXPECT_NEAR(static_cast<double>(svd.sv.row(k).norm()), svd.sigma(k), 1e-4 * exact(0)) << k;
    }
    // Eckart–Young: nothing of this rank is closer than the tail.
    const double best = exact.tail(exact.size() - rank).norm();
    EXPECT_NEAR(residual(a, svd), best, 1e-5 + 0.001 * best) << rows << "×" << cols;
    const Eigen::MatrixXf gram = svd.u.transpose() * svd.u;
    EXPECT_LT((gram - Eigen::MatrixXf::Identity(rank, rank)).cwiseAbs().maxCoeff(), 1e-5f) << rows << "×" << cols;
  }
}

TEST(TruncatedSvd, FlatSpectraAreNearlyOptimalToo) {
  // Noise decays slowly: the worst case of the randomised method.
  const Matrix a = noise(200, 300, 5);
  const Eigen::VectorXd exact = singular_values(a);
  const double best = exact.tail(exact.size() - 32).norm();
  EXPECT_LT(residual(a, truncated_svd(a, 32, 1)), 1.02 * best);
}

TEST(TruncatedSvd, SigmaDescends) {
  for (const auto [rows, cols] : kShapes) {
    const TruncatedSvd svd = truncated_svd(noise(rows, cols, 6), 20, 1);
    for (Index k = 1; k < svd.sigma.size(); ++k) EXPECT_GE(svd.sigma(k - 1), svd.sigma(k));
  }
}

TEST(TruncatedSvd, RecoversLowRankExactly) {
  for (const auto [rows, cols] : {Shape{50, 400}, Shape{400, 50}, Shape{200, 300}}) {
    const Matrix a = noise(rows, 5, 7) * noise(5, cols, 8);
    const TruncatedSvd svd = truncated_svd(a, 32, 1);
    ASSERT_GE(svd.sigma.size(), 5);
    // Beyond the rank there is rounding only.
    for (Index k = 5; k < svd.sigma.size(); ++k) EXPECT_LT(svd.sigma(k), 1e-5 * svd.sigma(0)) << k;
    EXPECT_LT(residual(a, svd), 1e-5 * static_cast<double>(a.norm()));
    EXPECT_LT(residual(a, truncated_svd(a, 5, 1)), 1e-5 * static_cast<double>(a.norm()));
  }
}

TEST(TruncatedSvd, RankDeficientMatricesStayFinite) {
  for (const auto [rows, cols] : {Shape{50, 120}, Shape{150, 30}, Shape{150, 130}}) {
    Matrix a = noise(rows, cols, 9);
    for (Index r = 1; r < rows; r += 2) a.row(r) = a.row(r - 1);
    a.col(0).setZero();
    const TruncatedSvd svd = truncated_svd(a, static_cast<int>(std::min(rows, cols)), 1);
    EXPECT_TRUE(svd.u.allFinite());
    EXPECT_TRUE(svd.sv.allFinite());
    EXPECT_TRUE(svd.sigma.allFinite());
    EXPECT_LT(residual(a, svd), 1e-5 * static_cast<double>(a.norm()));
  }
}

TEST(TruncatedSvd, ZeroHasRankZero) {
  for (const auto [rows, cols] : kShapes) {
    const TruncatedSvd svd = truncated_svd(Matrix::Zero(rows, cols), 8, 1);
    EXPECT_EQ(svd.sigma.size(), 0) << rows << "×" << cols;
    EXPECT_EQ(svd.u.rows(), rows);
    EXPECT_EQ(svd.u.cols(), 0);
    EXPECT_EQ(svd.sv.cols(), cols);
  }
}

TEST(TruncatedSvd, EmptyAndRankZero) {
  for (const auto [rows, cols] : {Shape{0, 0}, Shape{0, 5}, Shape{5, 0}}) {
    const TruncatedSvd svd = truncated_svd(Matrix(rows, cols), 8, 1);
    EXPECT_EQ(svd.u.rows(), rows);
    EXPECT_EQ(svd.u.cols(), 0);
    EXPECT_EQ(svd.sv.rows(), 0);
    EXPECT_EQ(svd.sv.cols(), cols);
    EXPECT_EQ(svd.sigma.size(), 0);
  }
  EXPECT_EQ(truncated_svd(noise(5, 6, 1), 0, 1).sigma.size(), 0);
  EXPECT_EQ(truncated_svd(noise(200, 300, 1), 0, 1).sigma.size(), 0);
}

TEST(TruncatedSvd, SameSeedSameBits) {
  const Matrix a = noise(200, 300, 10);
  const TruncatedSvd x = truncated_svd(a, 16, 5), y = truncated_svd(a, 16, 5);
  ASSERT_EQ(x.u.size(), y.u.size());
  EXPECT_EQ(std::memcmp(x.u.data(), y.u.data(), static_cast<size_t>(x.u.size()) * sizeof(float)), 0);
  EXPECT_EQ(std::memcmp(x.sv.data(), y.sv.data(), static_cast<size_t>(x.sv.size()) * sizeof(float)), 0);
}

}  // namespace
}  // namespace lightloom
