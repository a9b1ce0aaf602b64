// The cheapest model of a level that is accurate enough, or the most accurate one that is small enough: spacing, near field, order,
// rays and rank follow from measured parts of the error, so that none of them is finer than the others let it show.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "core/bake/plan.h"

namespace lightloom {

/// Changes with any change of what is chosen. Choices that are on record hold without it; what is remembered of the tuner's does not.
inline constexpr std::string_view kTunerVersion = "5";

/// One of them is set.
struct TuneTarget {
  double error = 0;    ///< rel_rmse of one bounce
  uint64_t bytes = 0;  ///< of the asset
};

/// In units of rel_rmse; independent, so that their squares add up.
struct ErrorParts {
  double bandlimit = 0;   ///< few probes of finite order; with what no probe sees
  double unseen = 0;      ///< of it: light from what no probe in reach sees
  double noise = 0;       ///< of the gather rays
  double relight = 0;     ///< of the relight rays
  double truncation = 0;  ///< of the rank
  double fp16 = 0;
  double total() const;
};

/// Parameters and what they are estimated to give.
struct TunedModel {
  BakeParams params;
  uint64_t probes = 0;
  ErrorParts parts;
  double bytes = 0;
};

struct Tuning {
  TunedModel chosen;
  bool met = false;                ///< the target, by estimate
  std::optional<TunedModel> next;  ///< with the next finer spacing: what one more step would cost and give
  int plans = 0;                   ///< spacings that were tried
  double seconds = 0;
};

/// `request`: what it says of the lightmap, seed and links is kept. An error that no model in reach has, or that costs more
/// and more for less and less, ends at the knee of the curve: met is false. Lights are tried that the level's own space
/// suggests; the level's lights play no part. Deterministic. Errors: those of planning; a byte budget that the smallest model
/// exceeds; cancellation.
absl::StatusOr<Tuning> tune(const RayTracer& tracer, const BakeParams& request, const TuneTarget& target,
                            const BakeControl& control);

}  // namespace lightloom
