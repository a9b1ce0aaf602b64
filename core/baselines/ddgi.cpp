// Majercik, Guertin, Nowrouzezahrai, McGuire, "Dynamic Diffuse Global Illumination with Ray-Traced Irradiance Fields",
// JCGT 8(2), 2019; Majercik, Marrs, Spjut, McGuire, "Scaling Probe-Based Real-Time Dynamic Global Illumination for
// Production", JCGT 10(2), 2021. Constants as in the authors' RTXGI-DDGI SDK (Irradiance, ProbeBlendingCS).
#include "core/baselines/ddgi.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string>

#include "core/base/check.h"
#include "core/base/half.h"
#include "core/base/sh.h"
#include "core/baselines/ddgi_grid.h"
#include "core/baselines/ddgi_visibility.h"
#include "core/baselines/octahedral_map.h"

namespace lightloom {
namespace {

using IrradianceMap = OctahedralMap<6>;
using Rgba [[gnu::vector_size(16)]] = float;

constexpr uint32_t kOff = 0xffffffffu;
constexpr size_t kSide = 6, kTexels = kSide * kSide;  // of the map within its border

// As 2019 stores them: irradiance R11G11B10F, both distances RG16F; and the SDK's offset and state, RGBA16F.
constexpr uint64_t kIrradianceBytes = IrradianceMap::kTexels * 4, kDistanceBytes = DistanceMap::kTexels * 4,
                   kStateBytes = 8;

/// From the rays' radiance to irradiance ÷ π per texel t: Σ_r cos⁺(ω_r, t)·L_r ÷ Σ_r cos⁺, so that a uniform field is exact.
/// Since cos⁺ = (cos + |cos|)/2, cos is linear in the texel's direction and |cos| that of the opposite texel too, 36 texels
/// take 21 columns.
class CosineFilter {
 public:
  static constexpr size_t kStride = 24;  // columns, rounded up to 8

  explicit CosineFilter(uint32_t rays) : weights_(rays * kStride) {
    size_t columns = 0;
    for (size_t t = 0; t < kTexels; ++t) {
      directions_[t] = IrradianceMap::direction(t % kSide, t / kSide);
      size_t opposite = 0;
      while (opposite < t && dot(directions_[opposite], directions_[t]) > -0.999f) ++opposite;
      columns_[t] = opposite < t ? columns_[opposite] : columns++;
    }
    LL_CHECK(columns == kLinear);
    std::array<double, kTexels> sums{};
    for (uint32_t r = 0; r < rays; ++r) {
      const Vec3 ray = sphere_direction(r, rays);
      float* row = weights_.data() + r * kStride;
      for (size_t t = 0; t < kTexels; ++t) {
        const float cosine = dot(directions_[t], ray);
        row[columns_[t]] = 0.5f * std::abs(cosine);
        sums[t] += static_cast<double>(std::max(cosine, 0.0f));
      }
      for (int a = 0; a < 3; ++a) row[kLinear + static_cast<size_t>(a)] = 0.5f * ray[a];
    }
    for (size_t t = 0; t < kTexels; ++t) scales_[t] = sums[t] > 0 ? static_cast<float>(1 / sums[t]) : 0;
  }

  /// For RelightRays::project().
  std::span<const float> weights() const { return weights_; }
  /// Texel t of one colour, from the columns of that colour.
  float texel(size_t t, const float* columns) const {
    const Vec3 linear{columns[kLinear], columns[kLinear + 1], columns[kLinear + 2]};
    return std::max(0.0f, scales_[t] * (columns[columns_[t]] + dot(directions_[t], linear)));
  }

 private:
  static constexpr size_t kLinear = kTexels / 2;  // the first of three columns

  std::vector<float> weights_;  ///< rays × kStride
  std::array<Vec3, kTexels> directions_;
  std::array<size_t, kTexels> columns_{};
  std::array<float, kTexels> scales_{};
};

class Ddgi final : public Baseline {
 public:
  struct Query {
    Vec3 position, normal;
  };
  struct Probes {
    DdgiGrid grid;
    std::vector<uint32_t> slot;   ///< per probe of the grid: its number among those that are lit, or kOff
    std::vector<Vec3> positions;  ///< per slot
    std::vector<Vec2> distances;  ///< per slot, DistanceMap::kTexels
  };

  Ddgi(RelightRays rays, Probes probes, std::vector<Query> queries, const DdgiParams& params, int threads)
      : Baseline(std::move(rays), queries.size(), IrradianceMap::kTexels * 4),
        params_(params),
        probes_(std::move(probes)),
        queries_(std::move(queries)),
        corners_(probes_.grid.corners()),
        bias_(params.bias * least(probes_.grid.spacing)),
        filter_(this->rays().count()) {
    if (!params_.keep_weights) return;
    kept_weights_.resize(queries_.size());
    Parallel how;
    how.threads = threads;
    parallel_for((queries_.size() + 255) / 256, how, [&](uint64_t block) {
      for (size_t r = block * 256; r < std::min<size_t>(queries_.size(), (block + 1) * 256); ++r) {
        kept_weights_[r] = weigh(queries_[r]);
      }
    });
    probes_.distances = {};
  }

  static float least(Vec3 v) { return std::min({v.x, v.y, v.z}); }

  uint64_t bytes() const override {
    const uint64_t all = probes_.grid.size();
    return rays().bytes() + all * (kIrradianceBytes + kStateBytes) +
           (params_.keep_weights ? receivers() * kCageBytes : all * kDistanceBytes);
  }
  uint64_t bytes_per_frame() const override {
    const uint64_t lit = probes();
    return rays().bytes() + lit * (2 * kIrradianceBytes + kStateBytes) +
           (params_.keep_weights ? receivers() * kCageBytes : lit * kDistanceBytes);
  }

 private:
  /// The probes that a receiver reads: corners of the cage at `base`.
  struct Cage {
    uint32_t base = 0;
    std::array<float, 8> weight{};  ///< sum 1; all 0, and E 0, if every probe is in a solid
  };
  static constexpr uint64_t kCageBytes = sizeof(uint32_t) + 8 * sizeof(Half);

  Cage weigh(const Query& query) const {
    const Vec3 biased = query.position + query.normal * bias_;
    const DdgiGrid::Cage around = probes_.grid.cage(biased);
    Cage cage{around.base, {}};
    float sum = 0;
    for (uint32_t c = 0; c < 8; ++c) {
      const uint32_t slot = probes_.slot[around.base + corners_[c]];
      if (slot == kOff) continue;
      const Vec3 probe = probes_.positions[slot];

      // Visibility is asked from the biased place, facing from the true one.
      const Vec3 from_probe = biased - probe;
      const float distance = length(from_probe);
      float visibility = 1;
      if (distance > 0) {
        const Vec2* map = probes_.distances.data() + slot * DistanceMap::kTexels;
        const Vec2 moments = DistanceMap::tap(from_probe).blend([&](size_t t) { return map[t]; });
        visibility = chebyshev_visibility(moments, distance);
      }
      float weight = ddgi_weight(dot(normalize(probe - query.position), query.normal), visibility);
      for (int a = 0; a < 3; ++a) {
        weight *= std::max(0.001f, c >> a & 1 ? around.alpha[a] : 1 - around.alpha[a]);
      }
      cage.weight[c] = weight;
      sum += weight;
    }
    if (sum > 0) {
      for (float& w : cage.weight) w /= sum;
    }
    return cage;
  }

  void relight(uint32_t probe, std::span<const Vec3> radiance, std::span<float> kept) const override {
    std::array<float, 3 * CosineFilter::kStride> columns;
    rays().project(probe, radiance, filter_.weights(), CosineFilter::kStride, columns);
    std::array<Rgba, IrradianceMap::kTexels> map{};
    for (size_t t = 0; t < kTexels; ++t) {
      Rgba& texel = map[IrradianceMap::index(t % kSide, t / kSide)];
      for (size_t c = 0; c < 3; ++c) {
        const float e = filter_.texel(t, columns.data() + c * CosineFilter::kStride);
        texel[c] = params_.perceptual ? std::pow(e, 0.2f) : e;
      }
    }
    IrradianceMap::fill_border<Rgba>(map);
    std::memcpy(kept.data(), map.data(), sizeof map);
  }

  void receive(size_t first, std::span<const float> kept, std::span<Vec3> irradiance) const override {
    for (size_t i = 0; i < irradiance.size(); ++i) {
      const size_t r = first + i;
      const Cage cage = params_.keep_weights ? kept_weights_[r] : weigh(queries_[r]);
      const IrradianceMap::Tap tap = IrradianceMap::tap(queries_[r].normal);
      Rgba sum{};
      for (uint32_t c = 0; c < 8; ++c) {
        if (cage.weight[c] == 0) continue;
        const uint32_t slot = probes_.slot[cage.base + corners_[c]];
        const float* map = kept.data() + slot * IrradianceMap::kTexels * 4;
        Rgba e = tap.blend([&](size_t t) {
          Rgba texel;
          std::memcpy(&texel, map + t * 4, sizeof texel);
          return texel;
        });
        if (params_.perceptual) e = e * e * Rgba{std::sqrt(e[0]), std::sqrt(e[1]), std::sqrt(e[2]), 0};  // e^(5/2)
        sum += e * cage.weight[c];
      }
      if (params_.perceptual) sum *= sum;
      irradiance[i] = Vec3{sum[0], sum[1], sum[2]} * kPi;
    }
  }

  DdgiParams params_;
  Probes probes_;
  std::vector<Query> queries_;
  std::array<uint32_t, 8> corners_;
  float bias_;  ///< metres
  CosineFilter filter_;
  std::vector<Cage> kept_weights_;
};

absl::Status check(const DdgiParams& p) {
  const auto bad = [](const std::string& what) { return absl::InvalidArgumentError("DDGI: " + what); };
  if (!(p.spacing > 0) || !std::isfinite(p.spacing)) return bad("the spacing must be a positive number of metres");
  if (!(p.clearance >= 0 && p.clearance <= 0.45f)) return bad("the clearance must be 0 to 0.45 of the spacing");
  if (!(p.bias >= 0 && p.bias <= 2)) return bad("the bias must be 0 to 2 of the spacing");
  if (p.distance_rays < 1 || p.distance_rays > 1 << 20) return bad("distance rays must be 1 to 1048576");
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<Baseline>> make_ddgi(const RayTracer& tracer, const Plan& plan, const DdgiParams& params,
                                                    const BakeControl& control) {
  LL_RETURN_IF_ERROR(check(params));
  Aabb box;
  std::vector<Ddgi::Query> queries;
  for (const Receiver& r : plan.receivers.all) {
    box.extend(r.point.position);
    queries.push_back({r.point.position, r.point.normal});
  }
  Ddgi::Probes probes;
  LL_ASSIGN_OR_RETURN(probes.grid, make_ddgi_grid(box, params.spacing, params.enclose));
  const DdgiGrid& grid = probes.grid;

  // Probes that no receiver reads need no light (2021, probe states: those that shade static geometry are vigilant).
  probes.slot.assign(grid.size(), kOff);
  const auto corners = grid.corners();
  const float bias = params.bias * Ddgi::least(grid.spacing);
  std::vector<bool> read(grid.size());
  for (const Ddgi::Query& q : queries) {
    const uint32_t base = grid.cage(q.position + q.normal * bias).base;
    for (const uint32_t corner : corners) read[base + corner] = true;
  }
  std::vector<DdgiProbe> placed(grid.size());
  if (!parallel_for(grid.size(), control.stage("DDGI probes"), [&](uint64_t p) {
        if (read[p]) {
          placed[p] = place_ddgi_probe(tracer, grid.rest(static_cast<uint32_t>(p)), grid.spacing, params.clearance);
        }
      })) {
    return absl::CancelledError("cancelled while placing DDGI probes");
  }
  for (uint32_t p = 0; p < grid.size(); ++p) {
    if (!placed[p].open) continue;
    probes.slot[p] = static_cast<uint32_t>(probes.positions.size());
    probes.positions.push_back(placed[p].position);
  }

  // Distances count as far as 1.5 diagonals of a cell: no receiver of a cage is farther.
  probes.distances.resize(probes.positions.size() * DistanceMap::kTexels);
  if (!parallel_for(probes.positions.size(), control.stage("DDGI distances"), [&](uint64_t p) {
        filter_distances(tracer, probes.positions[p], 1.5f * length(grid.spacing),
                         static_cast<uint32_t>(params.distance_rays),
                         std::span(probes.distances).subspan(p * DistanceMap::kTexels, DistanceMap::kTexels));
      })) {
    return absl::CancelledError("cancelled while tracing DDGI distances");
  }
  LL_ASSIGN_OR_RETURN(RelightRays rays, RelightRays::trace(tracer, plan, probes.positions, control));
  return std::make_unique<Ddgi>(std::move(rays), std::move(probes), std::move(queries), params, control.threads);
}

}  // namespace lightloom
