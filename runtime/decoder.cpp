// Silvennoinen & Lehtinen, "Real-time Global Illumination by Precomputed Local Reconstruction from Sparse
// Radiance Probes", SIGGRAPH Asia 2017: relighting (Sec. 4.1) and the compressed cluster transport of Eq. 11.
#include "runtime/decoder.h"

#include <array>

#include "core/base/check.h"
#include "core/base/sh.h"

namespace lightloom {
namespace {

constexpr double kPiD = 3.14159265358979323846;

using Rgb = std::array<double, 3>;
void add(Rgb* sum, double weight, Vec3 v) {
  for (int c = 0; c < 3; ++c) (*sum)[static_cast<size_t>(c)] += weight * static_cast<double>(v[c]);
}
void add(Rgb* sum, double weight, const Rgb& v) {
  for (size_t c = 0; c < 3; ++c) (*sum)[c] += weight * v[c];
}
Vec3 rounded(const Rgb& v) { return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])}; }

/// λ_j = 4π/N · Σ_r Y_j(ω_r) · L_r.
void relight(const std::vector<uint32_t>& rays, const std::vector<float>& sh, const DecodedFrame& frame,
             Vec3 environment, std::span<Vec3> lambda) {
  const size_t J = lambda.size();
  std::vector<Rgb> sum(J, Rgb{});
  for (size_t r = 0; r < rays.size(); ++r) {
    if (rays[r] == RelightChunk::kDead) continue;
    const Vec3 radiance = rays[r] == RelightChunk::kSky ? environment : frame.radiosity[rays[r]];
    for (size_t j = 0; j < J; ++j) add(&sum[j], static_cast<double>(sh[r * J + j]), radiance);
  }
  for (size_t j = 0; j < J; ++j) {
    Rgb scaled{};
    add(&scaled, 4 * kPiD / static_cast<double>(rays.size()), sum[j]);
    lambda[j] = rounded(scaled);
  }
}

/// c_0..c_K of one cluster. `order`: of λ.
std::vector<Rgb> project(const SourceCell& cell, const CellChunk::Cluster& cluster, uint32_t order,
                         const std::vector<Vec3>& lambda) {
  const size_t J = static_cast<size_t>(sh_count(static_cast<int>(order)));
  const size_t cell_J = static_cast<size_t>(sh_count(static_cast<int>(cell.chunk.order)));
  const size_t stride = static_cast<size_t>(sh_stride(static_cast<int>(cell.chunk.order)));
  const size_t P = cluster.probes.size();
  const auto lambda_of = [&](size_t i, size_t j) { return lambda[cell.probes[cluster.probes[i]] * J + j]; };

  std::vector<Rgb> c(cluster.rank() + 1, Rgb{});
  // Without probes there is no light.
  for (size_t i = 0; i < P; ++i) {
    add(&c[0], static_cast<double>(kShUniform) / (4 * kPiD * static_cast<double>(P)), lambda_of(i, 0));
  }
  for (size_t k = 1; k < c.size(); ++k) {
    for (size_t i = 0; i < P; ++i) {
      const Half* row = cluster.projection.data() + ((k - 1) * P + i) * stride;
      for (size_t j = 0; j < cell_J; ++j) add(&c[k], static_cast<double>(half_to_float(row[j])), lambda_of(i, j));
    }
    add(&c[k], -static_cast<double>(cluster.correction[k - 1]), c[0]);
  }
  return c;
}

/// `near`: the first entry of the cluster's near fields; becomes that of the next one's.
void receive(const SourceCell& cell, const CellChunk::Cluster& cluster, const std::vector<Rgb>& c,
             std::span<const Vec3> radiosity, size_t* near, std::span<Vec3> irradiance) {
  const size_t padded = (cluster.receivers + 7) / 8 * size_t{8};
  for (size_t r = 0; r < cluster.receivers; ++r) {
    const size_t receiver = cluster.first_receiver + r;
    Rgb e{};
    add(&e, kPiD * cell.chunk.uniform[receiver] / 65535, c[0]);
    for (size_t k = 1; k < c.size(); ++k) {
      add(&e, static_cast<double>(half_to_float(cluster.reconstruction[(k - 1) * padded + r])), c[k]);
    }
    for (const size_t end = *near + cell.chunk.near_counts[receiver]; *near < end; ++*near) {
      add(&e, kPiD * cell.chunk.near_weights[*near] / 65535, radiosity[cell.near_elements[*near]]);
    }
    irradiance[cell.elements[receiver]] = rounded(e);
  }
}

}  // namespace

absl::StatusOr<DecoderAsset> load_decoder_asset(const AssetSource& source) {
  const Manifest& m = source.manifest();
  DecoderAsset asset;
  asset.order = static_cast<uint32_t>(m.params.order);
  asset.surface_elements = source.surface_elements();
  std::vector<bool> received(asset.surface_elements);
  for (uint32_t i = 0; i < m.cells.size(); ++i) {
    LL_ASSIGN_OR_RETURN(SourceCell cell, source.cell(i));
    LL_RETURN_IF_ERROR(mark_receivers(i, cell, &received));
    asset.cells.push_back(std::move(cell));
  }
  for (uint32_t p = 0; p < m.probes.size(); ++p) {
    LL_ASSIGN_OR_RETURN(std::vector<uint32_t> rays, source.relight(p));
    asset.relight.push_back(std::move(rays));
  }
  return asset;
}

DecodedFrame decode_frame(const DecoderAsset& asset, const SurfaceLight& light, std::span<const Vec3> previous,
                          const Parallel& how) {
  const size_t S = asset.surface_elements;
  LL_CHECK(light.direct.size() == S && light.albedo.size() == S && light.emission.size() == S);
  LL_CHECK(previous.size() == S);
  DecodedFrame frame;

  // Light that leaves every surface element.
  frame.radiosity.resize(S);
  for (size_t s = 0; s < S; ++s) {
    frame.radiosity[s] = light.albedo[s] * (light.direct[s] + previous[s]) * (1 / kPi) + light.emission[s];
  }

  // Radiance at every probe.
  const size_t J = static_cast<size_t>(sh_count(static_cast<int>(asset.order)));
  const size_t N = asset.relight.empty() ? 0 : asset.relight[0].size();
  std::vector<float> sh(N * J);
  for (size_t r = 0; r < N; ++r) {
    sh_evaluate(static_cast<int>(asset.order), sphere_direction(static_cast<uint32_t>(r), static_cast<uint32_t>(N)),
                std::span(sh).subspan(r * J, J));
  }
  frame.lambda.resize(asset.relight.size() * J);
  parallel_for(asset.relight.size(), how, [&](uint64_t p) {
    relight(asset.relight[p], sh, frame, light.environment, std::span(frame.lambda).subspan(p * J, J));
  });

  // Irradiance of every receiver. Cells share no receivers.
  frame.irradiance.resize(S);
  parallel_for(asset.cells.size(), how, [&](uint64_t i) {
    const SourceCell& cell = asset.cells[i];
    size_t near = 0;
    for (const CellChunk::Cluster& cluster : cell.chunk.clusters) {
      receive(cell, cluster, project(cell, cluster, asset.order, frame.lambda), frame.radiosity, &near,
              frame.irradiance);
    }
  });
  return frame;
}

}  // namespace lightloom
