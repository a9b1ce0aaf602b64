#include "core/compression/average.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/base/rng.h"
#include "core/base/sh.h"
#include "core/compression/clusters.h"

namespace lightloom {
namespace {

using Eigen::Index;

/// A floor of side × side texels, 1 m apart, and what receivers of it see: as smooth as E is over open ground.
struct Floor {
  Index side;
  std::vector<Vec3> positions, normals;
  Matrix transport;
};

Floor smooth_floor(Index side, Index columns) {
  Floor out{side, {}, {}, Matrix(side * side, columns)};
  for (Index r = 0; r < side * side; ++r) {
    const float x = static_cast<float>(r % side), y = static_cast<float>(r / side);
    out.positions.push_back({x, y, 0});
    out.normals.push_back({0, 0, 1});
    for (Index c = 0; c < columns; ++c) {
      const float phase = static_cast<float>(c) * 0.7f;
      out.transport(r, c) = std::sin(0.15f * x + phase) + std::cos(0.12f * y - 2 * phase);
    }
  }
  return out;
}

Matrix white_noise(Index rows, Index columns, uint64_t seed) {
  Rng rng(seed);
  Matrix out(rows, columns);
  for (Index i = 0; i < out.size(); ++i) out.data()[i] = 2 * rng.next_float() - 1;
  return out;
}

/// With σ = 1 m everywhere.
Matrix averaged_by_one(const Matrix& transport, const std::vector<Vec3>& positions, const std::vector<Vec3>& normals) {
  return average_with_neighbours(transport, positions, normals, std::vector<float>(positions.size(), 1.0f));
}

TEST(AverageWithNeighbours, KeepsWhatIsAlike) {
  const Floor floor = smooth_floor(9, 5);
  const Matrix same = Matrix::Constant(81, 5, 3.5f);
  EXPECT_LT((averaged_by_one(same, floor.positions, floor.normals) - same).norm(), 1e-4f);
}

TEST(AverageWithNeighbours, NoiseGoesAndTransportStays) {
  const Floor floor = smooth_floor(20, 8);
  const Matrix n = white_noise(400, 8, 1);
  const auto share = [&](const Matrix& m) {
    return averaged_by_one(m, floor.positions, floor.normals).norm() / m.norm();
  };
  EXPECT_LT(share(n), 0.5f);
  EXPECT_GT(share(floor.transport), 0.97f);
}

TEST(AverageWithNeighbours, WeighsByDistanceAndTurn) {
  const float far = 0.75f;
  const std::vector<Vec3> positions{{0, 0, 0}, {far, 0, 0}, {0, 4, 0}, {0, 0, 0.01f}, {0, far, 0}};
  const std::vector<Vec3> normals{{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, -1}, {0, std::sqrt(0.75f), 0.5f}};
  const Matrix each = Matrix::Identity(5, 5);
  const Matrix s = averaged_by_one(each, positions, normals);
  const float near = std::pow(1 - far * far / 9, 4.0f), total = 1 + near + 0.25f * near;
  EXPECT_NEAR(s(0, 0), kOwnShare + (1 - kOwnShare) / total, 1e-6f);
  EXPECT_NEAR(s(0, 1), (1 - kOwnShare) * near / total, 1e-6f);
  EXPECT_EQ(s(0, 2), 0);  // out of reach
  EXPECT_EQ(s(0, 3), 0);  // the other side of a wall
  EXPECT_NEAR(s(0, 4), (1 - kOwnShare) * 0.25f * near / total, 1e-6f);
  for (Index r = 0; r < 5; ++r) EXPECT_NEAR(s.row(r).sum(), 1, 1e-6f);
}

TEST(AverageWithNeighbours, EachReceiverHasItsOwnReach) {
  const std::vector<Vec3> positions{{0, 0, 0}, {1, 0, 0}, {3, 0, 0}};
  const std::vector<Vec3> normals(3, Vec3{0, 0, 1});
  const Matrix s = average_with_neighbours(Matrix::Identity(3, 3), positions, normals, std::vector<float>{0.5f, 0, 2});
  EXPECT_GT(s(0, 1), 0);
  EXPECT_EQ(s(0, 2), 0);
  EXPECT_EQ(s(1, 1), 1);
  EXPECT_GT(s(2, 0), 0);
}

TEST(AverageWithNeighbours, DoesNotDependOnTheOrderOfReceivers) {
  const Floor floor = smooth_floor(6, 4);
  Matrix reversed = floor.transport.colwise().reverse();
  const std::vector<Vec3> positions(floor.positions.rbegin(), floor.positions.rend());
  const Matrix forward = averaged_by_one(floor.transport, floor.positions, floor.normals);
  const Matrix back = averaged_by_one(reversed, positions, floor.normals);
  EXPECT_LT((forward - Matrix(back.colwise().reverse())).cwiseAbs().maxCoeff(), 1e-6f);
}

/// ‖T_exact − T̃‖ ÷ ‖T_exact‖ of a noisy floor, compressed with V of averaged rows or of its own.
double error_of(const Floor& floor, const Matrix& noisy, bool averaged, int rank) {
  CompressionOptions options;
  options.order = 1;
  options.max_rank = rank;
  options.threshold = 0;
  options.min_receivers = 1000;
  const CompressedCell cell = compress_cell(
      noisy, averaged ? averaged_by_one(noisy, floor.positions, floor.normals) : noisy, floor.positions, options);
  double error2 = 0;
  std::vector<float> lambda(static_cast<size_t>(noisy.cols()), 0.0f);
  for (size_t c = 0; c < lambda.size(); ++c) {
    lambda[c] = 1;
    const std::vector<float> e = decode_cluster(cell.clusters.at(0), cell.uniform, options.order, lambda);
    lambda[c] = 0;
    for (size_t r = 0; r < e.size(); ++r) {
      const float exact = floor.transport(cell.order[r], static_cast<Index>(c));
      error2 += static_cast<double>((e[r] - exact) * (e[r] - exact));
    }
  }
  return std::sqrt(error2) / static_cast<double>(floor.transport.norm());
}

TEST(AverageWithNeighbours, SameRankHasLessOfTheNoise) {
  const Index columns = 40 * sh_count(1);
  Floor floor = smooth_floor(16, columns);
  Matrix noisy = floor.transport + 3 * white_noise(256, columns, 2);
  for (Index c = 0; c < columns; c += sh_count(1))
    floor.transport.col(c).setZero(), noisy.col(c).setZero();  // E of the uniform field is kept apart
  const double own = error_of(floor, noisy, false, 16), shared = error_of(floor, noisy, true, 16);
  EXPECT_LT(shared, 0.92 * own);
}

}  // namespace
}  // namespace lightloom
