// Whether one quantity grows with another, whatever the curve.
#pragma once

#include <span>

namespace lightloom::eval {

/// Spearman's ρ, −1 to 1: the correlation of ranks, equal values sharing the mean of theirs. 0 where one of both is constant.
/// REQUIRES: as many values of a as of b.
double rank_correlation(std::span<const double> a, std::span<const double> b);

}  // namespace lightloom::eval
