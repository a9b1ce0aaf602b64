#include "core/compression/clusters.h"

#include <algorithm>
#include <cmath>

#include "core/base/check.h"
#include "core/base/rng.h"
#include "core/base/sh.h"

namespace lightloom {
namespace {

/// Rows and columns of T that a cluster uses.
struct Block {
  std::vector<uint32_t> probes;
  Matrix t;  // receivers × (probes·J)
};

Block extract(const Matrix& transport, std::span<const uint32_t> rows, Eigen::Index J) {
  Block block;
  const Eigen::Index probes = transport.cols() / J;
  for (Eigen::Index p = 0; p < probes; ++p) {
    const bool used = std::any_of(rows.begin(), rows.end(),
                                  [&](uint32_t r) { return (transport.row(r).segment(p * J, J).array() != 0).any(); });
    if (used) block.probes.push_back(static_cast<uint32_t>(p));
  }
  block.t.resize(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(block.probes.size()) * J);
  for (size_t r = 0; r < rows.size(); ++r) {
    for (size_t p = 0; p < block.probes.size(); ++p) {
      block.t.row(static_cast<Eigen::Index>(r)).segment(static_cast<Eigen::Index>(p) * J, J) =
          transport.row(rows[r]).segment(block.probes[p] * J, J);
    }
  }
  return block;
}

/// W: the expected size of a radiance coefficient of band l, relative to band 0.
Eigen::RowVectorXf band_weights(const CompressionOptions& o, size_t probes) {
  const int order = o.order, J = sh_count(order);
  Eigen::RowVectorXf w(static_cast<Eigen::Index>(probes) * J);
  for (size_t p = 0; p < probes; ++p) {
    for (int l = 0; l <= order; ++l) {
      for (int j = l * l; j < (l + 1) * (l + 1); ++j) {
        w(static_cast<Eigen::Index>(p) * J + j) = o.weigh_bands ? 1.0f / static_cast<float>(1 + l) : 1.0f;
      }
    }
  }
  return w;
}

struct Truncated {
  Block block;
  Eigen::VectorXf uniform;  // E under the uniform field 1, per receiver
  TruncatedSvd svd;         // of the rest, in the weighted norm
  Eigen::RowVectorXf weights;
  Eigen::Index rank = 0;
  double error2 = 0, norm2 = 0;  // ‖(T − T̃)W‖², ‖TW‖²
};

/// Splits off the uniform field, then truncates what is left.
///
/// u: coefficients of the uniform field 1 at every probe; d: the row that reads the mean radiance, √(4π)/(4πP) in every DC
/// entry, so d·u = 1. T = e·d + T′ with e = T·u, hence T′·u = 0: whatever the SVD of T′ loses, the uniform field loses
/// nothing.
Truncated truncate(const Matrix& transport, std::span<const uint32_t> rows, const CompressionOptions& o,
                   std::span<const float> u, uint64_t seed) {
  const Eigen::Index J = sh_count(o.order);
  Truncated out;
  out.block = extract(transport, rows, J);
  Matrix rest = out.block.t;
  const Eigen::Index probes = static_cast<Eigen::Index>(out.block.probes.size());
  out.uniform = Eigen::VectorXf::Zero(rest.rows());
  const Eigen::Map<const Eigen::VectorXf> u_map(u.data(), J);
  for (Eigen::Index p = 0; p < probes; ++p) out.uniform += rest.middleCols(p * J, J) * u_map;
  for (Eigen::Index p = 0; p < probes; ++p) {
    rest.col(p * J) -= out.uniform * (kShUniform / (4 * kPi * static_cast<float>(probes)));
  }
  out.weights = band_weights(o, out.block.probes.size());
  out.norm2 = (out.block.t.array().rowwise() * out.weights.array()).matrix().squaredNorm();
  rest.array().rowwise() *= out.weights.array();
  out.svd = truncated_svd(rest, o.max_rank, seed);
  double tail = rest.squaredNorm();
  const double allowed = static_cast<double>(o.threshold) * o.threshold * out.norm2;
  while (out.rank < out.svd.sigma.size() && tail > allowed) {
    tail -= out.svd.sigma(out.rank) * out.svd.sigma(out.rank);
    ++out.rank;
  }
  out.error2 = std::max(0.0, tail);
  return out;
}

uint16_t to_unorm16(float irradiance) {
  return static_cast<uint16_t>(std::lround(std::clamp(irradiance / kPi, 0.0f, 1.0f) * 65535.0f));
}

/// Rounds the truncated factors to what is stored.
CellChunk::Cluster quantise(const Truncated& t, std::span<const uint32_t> rows, std::span<const Vec3> positions,
                            int order, std::span<const float> u) {
  const size_t J = static_cast<size_t>(sh_count(order)), stride = static_cast<size_t>(sh_stride(order));
  const size_t probes = t.block.probes.size(), rank = static_cast<size_t>(t.rank);
  const size_t padded = (rows.size() + 7) / 8 * 8;
  CellChunk::Cluster c;
  c.receivers = static_cast<uint32_t>(rows.size());
  c.probes = t.block.probes;
  c.projection.assign(rank * probes * stride, 0);
  c.reconstruction.assign(rank * padded, 0);
  for (size_t k = 0; k < rank; ++k) {
    double correction = 0;
    for (size_t p = 0; p < probes; ++p) {
      for (size_t j = 0; j < J; ++j) {
        const Eigen::Index column = static_cast<Eigen::Index>(p * J + j);
        const Half h = float_to_half(t.svd.sv(static_cast<Eigen::Index>(k), column) / t.weights(column));
        c.projection[(k * probes + p) * stride + j] = h;
        correction += static_cast<double>(half_to_float(h)) * static_cast<double>(u[j]);
      }
    }
    c.correction.push_back(static_cast<float>(correction));
    for (size_t r = 0; r < rows.size(); ++r) {
      c.reconstruction[k * padded + r] =
          float_to_half(t.svd.u(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(k)));
    }
  }
  for (const uint32_t r : rows) c.bounds.extend(positions[r]);
  c.error = static_cast<float>(t.norm2 > 0 ? std::sqrt(t.error2 / t.norm2) : 0);
  return c;
}

}  // namespace

CompressedCell compress_cell(const Matrix& transport, std::span<const Vec3> positions,
                             const CompressionOptions& options) {
  LL_CHECK(static_cast<size_t>(transport.rows()) == positions.size() && options.min_receivers > 0);
  const std::vector<float> u = sh_uniform(options.order, options.relight_rays);
  CompressedCell out;
  double error2 = 0, norm2 = 0;

  std::vector<uint32_t> all(positions.size());
  for (uint32_t i = 0; i < all.size(); ++i) all[i] = i;
  std::vector<std::vector<uint32_t>> stack;
  if (!all.empty()) stack.push_back(std::move(all));
  while (!stack.empty()) {
    std::vector<uint32_t> rows = std::move(stack.back());
    stack.pop_back();
    const Truncated t = truncate(transport, rows, options, u, hash_combine(options.seed, rows.size()));
    const double allowed = static_cast<double>(options.threshold) * options.threshold * t.norm2;
    if (t.error2 > allowed && rows.size() >= 2 * options.min_receivers) {
      // Median split along the longest axis, ties by index.
      Aabb box;
      for (const uint32_t r : rows) box.extend(positions[r]);
      const Vec3 size = box.size();
      const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
      std::sort(rows.begin(), rows.end(), [&](uint32_t a, uint32_t b) {
        return std::pair(positions[a][axis], a) < std::pair(positions[b][axis], b);
      });
      const auto middle = rows.begin() + static_cast<std::ptrdiff_t>(rows.size() / 2);
      stack.emplace_back(middle, rows.end());
      stack.emplace_back(rows.begin(), middle);
      continue;
    }
    CellChunk::Cluster cluster = quantise(t, rows, positions, options.order, u);
    cluster.first_receiver = static_cast<uint32_t>(out.order.size());
    out.clusters.push_back(std::move(cluster));
    out.order.insert(out.order.end(), rows.begin(), rows.end());
    for (Eigen::Index r = 0; r < t.uniform.size(); ++r) out.uniform.push_back(to_unorm16(t.uniform(r)));
    error2 += t.error2;
    norm2 += t.norm2;
  }
  out.error = norm2 > 0 ? std::sqrt(error2 / norm2) : 0;
  return out;
}

std::vector<float> decode_cluster(const CellChunk::Cluster& c, std::span<const uint16_t> uniform, int order,
                                  std::span<const float> lambda) {
  const size_t J = static_cast<size_t>(sh_count(order)), stride = static_cast<size_t>(sh_stride(order));
  const size_t probes = c.probes.size(), padded = (c.receivers + 7) / 8 * 8;
  double c0 = 0;
  for (const uint32_t p : c.probes) c0 += static_cast<double>(lambda[p * J]);
  if (probes > 0) c0 *= kShUniform / (4 * kPi * static_cast<double>(probes));
  std::vector<double> e(c.receivers);
  for (size_t r = 0; r < e.size(); ++r) e[r] = kPi * (uniform[c.first_receiver + r] / 65535.0) * c0;
  for (size_t k = 0; k < c.rank(); ++k) {
    double ck = -static_cast<double>(c.correction[k]) * c0;
    for (size_t p = 0; p < probes; ++p) {
      for (size_t j = 0; j < J; ++j) {
        ck += static_cast<double>(half_to_float(c.projection[(k * probes + p) * stride + j])) *
              lambda[c.probes[p] * J + j];
      }
    }
    for (size_t r = 0; r < e.size(); ++r) e[r] += half_to_float(c.reconstruction[k * padded + r]) * ck;
  }
  return {e.begin(), e.end()};
}

}  // namespace lightloom
