// What a bake is about to do: cells and relight sets whose earlier results do not hold, and why.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>

#include "core/bake/reuse.h"

namespace lightloom {

/// Keeps references to its arguments.
class Outlook {
 public:
  Outlook(const Plan& plan, const Reuse& reuse);

  /// `explain`: also each cell, those that may have changed most first.
  nlohmann::json to_json(bool explain) const;
  void print(bool explain) const;

 private:
  const Plan& plan_;
  const Reuse& reuse_;
  size_t cells_ = 0, probes_ = 0, receivers_ = 0;
};

}  // namespace lightloom
