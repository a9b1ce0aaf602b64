#include "cli/bake_options.h"

#include <cstdio>

namespace lightloom {
namespace {

constexpr float kDefaultError = 0.05f;

}  // namespace

std::vector<Option> BakeOptions::options() {
  return {
      {"--error",
       "the smallest model of about this relative error (RMS, one bounce), in place of the options from --spacing to "
       "--threshold; with one of those, the others have the values given with them [0.05]",
       &error_},
      {"--budget", "choose the most accurate model of about so many bytes at most, like 32MB; 0: no budget",
       SizeOption{&budget_}},
      {"--retune", "choose anew for --error [0.05] or --budget, whatever the parameters of OUT.loom are", &retune_},
      {"--method", "default, or sl17: Silvennoinen & Lehtinen 2017 as published, to compare with", &method_},
      {"--spacing", "side of a probe cell, metres [0: chosen from the level]", &spacing_},
      {"--near-field", "metres within which a receiver reads texels instead of probes; 0: none [half of the spacing]",
       &near_field_},
      {"--order", "spherical harmonics order of the probes, 0 to 9 [7]", &order_},
      {"--probes", "sl17: how many, instead of by --spacing [0: by --spacing]", &probes_},
      {"--links", "probes that each receiver reads [6; sl17: 10 on average]", &links_},
      {"--rays", "gather rays per receiver, rounded up to a × b with a ≤ b ≤ 2a [256]", &rays_},
      {"--relight-rays", "rays of each probe at run time [4096; sl17: 8000]", &relight_rays_},
      {"--max-rank", "most coefficients of a cluster [32]", &max_rank_},
      {"--average",
       "texels over which transport is averaged to decide what a cluster keeps; 0: none [0, but 1 where --error or "
       "--budget chooses]",
       &average_},
      {"--threshold", "relative error at which a cluster's rank ends [0.02; sl17: 0.005]", &threshold_},
      {"--cell-receivers", "a bake cell holds fewer receivers than this [1024]", &cell_receivers_},
      {"--texels-per-metre", "lightmap density [0: chosen from the level]", &texels_per_metre_},
      {"--lightmap-size", "side of the scene atlas, texels [0: from the density]", &lightmap_size_},
      {"--seed", "of all random numbers [0]", &seed_}};
}

std::string BakeOptions::fixed() const {
  if (method_ == "sl17") return "--method sl17";
  if (spacing_) return "--spacing";
  if (near_field_) return "--near-field";
  if (order_) return "--order";
  if (probes_) return "--probes";
  if (rays_) return "--rays";
  if (relight_rays_) return "--relight-rays";
  if (max_rank_) return "--max-rank";
  if (average_) return "--average";
  return threshold_ ? "--threshold" : "";
}

bool BakeOptions::keeps(const BakeParams* earlier) const {
  const BakeMethod asked = method_ == "sl17" ? BakeMethod::kSl17 : BakeMethod::kDefault;
  return earlier != nullptr && (method_.empty() || earlier->method == asked);
}

std::optional<TuneTarget> BakeOptions::target(const BakeParams* earlier) const {
  if (keeps(earlier) && !retune_) return std::nullopt;
  if (budget_ > 0) return TuneTarget{0, budget_};
  if (!error_ && !retune_ && !fixed().empty()) return std::nullopt;
  return TuneTarget{static_cast<double>(error_.value_or(kDefaultError)), 0};
}

absl::StatusOr<BakeParams> BakeOptions::tuned(const RayTracer& tracer, const BakeParams* earlier,
                                              const BakeControl& control, std::optional<Tuning>* tuning) const {
  BakeParams p = params(earlier);
  const std::optional<TuneTarget> for_what = target(earlier);
  if (!for_what) {
    if (error_ || budget_ > 0) {
      std::fprintf(stderr, "lightloom: the parameters of the earlier bake are kept; --retune chooses anew\n");
    }
    return p;
  }
  if (p.method == BakeMethod::kSl17) {
    return absl::InvalidArgumentError(
        "--retune chooses for the default method, and the asset is sl17's: add --method default");
  }
  LL_ASSIGN_OR_RETURN(const Tuning chosen, tune(tracer, p, *for_what, control));
  p = chosen.chosen.params;
  if (tuning != nullptr) *tuning = chosen;
  return p;
}

BakeParams BakeOptions::params(const BakeParams* earlier) const {
  BakeParams p = method_ == "sl17" ? sl17_params() : BakeParams{};
  if (keeps(earlier)) {
    p = *earlier;
  } else if (earlier != nullptr) {  // another method: only what is no matter of it
    p.texels_per_metre = earlier->texels_per_metre;
    p.lightmap_size = earlier->lightmap_size;
    p.seed = earlier->seed;
  }
  const auto set = [](auto* value, const auto& given) {
    if (given) *value = *given;
  };
  // One of each pair decides: what an earlier bake had of the other must not.
  if (spacing_) p.probes = 0;
  if (spacing_ && p.near_field > 0) p.near_field = BakeParams::kFollows;
  if (probes_) p.spacing = 0;
  if (texels_per_metre_) p.lightmap_size = 0;
  if (lightmap_size_) p.texels_per_metre = 0;
  set(&p.spacing, spacing_);
  set(&p.near_field, near_field_);
  set(&p.order, order_);
  set(&p.probes, probes_);
  set(&p.links, links_);
  set(&p.rays, rays_);
  set(&p.relight_rays, relight_rays_);
  set(&p.max_rank, max_rank_);
  set(&p.average, average_);
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
  if (error_ && !(*error_ > 0 && *error_ <= 1)) {
    return absl::InvalidArgumentError("--error must be above 0, and 1 at most");
  }
  if (near_field_ && !(*near_field_ >= 0)) {
    return absl::InvalidArgumentError("--near-field must be 0 or a positive number of metres");
  }
  if (error_ && budget_ > 0) return absl::InvalidArgumentError("--error and --budget: give one of them");
  if ((error_ || budget_ > 0 || retune_) && !fixed().empty()) {
    return absl::InvalidArgumentError(std::string(error_        ? "--error"
                                                  : budget_ > 0 ? "--budget"
                                                                : "--retune") +
                                      " chooses what " + fixed() + " gives: leave out one of them");
  }
  return check_params(params(nullptr));
}

}  // namespace lightloom
