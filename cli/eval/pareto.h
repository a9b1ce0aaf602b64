// Which points no other one beats.
#pragma once

#include <cstddef>
#include <optional>
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

/// The error of a front, points none of which beats another, x ascending, where it costs x: between neighbours, on a straight line in
/// logarithms. Beyond the last point its error, and none before the first.
std::optional<double> error_at(const std::vector<Cost>& front, double x);
/// Likewise what an error costs. Above the first point's error what that costs, and none below the last one's.
std::optional<double> cost_at(const std::vector<Cost>& front, double error);

}  // namespace lightloom::eval
