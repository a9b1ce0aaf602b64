#include "cli/bake_options.h"

namespace lightloom {

std::vector<Option> BakeOptions::options() {
  return {{"--method", "default, or sl17: Silvennoinen & Lehtinen 2017 as published, to compare with", &method_},
          {"--spacing", "side of a probe cell, metres [0: chosen from the level]", &spacing_},
          {"--order", "spherical harmonics order of the probes, 0 to 9 [7]", &order_},
          {"--probes", "sl17: how many, instead of by --spacing [0: by --spacing]", &probes_},
          {"--links", "probes that each receiver reads [6; sl17: 10 on average]", &links_},
          {"--rays", "gather rays per receiver, rounded up to a × b with a ≤ b ≤ 2a [256]", &rays_},
          {"--relight-rays", "rays of each probe at run time [4096; sl17: 8000]", &relight_rays_},
          {"--max-rank", "most coefficients of a cluster [32]", &max_rank_},
          {"--threshold", "relative error at which a cluster's rank ends [0.02; sl17: 0.005]", &threshold_},
          {"--cell-receivers", "a bake cell holds fewer receivers than this [1024]", &cell_receivers_},
          {"--texels-per-metre", "lightmap density [0: chosen from the level]", &texels_per_metre_},
          {"--lightmap-size", "side of the scene atlas, texels [0: from the density]", &lightmap_size_},
          {"--seed", "of all random numbers [0]", &seed_}};
}

BakeParams BakeOptions::params(const BakeParams* earlier) const {
  BakeParams p = method_ == "sl17" ? sl17_params() : BakeParams{};
  if (earlier != nullptr && (method_.empty() || earlier->method == p.method)) p = *earlier;
  const auto set = [](auto* value, const auto& given) {
    if (given) *value = *given;
  };
  // One of each pair decides: what an earlier bake had of the other must not.
  if (spacing_) p.probes = 0;
  if (probes_) p.spacing = 0;
  if (texels_per_metre_) p.lightmap_size = 0;
  if (lightmap_size_) p.texels_per_metre = 0;
  set(&p.spacing, spacing_);
  set(&p.order, order_);
  set(&p.probes, probes_);
  set(&p.links, links_);
  set(&p.rays, rays_);
  set(&p.relight_rays, relight_rays_);
  set(&p.max_rank, max_rank_);
  set(&p.threshold, threshold_);
  set(&p.cell_receivers, cell_receivers_);
  set(&p.texels_per_metre, texels_per_metre_);
  set(&p.lightmap_size, lightmap_size_);
  set(&p.seed, seed_);
  return p;
}

absl::Status BakeOptions::check() const {
  if (!method_.empty() && method_ != "default" && method_ != "sl17") {
    return absl::InvalidArgumentError("--method must be default or sl17");
  }
  return check_params(params(nullptr));
}

}  // namespace lightloom
