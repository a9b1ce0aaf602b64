// Which points no other one beats.
#pragma once

#include <cstddef>
#include <vector>

namespace lightloom::eval {

/// Both to be small.
struct Cost {
  double x = 0, error = 0;
};

/// a is nowhere worse than b, and somewhere better.
inline bool beats(Cost a, Cost b) { return a.x <= b.x && a.error <= b.error && (a.x < b.x || a.error < b.error); }

/// Indices of the points that no other beats, x ascending.
std::vector<size_t> pareto_front(const std::vector<Cost>& points);

}  // namespace lightloom::eval
