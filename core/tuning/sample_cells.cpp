#include "core/tuning/sample_cells.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/bake/tasks.h"
#include "core/base/half.h"
#include "core/compression/average.h"
#include "core/compression/clusters.h"

namespace lightloom {
namespace {

constexpr double kClusterBytes = 48;      // besides its arrays
constexpr size_t kShare = 12, kMost = 6;  // of the cells
constexpr uint32_t kRelightRays = 512;    // it is only asked how E changes
constexpr size_t J = kMaxShCount, kOrders = kMaxShOrder + 1;

absl::Status cancelled() { return absl::CancelledError("cancelled while choosing parameters"); }

/// To ten bits of mantissa, from eleven.
Half rounded_further(Half h) { return static_cast<Half>((h + 1) & ~1); }

/// E by each order of the probes, from a row of the widest one.
void add_by_order(const float* row, const float* lambda, size_t probes, double (*e)[kOrders]) {
  for (size_t p = 0; p < probes; ++p) {
    for (size_t n = 0; n < kOrders; ++n) {
      double band = 0;
      for (size_t j = n * n; j < (n + 1) * (n + 1); ++j) {
        band += static_cast<double>(row[p * J + j]) * static_cast<double>(lambda[p * J + j]);
      }
      for (size_t m = n; m < kOrders; ++m) (*e)[m] += band;
    }
  }
}

/// The columns of lower orders, probe by probe.
Matrix narrowed(const Matrix& wide, int order) {
  const Eigen::Index count = sh_count(order), probes = wide.cols() / static_cast<Eigen::Index>(J);
  Matrix out(wide.rows(), probes * count);
  for (Eigen::Index p = 0; p < probes; ++p) {
    out.middleCols(p * count, count) = wide.middleCols(p * static_cast<Eigen::Index>(J), count);
  }
  return out;
}

std::vector<float> narrowed(const std::vector<float>& lambda, int order) {
  const size_t count = static_cast<size_t>(sh_count(order));
  std::vector<float> out;
  for (size_t p = 0; p < lambda.size() / J; ++p) {
    out.insert(out.end(), lambda.begin() + static_cast<std::ptrdiff_t>(p * J),
               lambda.begin() + static_cast<std::ptrdiff_t>(p * J + count));
  }
  return out;
}

}  // namespace

absl::StatusOr<SampleCells> SampleCells::create(const RayTracer& tracer, const Plan& plan, const ErrorSample& sample,
                                                const Parallel& how) {
  SampleCells out;
  out.lights_ = sample.lights().count();
  const size_t lights = out.lights_;
  // Lights count alike, but for those that light hardly anything (as in ErrorSample).
  const double typical = sample.typical_energy();
  for (const double e : sample.energy()) out.weight_.push_back(e > 0 ? 1 / std::max(e, typical) : 0);
  const size_t count = std::min({(plan.cells.size() + kShare - 1) / kShare, kMost, plan.cells.size()});
  out.cells_.resize(count);
  const std::vector<Vec3> positions = positions_of(plan.placement.probes);
  VisibilityCache cache(tracer, plan.layout, plan.receivers.grids, positions);
  Parallel quiet = how;
  quiet.progress = nullptr;

  std::vector<CellTask> tasks;
  std::map<uint32_t, std::vector<float>> known;
  for (size_t c = 0; c < count; ++c) {
    tasks.push_back(make_cell_task(plan, tracer.scene(), plan.cells[(2 * c + 1) * plan.cells.size() / (2 * count)]));
    for (const uint32_t id : tasks.back().probe_ids) known[id];
  }
  std::vector<std::pair<const uint32_t, std::vector<float>>*> probes;
  for (auto& probe : known) probes.push_back(&probe);
  const bool lit = parallel_for(probes.size(), quiet, [&](uint64_t i) {
    probes[i]->second = sample.probe_radiance(positions[probes[i]->first], kRelightRays, kMaxShOrder);
  });
  if (!lit) return cancelled();

  // Pieces of cells, so that all threads have work.
  struct Piece {
    size_t cell, first, end;
  };
  constexpr size_t kPiece = 32;
  std::vector<Piece> pieces;
  for (size_t c = 0; c < count; ++c) {
    Cell& cell = out.cells_[c];
    const CellTask& task = tasks[c];
    const size_t n = task.receivers.size();
    for (Matrix& m : cell.transport) {
      m = Matrix::Zero(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(task.probes.size() * J));
    }
    for (auto& near : cell.near) near.assign(n * lights, 0);
    cell.judged.assign(n * kJudges * lights * kOrders, 0);
    cell.seed = task.seed;
    cell.sigma = task.sigma;
    for (const GatherPoint& r : task.receivers) {
      cell.positions.push_back(r.point.position);
      cell.normals.push_back(r.point.normal);
    }
    cell.lambda.resize(lights);
    for (size_t l = 0; l < lights; ++l) {
      for (const uint32_t id : task.probe_ids) {
        const auto from = known.at(id).begin() + static_cast<std::ptrdiff_t>(l * J);
        cell.lambda[l].insert(cell.lambda[l].end(), from, from + static_cast<std::ptrdiff_t>(J));
      }
    }
    for (size_t i = 0; i < n; i += kPiece) pieces.push_back({c, i, std::min(n, i + kPiece)});
  }
  const bool gathered = parallel_for(pieces.size(), how, [&](uint64_t i) {
    const Piece& piece = pieces[i];
    const CellTask& task = tasks[piece.cell];
    Cell& cell = out.cells_[piece.cell];
    Gatherer gatherer(tracer, &cache, &sample.surfaces(), {task.probes, task.probe_ids},
                      {kMaxShOrder, static_cast<int>(kBatchRays), true, plan.params.near_field});
    std::vector<float> row(task.probes.size() * J);
    for (size_t r = piece.first; r < piece.end; ++r) {
      std::vector<float> sum(row.size(), 0.0f);
      std::vector<double> near(lights), near_sum(lights);
      size_t stored = 0;
      for (uint32_t b = 0; b < kBatches + kJudges; ++b) {
        GatherPoint point = task.receivers[r];
        point.seed = hash_combine(point.seed, 0xce11 + b);
        std::fill(row.begin(), row.end(), 0.0f);
        gatherer.add_row(point, row);
        std::fill(near.begin(), near.end(), 0.0);
        sample.add_near_field(gatherer.near(), kBatchRays, near);
        if (b >= kBatches) {
          for (size_t l = 0; l < lights; ++l) {
            double e[kOrders];
            std::fill(std::begin(e), std::end(e), near[l]);
            add_by_order(row.data(), cell.lambda[l].data(), task.probes.size(), &e);
            float* judged = &cell.judged[((r * kJudges + b - kBatches) * lights + l) * kOrders];
            std::copy(e, e + kOrders, judged);
          }
          continue;
        }
        for (size_t k = 0; k < sum.size(); ++k) sum[k] += row[k];
        for (size_t l = 0; l < lights; ++l) near_sum[l] += near[l];
        if ((b + 1) * kBatchRays == static_cast<uint32_t>(kRays[stored])) {
          auto to = cell.transport[stored].row(static_cast<Eigen::Index>(r));
          to = Eigen::Map<const Eigen::RowVectorXf>(sum.data(), to.cols()) / static_cast<float>(b + 1);
          for (size_t l = 0; l < lights; ++l) cell.near[stored][r * lights + l] = near_sum[l] / (b + 1);
          ++stored;
        }
      }
    }
  });
  if (!gathered) return cancelled();
  out.dark_ = std::all_of(out.cells_.begin(), out.cells_.end(), [](const Cell& cell) {
    return std::all_of(cell.judged.begin(), cell.judged.end(), [](float e) { return e == 0; });
  });
  return out;
}

absl::StatusOr<CompressionCost> SampleCells::compress(const CompressionChoice& choice, const Parallel& how) const {
  struct Sums {
    double error2 = 0, rounding2 = 0, energy2 = 0;  // weighted alike, summed over lights and receivers
    double projection = 0, other = 0, receivers = 0;
  };
  const size_t of_rays =
      static_cast<size_t>(std::find(std::begin(kRays), std::end(kRays), choice.rays) - std::begin(kRays));
  const size_t order = static_cast<size_t>(choice.order);
  std::vector<Sums> sums(cells_.size());
  Parallel quiet = how;
  quiet.progress = nullptr;
  const bool done = parallel_for(cells_.size(), quiet, [&](uint64_t i) {
    const Cell& cell = cells_[i];
    Sums& s = sums[i];
    CompressionOptions options;
    options.order = choice.order;
    options.max_rank = choice.max_rank;
    options.threshold = choice.threshold;
    options.relight_rays = static_cast<uint32_t>(choice.relight_rays);
    options.seed = cell.seed;
    const Matrix transport = narrowed(cell.transport[of_rays], choice.order);
    const CompressedCell compressed =
        compress_cell(transport, average_with_neighbours(transport, cell.positions, cell.normals, cell.sigma),
                      cell.positions, options);
    s.receivers = static_cast<double>(cell.positions.size());
    s.other = s.receivers * sizeof(uint16_t);
    std::vector<std::vector<float>> lambdas;
    for (const std::vector<float>& wide : cell.lambda) lambdas.push_back(narrowed(wide, choice.order));
    for (const CellChunk::Cluster& cluster : compressed.clusters) {
      s.projection += static_cast<double>(cluster.projection.size() * sizeof(Half));
      s.other +=
          static_cast<double>(cluster.reconstruction.size() * sizeof(Half) + cluster.correction.size() * sizeof(float) +
                              cluster.probes.size() * sizeof(uint32_t)) +
          kClusterBytes;
      CellChunk::Cluster coarse = cluster;
      for (Half& h : coarse.projection) h = rounded_further(h);
      for (Half& h : coarse.reconstruction) h = rounded_further(h);
      for (size_t l = 0; l < lights_; ++l) {
        if (!(weight_[l] > 0)) continue;
        const std::vector<float> e = decode_cluster(cluster, compressed.uniform, choice.order, lambdas[l]);
        const std::vector<float> rough = decode_cluster(coarse, compressed.uniform, choice.order, lambdas[l]);
        for (size_t r = 0; r < e.size(); ++r) {
          const size_t receiver = compressed.order[cluster.first_receiver + r];
          double mean = 0, square = 0;
          for (size_t b = 0; b < kJudges; ++b) {
            const double judge =
                static_cast<double>(cell.judged[((receiver * kJudges + b) * lights_ + l) * kOrders + order]);
            mean += judge / kJudges;
            square += judge * judge;
          }
          const double of_mean = (square - kJudges * mean * mean) / (kJudges - 1) / kJudges;  // its variance
          const double error = static_cast<double>(e[r]) + cell.near[of_rays][receiver * lights_ + l] - mean;
          const double rounded = static_cast<double>(rough[r]) - static_cast<double>(e[r]);
          s.error2 += (error * error - of_mean) * weight_[l];
          s.energy2 += (mean * mean - of_mean) * weight_[l];
          // One bit more is rounded by one unit of what was kept, every other time: six times the variance of the rounding
          // that kept it.
          s.rounding2 += rounded * rounded / 6 * weight_[l];
        }
      }
    }
  });
  if (!done) return cancelled();
  Sums all;
  for (const Sums& s : sums) {
    all.error2 += s.error2, all.rounding2 += s.rounding2, all.energy2 += s.energy2;
    all.projection += s.projection, all.other += s.other, all.receivers += s.receivers;
  }
  CompressionCost out;
  if (all.receivers > 0) out.projection = all.projection / all.receivers, out.other = all.other / all.receivers;
  // Of the energy of the same receivers: few cells know little of the level's.
  if (all.energy2 > 0) {
    out.fp16 = std::sqrt(all.rounding2 / all.energy2);
    out.error = std::sqrt(std::max(0.0, (all.error2 - all.rounding2) / all.energy2));
  }
  return out;
}

}  // namespace lightloom
