// Several levels' evaluations as one.
#pragma once

#include <vector>

#include "cli/eval/evaluation.h"

namespace lightloom::eval {

/// The settings that all levels have, by method and label, for labels say how a setting differs from its method's default on the
/// same level. Error and costs are geometric means over the levels; 0 where one of them has none. A level takes the place of a rig:
/// its error is that over its rigs. Our default comes first. Errors: no levels, one twice, other bounces, one without our default.
absl::StatusOr<Evaluation> pool(const std::vector<Evaluation>& levels);

}  // namespace lightloom::eval
