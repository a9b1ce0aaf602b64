#include "core/compression/clusters.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/rng.h"
#include "core/base/sh.h"

namespace lightloom {
namespace {

using Eigen::Index;

constexpr int kOrder = 3;
constexpr Index kJ = sh_count(kOrder);

struct Level {
  Matrix transport;
  std::vector<Vec3> positions;
  Index probes() const { return transport.cols() / kJ; }
};

/// Receivers along a strip, each linked to three of the probes beneath, with smooth weights that sum to at
/// most 1 and some noise: closed to the uniform field's E = π·openness. Probes farther away stay zero
/// columns.
Level strip(Index receivers, Index probes, float noise, uint64_t seed) {
  Rng rng(seed);
  Level level;
  level.transport = Matrix::Zero(receivers, probes * kJ);
  for (Index r = 0; r < receivers; ++r) {
    const float x = (static_cast<float>(r) + 0.5f) / static_cast<float>(receivers) * static_cast<float>(probes);
    level.positions.push_back({x, 0.1f * rng.next_float(), 0});
    const float openness = r % 50 == 0 ? 1.0f : 0.5f + 0.4f * rng.next_float();
    float total = 0;
    std::vector<float> w(static_cast<size_t>(probes), 0);
    for (Index p = 0; p < probes; ++p) {
      const float d = std::abs(x - static_cast<float>(p) - 0.5f);
      if (d < 2) w[static_cast<size_t>(p)] = (2 - d) * (2 - d);
      total += w[static_cast<size_t>(p)];
    }
    for (Index p = 0; p < probes; ++p) {
      const float share = w[static_cast<size_t>(p)] / total;
      if (share == 0) continue;
      level.transport(r, p * kJ) = kPi * openness * share / kShUniform;
      for (int l = 1; l <= kOrder; ++l) {
        for (int j = l * l; j < (l + 1) * (l + 1); ++j) {
          const float smooth = std::sin(x + static_cast<float>(j)) / static_cast<float>(l * l);
          level.transport(r, p * kJ + j) = share * (smooth + noise * (rng.next_float() - 0.5f));
        }
      }
    }
  }
  return level;
}

CompressionOptions options(int max_rank, float threshold, uint32_t min_receivers = 1 << 30) {
  CompressionOptions o;
  o.order = kOrder;
  o.max_rank = max_rank;
  o.threshold = threshold;
  o.min_receivers = min_receivers;
  return o;
}

CompressedCell compress(const Level& level, const CompressionOptions& options) {
  return compress_cell(level.transport, level.transport, level.positions, options);
}

/// As decode_cluster over the whole cell, in the order of the rows of T.
std::vector<float> decode(const CompressedCell& cell, const std::vector<float>& lambda) {
  std::vector<float> e(cell.order.size());
  for (const CellChunk::Cluster& c : cell.clusters) {
    const std::vector<float> part = decode_cluster(c, cell.uniform, kOrder, lambda);
    for (size_t r = 0; r < part.size(); ++r) e[cell.order[c.first_receiver + r]] = part[r];
  }
  return e;
}

/// ‖(T − T̃)W‖ ÷ ‖TW‖ as clusters.h defines it, with T̃ read off decode() one coefficient at a time.
double measured_error(const Level& level, const CompressedCell& cell) {
  double error2 = 0, norm2 = 0;
  std::vector<float> lambda(static_cast<size_t>(level.transport.cols()), 0);
  for (Index column = 0; column < level.transport.cols(); ++column) {
    lambda[static_cast<size_t>(column)] = 1;
    const std::vector<float> e = decode(cell, lambda);
    lambda[static_cast<size_t>(column)] = 0;
    const int l = static_cast<int>(std::sqrt(static_cast<double>(column % kJ)));
    for (Index r = 0; r < level.transport.rows(); ++r) {
      const double t = static_cast<double>(level.transport(r, column)), w = 1.0 / (1 + l);
      error2 += (t - static_cast<double>(e[static_cast<size_t>(r)])) *
                (t - static_cast<double>(e[static_cast<size_t>(r)])) * w * w;
      norm2 += t * t * w * w;
    }
  }
  return std::sqrt(error2 / norm2);
}

/// Rounding to fp16 (2^-11 of each factor's entries) and unorm16, relative to ‖TW‖.
constexpr double kRounding = 2e-3;

TEST(CompressCell, MeasuredErrorIsTheReportedOne) {
  for (const int rank : {0, 1, 4, 8, 32}) {
    const Level level = strip(150, 6, 0.3f, 1);
    const CompressedCell cell = compress(level, options(rank, 0.02f));
    ASSERT_EQ(cell.clusters.size(), 1u);
    EXPECT_LE(cell.clusters[0].rank(), static_cast<uint32_t>(rank));
    const double measured = measured_error(level, cell);
    EXPECT_NEAR(measured, cell.error, kRounding + 0.01 * cell.error) << rank;
    EXPECT_FLOAT_EQ(cell.clusters[0].error, static_cast<float>(cell.error));
  }
}

TEST(CompressCell, TheThresholdEndsTheRank) {
  const Level level = strip(150, 6, 0.3f, 2);
  uint32_t previous = 0;
  for (const float threshold : {0.5f, 0.2f, 0.1f, 0.05f}) {
    const CompressedCell cell = compress(level, options(96, threshold));
    EXPECT_LE(cell.error, threshold);
    EXPECT_GE(cell.clusters[0].rank(), previous) << threshold;
    previous = cell.clusters[0].rank();
  }
  EXPECT_GT(previous, 4u);
}

TEST(CompressCell, RandomLightErrsWithinTheBound) {
  // |(T − T̃)·λ| ≤ ‖(T − T̃)W‖·|W⁻¹λ| by Cauchy and Schwarz, over all receivers.
  const Level level = strip(150, 6, 0.3f, 3);
  const CompressedCell cell = compress(level, options(8, 0.02f));
  Matrix weighted = level.transport;
  for (Index column = 0; column < weighted.cols(); ++column) {
    weighted.col(column) /= static_cast<float>(1 + static_cast<int>(std::sqrt(static_cast<double>(column % kJ))));
  }
  Rng rng(4);
  for (int repeat = 0; repeat < 20; ++repeat) {
    std::vector<float> lambda;
    double norm2 = 0;
    for (Index column = 0; column < weighted.cols(); ++column) {
      const int l = static_cast<int>(std::sqrt(static_cast<double>(column % kJ)));
      const float z = rng.next_float() - 0.5f;
      lambda.push_back(z / static_cast<float>(1 + l));
      norm2 += static_cast<double>(z) * static_cast<double>(z);
    }
    const std::vector<float> e = decode(cell, lambda);
    const Eigen::VectorXf truth =
        level.transport * Eigen::Map<const Eigen::VectorXf>(lambda.data(), static_cast<Index>(lambda.size()));
    const float error = (truth - Eigen::Map<const Eigen::VectorXf>(e.data(), truth.size())).norm();
    EXPECT_LE(static_cast<double>(error),
              (cell.error + kRounding) * static_cast<double>(weighted.norm()) * std::sqrt(norm2));
  }
}

TEST(CompressCell, UniformFieldIsExactAtEveryRank) {
  for (const int rank : {0, 1, 8, 32}) {
    for (const uint32_t min_receivers : {20u, 1u << 30}) {
      const Level level = strip(200, 8, 1.0f, 5);
      const CompressedCell cell = compress(level, options(rank, 0.001f, min_receivers));
      std::vector<float> uniform(static_cast<size_t>(level.transport.cols()), 0);
      for (Index p = 0; p < level.probes(); ++p) uniform[static_cast<size_t>(p * kJ)] = kShUniform;
      const std::vector<float> e = decode(cell, uniform);
      for (Index r = 0; r < level.transport.rows(); ++r) {
        double truth = 0;
        for (Index p = 0; p < level.probes(); ++p)
          truth += static_cast<double>(level.transport(r, p * kJ)) * static_cast<double>(kShUniform);
        const double decoded = static_cast<double>(e[static_cast<size_t>(r)]);
        // Half a step of unorm16, and float rounding.
        ASSERT_NEAR(decoded, truth, static_cast<double>(kPi) / 65535 / 2 + 4e-6) << rank << " " << r;
        ASSERT_LE(decoded, static_cast<double>(kPi) * (1 + 1e-6)) << rank << " " << r;
      }
    }
  }
}

TEST(CompressCell, UniformFieldNeverExceedsPi) {
  // A noisy gather may see a little more than everything: E is cut to π, so that a closed white room stays
  // stable.
  Level level = strip(60, 4, 0.3f, 6);
  for (Index p = 0; p < level.probes(); ++p) level.transport.col(p * kJ) *= 1.2f;
  const CompressedCell cell = compress(level, options(8, 0.01f));
  std::vector<float> uniform(static_cast<size_t>(level.transport.cols()), 0);
  for (Index p = 0; p < level.probes(); ++p) uniform[static_cast<size_t>(p * kJ)] = kShUniform;
  float brightest = 0;
  for (const float e : decode(cell, uniform)) brightest = std::max(brightest, e);
  EXPECT_LE(brightest, kPi * (1 + 1e-6f));
  EXPECT_GE(brightest, kPi * (1 - 1e-6f));
}

TEST(CompressCell, SameInputSameBytes) {
  const Level level = strip(300, 8, 0.5f, 7);
  const auto bytes = [&] {
    const CompressedCell cell = compress(level, options(8, 0.01f, 40));
    CellChunk chunk;
    chunk.order = kOrder;
    chunk.probe_count = static_cast<uint32_t>(level.probes());
    chunk.objects = {{Digest{}, 300, 1}};
    for (const uint32_t r : cell.order) chunk.receivers.push_back({0, r});
    chunk.uniform = cell.uniform;
    chunk.near_counts.resize(cell.uniform.size());
    chunk.clusters = cell.clusters;
    return encode_cell(chunk);
  };
  const auto first = bytes();
  EXPECT_EQ(first, bytes());
  EXPECT_TRUE(decode_cell(first).ok()) << decode_cell(first).status();
}

TEST(CompressCell, ClustersCoverAllReceiversOnceAndHonourTheirMinimum) {
  const Level level = strip(500, 10, 2.0f, 8);
  for (const uint32_t min_receivers : {1u, 30u, 100u, 250u, 251u}) {
    const CompressedCell cell = compress(level, options(2, 0.001f, min_receivers));
    uint32_t next = 0;
    for (const CellChunk::Cluster& c : cell.clusters) {
      EXPECT_EQ(c.first_receiver, next);
      EXPECT_GE(c.receivers, min_receivers);
      next += c.receivers;
      for (uint32_t r = c.first_receiver; r < next; ++r) {
        const Vec3 p = level.positions[cell.order.at(r)];
        EXPECT_TRUE(p.x >= c.bounds.lo.x && p.x <= c.bounds.hi.x && p.y >= c.bounds.lo.y && p.y <= c.bounds.hi.y);
      }
    }
    EXPECT_EQ(next, 500u);
    std::vector<uint32_t> sorted = cell.order;
    std::sort(sorted.begin(), sorted.end());
    for (uint32_t i = 0; i < sorted.size(); ++i) ASSERT_EQ(sorted[i], i);
    EXPECT_EQ(cell.uniform.size(), 500u);
    // 500 can be halved while both halves keep the minimum: 250+250, 125·4, 62 or 63 each …
    const size_t expected = min_receivers == 251   ? 1
                            : min_receivers == 250 ? 2
                            : min_receivers == 100 ? 4
                            : min_receivers == 30  ? 16
                                                   : 17;
    if (min_receivers == 1) {
      EXPECT_GE(cell.clusters.size(), expected);
    } else {
      EXPECT_EQ(cell.clusters.size(), expected) << min_receivers;
    }
  }
}

TEST(CompressCell, SplitsOnlyWhatIsAboveTheThreshold) {
  const Level level = strip(200, 8, 0, 9);
  EXPECT_EQ(compress(level, options(32, 0.9f, 10)).clusters.size(), 1u);
}

TEST(CompressCell, ClustersKeepOnlyTheProbesTheyUse) {
  const Level level = strip(200, 10, 0.5f, 10);
  const CompressedCell cell = compress(level, options(2, 0.001f, 50));
  ASSERT_EQ(cell.clusters.size(), 4u);
  for (const CellChunk::Cluster& c : cell.clusters) {
    std::vector<uint32_t> used;
    for (Index p = 0; p < level.probes(); ++p) {
      bool any = false;
      for (uint32_t r = c.first_receiver; r < c.first_receiver + c.receivers; ++r) {
        any |= (level.transport.row(cell.order[r]).segment(p * kJ, kJ).array() != 0).any();
      }
      if (any) used.push_back(static_cast<uint32_t>(p));
    }
    EXPECT_EQ(c.probes, used);
    EXPECT_LT(c.probes.size(), 10u);
  }
}

TEST(CompressCell, ProbesThatSayLittleAreLeftOut) {
  // All receivers read probe 0 well, probe 1 hardly, and probe 2 hardly but for one receiver.
  Level level = strip(200, 3, 0.2f, 11);
  level.transport.leftCols(kJ).rowwise() = Eigen::RowVectorXf(level.transport.row(0).head(kJ));
  level.transport.middleCols(kJ, kJ) *= 1e-3f;
  level.transport.block(1, 2 * kJ, 199, kJ) *= 1e-3f;
  level.transport.block(0, 2 * kJ, 1, kJ) = level.transport.block(0, 0, 1, kJ);
  CompressionOptions o = options(64, 0.02f);
  const CompressedCell cell = compress(level, o);
  ASSERT_EQ(cell.clusters.size(), 1u);
  EXPECT_EQ(cell.clusters[0].probes, (std::vector<uint32_t>{0, 2})) << "one receiver needs probe 2";
  EXPECT_LE(cell.error, 0.0201);
  o.probe_loss = 0;
  EXPECT_EQ(compress(level, o).clusters[0].probes, (std::vector<uint32_t>{0, 1, 2}));
}

TEST(CompressCell, PaddingIsZero) {
  const Level level = strip(13, 3, 0.5f, 11);
  CompressionOptions o = options(4, 0.001f);
  const CompressedCell cell = compress(level, o);
  const CellChunk::Cluster& c = cell.clusters.at(0);
  ASSERT_EQ(c.rank(), 4u);
  ASSERT_EQ(c.reconstruction.size(), 4u * 16);
  for (size_t k = 0; k < 4; ++k) {
    for (size_t r = 13; r < 16; ++r) EXPECT_EQ(c.reconstruction[k * 16 + r], 0);
  }
  // J = 9 of 16 at order 2.
  o.order = 2;
  const Matrix t = level.transport.leftCols(27);
  const CompressedCell other = compress_cell(t, t, level.positions, o);
  const CellChunk::Cluster& d = other.clusters.at(0);
  ASSERT_EQ(d.projection.size(), d.rank() * d.probes.size() * 16);
  for (size_t i = 0; i < d.projection.size(); ++i) {
    if (i % 16 >= 9) {
      EXPECT_EQ(d.projection[i], 0) << i;
    }
  }
}

TEST(CompressCell, PrefixesOfTheColumnsAreCoarserClusters) {
  const Level level = strip(150, 6, 0.5f, 12);
  CompressedCell cell = compress(level, options(16, 0.001f));
  CellChunk::Cluster& c = cell.clusters.at(0);
  ASSERT_EQ(c.rank(), 16u);
  const size_t row = c.probes.size() * static_cast<size_t>(sh_stride(kOrder)), column = (c.receivers + 7) / 8 * 8;
  double previous = measured_error(level, cell), previous_energy = 0;
  EXPECT_NEAR(previous, cell.error, kRounding);
  while (c.rank() > 0) {
    // Energy of the last row in the weighted norm: σ².
    double energy = 0;
    for (size_t i = (c.rank() - 1) * row; i < c.rank() * row; ++i) {
      const double l = std::floor(std::sqrt(static_cast<double>(i % static_cast<size_t>(sh_stride(kOrder)))));
      const double v = static_cast<double>(half_to_float(c.projection[i])) / (1 + l);
      energy += v * v;
    }
    EXPECT_GE(energy, previous_energy * (1 - 1e-3)) << "singular values descend: " << c.rank();
    previous_energy = energy;

    c.correction.pop_back();
    c.projection.resize(c.rank() * row);
    c.reconstruction.resize(c.rank() * column);
    const double error = measured_error(level, cell);
    EXPECT_GT(error, previous) << c.rank();
    previous = error;
  }
}

TEST(CompressCell, NothingGivesNothing) {
  const CompressedCell none = compress_cell(Matrix(0, 2 * kJ), Matrix(0, 2 * kJ), {}, options(8, 0.05f));
  EXPECT_TRUE(none.clusters.empty());
  EXPECT_EQ(none.error, 0);
}

TEST(CompressCell, ReceiversWithoutTransportAreDark) {
  const Matrix zero = Matrix::Zero(3, 2 * kJ);
  const std::vector<Vec3> positions(3);
  const CompressedCell cell = compress_cell(zero, zero, positions, options(8, 0.05f, 1));
  ASSERT_EQ(cell.clusters.size(), 1u);
  EXPECT_EQ(cell.clusters[0].rank(), 0u);
  EXPECT_TRUE(cell.clusters[0].probes.empty());
  EXPECT_EQ(cell.clusters[0].error, 0);
  for (const float e : decode(cell, std::vector<float>(2 * kJ, 1))) EXPECT_EQ(e, 0);
}

TEST(CompressCell, ASingleReceiverIsExactToRounding) {
  const Level level = strip(1, 3, 0.5f, 13);
  const CompressedCell cell = compress(level, options(8, 0.001f));
  ASSERT_EQ(cell.clusters.size(), 1u);
  EXPECT_EQ(cell.clusters[0].rank(), 1u);
  EXPECT_LT(measured_error(level, cell), kRounding);
}

}  // namespace
}  // namespace lightloom
