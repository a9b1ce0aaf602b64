// The options that say how a level is baked, for all commands that bake.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/command.h"
#include "core/bake/plan.h"

namespace lightloom {

class BakeOptions {
 public:
  std::vector<Option> options();
  /// Whether what was given is in range.
  absl::Status check() const;
  /// What was given; of the rest, what the earlier bake of this method had, or else the method's own. `earlier` may be null.
  BakeParams params(const BakeParams* earlier) const;

 private:
  std::string method_;
  std::optional<int> order_, probes_, links_, rays_, relight_rays_, max_rank_, cell_receivers_, lightmap_size_;
  std::optional<float> spacing_, threshold_, texels_per_metre_;
  std::optional<uint64_t> seed_;
};

}  // namespace lightloom
