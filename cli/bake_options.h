// The options that say how a level is baked, for all commands that bake.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/command.h"
#include "core/bake/plan.h"
#include "core/tuning/tune.h"

namespace lightloom {

class BakeOptions {
 public:
  std::vector<Option> options();
  /// Whether what was given is in range.
  absl::Status check() const;
  /// What was given; of the rest, what the earlier bake of this method had, or else the method's own. `earlier` may be null.
  BakeParams params(const BakeParams* earlier) const;
  /// What the rest of the parameters are to be chosen for; none: they are given, or an earlier bake's. `earlier` may be null.
  std::optional<TuneTarget> target(const BakeParams* earlier) const;
  /// params(), with the rest chosen for the target, if any. `tuning`, if given, tells how. Errors: tune()'s.
  absl::StatusOr<BakeParams> tuned(const RayTracer& tracer, const BakeParams* earlier, const BakeControl& control,
                                   std::optional<Tuning>* tuning) const;

 private:
  /// The first of the options that say how finely a level is modelled; empty: none was given.
  std::string fixed() const;
  /// Whether the parameters of the earlier bake go on: it is of the method that is asked for.
  bool keeps(const BakeParams* earlier) const;

  std::string method_;
  std::optional<int> order_, probes_, links_, rays_, relight_rays_, max_rank_, cell_receivers_, lightmap_size_;
  std::optional<float> spacing_, near_field_, average_, threshold_, texels_per_metre_, error_;
  uint64_t budget_ = 0;
  bool retune_ = false;
  std::optional<uint64_t> seed_;
};

}  // namespace lightloom
