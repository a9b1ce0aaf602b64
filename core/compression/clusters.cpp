#include "core/compression/clusters.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/check.h"
#include "core/base/rng.h"
#include "core/base/sh.h"

namespace lightloom {
namespace {

/// W: the expected size of a radiance coefficient of band l, relative to band 0. For one probe.
Eigen::RowVectorXf band_weights(const CompressionOptions& o) {
  Eigen::RowVectorXf w(sh_count(o.order));
  for (int l = 0; l <= o.order; ++l) {
    for (int j = l * l; j < (l + 1) * (l + 1); ++j) w(j) = o.weigh_bands ? 1.0f / static_cast<float>(1 + l) : 1.0f;
  }
  return w;
}

/// ‖T_rp·W‖² per receiver r of `rows` and probe p.
Eigen::MatrixXf energies(const Matrix& transport, std::span<const uint32_t> rows, const Eigen::RowVectorXf& w) {
  const Eigen::Index J = w.size();
  Eigen::MatrixXf out(static_cast<Eigen::Index>(rows.size()), transport.cols() / J);
  for (Eigen::Index r = 0; r < out.rows(); ++r) {
    const auto row = transport.row(rows[static_cast<size_t>(r)]);
    for (Eigen::Index p = 0; p < out.cols(); ++p) out(r, p) = row.segment(p * J, J).cwiseProduct(w).squaredNorm();
  }
  return out;
}

/// The probes that a cluster keeps, ascending: the weakest go while no receiver loses more than `share` of its row.
std::vector<uint32_t> strong_probes(const Eigen::MatrixXf& energy, float share) {
  const Eigen::RowVectorXf of_probe = energy.colwise().sum();
  const Eigen::VectorXf allowed = share * energy.rowwise().sum();
  std::vector<uint32_t> weakest_first(static_cast<size_t>(energy.cols()));
  std::iota(weakest_first.begin(), weakest_first.end(), 0u);
  std::stable_sort(weakest_first.begin(), weakest_first.end(),
                   [&](uint32_t a, uint32_t b) { return of_probe(a) < of_probe(b); });
  std::vector<uint32_t> kept;
  Eigen::VectorXf lost = Eigen::VectorXf::Zero(energy.rows());
  for (const uint32_t p : weakest_first) {
    const Eigen::VectorXf without = lost + energy.col(p);
    if ((without.array() <= allowed.array()).all()) {
      lost = without;
    } else {
      kept.push_back(p);
    }
  }
  std::sort(kept.begin(), kept.end());
  return kept;
}

/// What a cluster is made of besides its receivers' own coefficients.
struct Truncated {
  std::vector<uint32_t> probes;
  Eigen::RowVectorXf weights;    // W
  Matrix sv;                     // ΣVᵀ of S′·W
  bool met = false;              // the threshold
  double error2 = 0, norm2 = 0;  // ‖(S − S̃)W‖², ‖SW‖²
};

/// Each receiver's own: T′·W ≈ u·sv, where columns of u have unit length and sv is Truncated::sv, scaled.
struct Factors {
  Eigen::VectorXf uniform;  // e, per receiver
  Matrix u, sv;
};

// u: coefficients of the uniform field 1 at every probe; e = T·u: E under it. d: the row that reads the mean radiance of
// the probes that are kept, √(4π)/(4πP) in every DC entry, so d·u = 1. T′ = T − e·d, truncated, without what it says to u:
// T̃ = e·d + (U·ΣVᵀ)·(I − u·d). Whatever was left out and truncated, the uniform field lost nothing.

/// d·W: the weight of band 0 is 1.
Eigen::RowVectorXf mean_radiance(Eigen::Index probes, Eigen::Index J) {
  Eigen::RowVectorXf d = Eigen::RowVectorXf::Zero(probes * J);
  for (Eigen::Index p = 0; p < probes; ++p) d(p * J) = kShUniform / (4 * kPi * static_cast<float>(probes));
  return d;
}

/// T′·W of the probes that are kept, and e.
Matrix without_uniform(const Matrix& transport, std::span<const uint32_t> rows, const std::vector<uint32_t>& probes,
                       const Eigen::RowVectorXf& w, std::span<const float> u, Eigen::VectorXf* uniform) {
  const Eigen::Index J = w.size(), receivers = static_cast<Eigen::Index>(rows.size());
  const Eigen::Index kept = static_cast<Eigen::Index>(probes.size());
  const Eigen::RowVectorXf everywhere =
      Eigen::Map<const Eigen::RowVectorXf>(u.data(), J).replicate(1, transport.cols() / J);
  Matrix rest(receivers, kept * J);
  uniform->resize(receivers);
  for (Eigen::Index r = 0; r < receivers; ++r) {
    const auto row = transport.row(rows[static_cast<size_t>(r)]);
    (*uniform)(r) = row.dot(everywhere);
    for (Eigen::Index p = 0; p < kept; ++p) {
      rest.row(r).segment(p * J, J) = row.segment(probes[static_cast<size_t>(p)] * J, J).cwiseProduct(w);
    }
  }
  rest -= *uniform * mean_radiance(kept, J);
  return rest;
}

/// Which probes and which V are kept, and how many, is decided on S′ ≈ U_S·Σ_S·Vᵀ, that is T′ of averaged rows: on T′ half of
/// V may be noise.
Truncated truncate(const Matrix& averaged, std::span<const uint32_t> rows, const CompressionOptions& o,
                   std::span<const float> u, uint64_t seed) {
  const Eigen::Index J = sh_count(o.order);
  const Eigen::RowVectorXf w = band_weights(o);
  const Eigen::MatrixXf energy = energies(averaged, rows, w);
  const double budget = double{o.threshold} * o.threshold;
  Truncated out;
  out.probes = strong_probes(energy, static_cast<float>(o.probe_loss * budget));
  const Eigen::Index probes = static_cast<Eigen::Index>(out.probes.size());
  double kept2 = 0;
  for (const uint32_t p : out.probes) kept2 += static_cast<double>(energy.col(p).sum());

  Eigen::VectorXf uniform;
  const Matrix rest = without_uniform(averaged, rows, out.probes, w, u, &uniform);
  const TruncatedSvd svd = truncated_svd(rest, o.max_rank, seed);
  out.norm2 = static_cast<double>(energy.sum());
  const double left_out = std::max(0.0, out.norm2 - kept2), allowed = budget * out.norm2 - left_out;
  double tail = rest.squaredNorm();
  Eigen::Index rank = 0;
  while (rank < svd.sigma.size() && tail > allowed) {
    tail -= svd.sigma(rank) * svd.sigma(rank);
    ++rank;
  }
  out.met = tail <= allowed;
  out.weights = w.replicate(1, probes);
  out.sv = svd.sv.topRows(rank);
  const Eigen::Map<const Eigen::RowVectorXf> field(u.data(), J);
  const Eigen::VectorXf said = out.sv * field.cwiseQuotient(w).replicate(1, probes).transpose();
  out.error2 = left_out + (rest - svd.u.leftCols(rank) * (out.sv - said * mean_radiance(probes, J))).squaredNorm();
  return out;
}

/// U·Σ = T′·V.
Factors own_factors(const Matrix& transport, std::span<const uint32_t> rows, const Truncated& t,
                    const CompressionOptions& o, std::span<const float> u) {
  Factors out;
  const Matrix own = without_uniform(transport, rows, t.probes, band_weights(o), u, &out.uniform);
  out.u = own * t.sv.transpose();
  out.sv = t.sv;
  for (Eigen::Index k = 0; k < out.u.cols(); ++k) {
    const float sigma2 = out.sv.row(k).squaredNorm(), length = out.u.col(k).norm();
    if (!(length > 0)) continue;
    out.u.col(k) /= length;
    out.sv.row(k) *= length / sigma2;
  }
  return out;
}

uint16_t to_unorm16(float irradiance) {
  return static_cast<uint16_t>(std::lround(std::clamp(irradiance / kPi, 0.0f, 1.0f) * 65535.0f));
}

/// Rounds the truncated factors to what is stored.
CellChunk::Cluster quantise(const Truncated& t, const Factors& f, std::span<const uint32_t> rows,
                            std::span<const Vec3> positions, int order, std::span<const float> u) {
  const size_t J = static_cast<size_t>(sh_count(order)), stride = static_cast<size_t>(sh_stride(order));
  const size_t probes = t.probes.size(), rank = static_cast<size_t>(f.u.cols());
  const size_t padded = (rows.size() + 7) / 8 * 8;
  CellChunk::Cluster c;
  c.receivers = static_cast<uint32_t>(rows.size());
  c.probes = t.probes;
  c.projection.assign(rank * probes * stride, 0);
  c.reconstruction.assign(rank * padded, 0);
  for (size_t k = 0; k < rank; ++k) {
    double correction = 0;
    for (size_t p = 0; p < probes; ++p) {
      for (size_t j = 0; j < J; ++j) {
        const Eigen::Index column = static_cast<Eigen::Index>(p * J + j);
        const Half h = float_to_half(f.sv(static_cast<Eigen::Index>(k), column) / t.weights(column));
        c.projection[(k * probes + p) * stride + j] = h;
        correction += static_cast<double>(half_to_float(h)) * static_cast<double>(u[j]);
      }
    }
    c.correction.push_back(static_cast<float>(correction));
    for (size_t r = 0; r < rows.size(); ++r) {
      c.reconstruction[k * padded + r] = float_to_half(f.u(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(k)));
    }
  }
  for (const uint32_t r : rows) c.bounds.extend(positions[r]);
  c.error = static_cast<float>(t.norm2 > 0 ? std::sqrt(t.error2 / t.norm2) : 0);
  return c;
}

}  // namespace

CompressedCell compress_cell(const Matrix& transport, const Matrix& averaged, std::span<const Vec3> positions,
                             const CompressionOptions& options) {
  LL_CHECK(static_cast<size_t>(transport.rows()) == positions.size() && options.min_receivers > 0);
  LL_CHECK(averaged.rows() == transport.rows() && averaged.cols() == transport.cols());
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
    const Truncated t = truncate(averaged, rows, options, u, hash_combine(options.seed, rows.size()));
    if (!t.met && rows.size() >= 2 * options.min_receivers) {
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
    const Factors own = own_factors(transport, rows, t, options, u);
    CellChunk::Cluster cluster = quantise(t, own, rows, positions, options.order, u);
    cluster.first_receiver = static_cast<uint32_t>(out.order.size());
    out.clusters.push_back(std::move(cluster));
    out.order.insert(out.order.end(), rows.begin(), rows.end());
    for (Eigen::Index r = 0; r < own.uniform.size(); ++r) out.uniform.push_back(to_unorm16(own.uniform(r)));
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
