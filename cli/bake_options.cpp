#include "cli/bake_options.h"

namespace lightloom {

std::vector<Option> BakeOptions::options() {
  BakeParams& p = params;
  return {{"--method", "default, or sl17: Silvennoinen & Lehtinen 2017 as published, to compare with", &method},
          {"--spacing", "side of a probe cell, metres; 0: chosen from the level", &p.spacing},
          {"--order", "spherical harmonics order of the probes, 0 to 9", &p.order},
          {"--probes", "sl17: how many, instead of by --spacing; 0: by --spacing", &p.probes},
          {"--links", "probes that each receiver reads; −1: 6 (sl17: 10 on average)", &links},
          {"--rays", "gather rays per receiver, rounded up to a × b with a ≤ b ≤ 2a", &p.rays},
          {"--relight-rays", "rays of each probe at run time; −1: 4096 (sl17: 8000)", &relight_rays},
          {"--max-rank", "most coefficients of a cluster", &p.max_rank},
          {"--threshold", "relative error at which a cluster's rank ends; −1: 0.02 (sl17: 0.005)", &threshold},
          {"--cell-receivers", "a bake cell holds fewer receivers than this", &p.cell_receivers},
          {"--texels-per-metre", "lightmap density; 0: chosen from the level", &p.texels_per_metre},
          {"--lightmap-size", "side of the scene atlas, texels; 0: from the density", &p.lightmap_size},
          {"--seed", "of all random numbers", &p.seed}};
}

absl::Status BakeOptions::check() {
  if (method != "default" && method != "sl17") {
    return absl::InvalidArgumentError("--method must be default or sl17");
  }
  const BakeParams of_method = method == "sl17" ? sl17_params() : BakeParams{};
  params.method = of_method.method;
  params.links = links == -1 ? of_method.links : links;
  params.relight_rays = relight_rays == -1 ? of_method.relight_rays : relight_rays;
  params.threshold = threshold == -1 ? of_method.threshold : threshold;
  return check_params(params);
}

}  // namespace lightloom
