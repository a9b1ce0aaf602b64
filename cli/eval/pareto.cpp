#include "cli/eval/pareto.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace lightloom::eval {

std::vector<size_t> pareto_front(const std::vector<Cost>& points) {
  std::vector<size_t> by_x(points.size());
  std::iota(by_x.begin(), by_x.end(), size_t{0});
  std::stable_sort(by_x.begin(), by_x.end(), [&](size_t a, size_t b) {
    return points[a].x != points[b].x ? points[a].x < points[b].x : points[a].error < points[b].error;
  });
  std::vector<size_t> front;
  double least = std::numeric_limits<double>::infinity();
  for (const size_t i : by_x) {
    const bool equal =
        !front.empty() && points[front.back()].x == points[i].x && points[front.back()].error == points[i].error;
    if (points[i].error >= least && !equal) continue;
    front.push_back(i);
    least = points[i].error;
  }
  return front;
}

std::optional<double> error_at(const std::vector<Cost>& front, double x) {
  for (size_t i = 0; i < front.size(); ++i) {
    if (front[i].x < x) continue;
    if (front[i].x == x) return front[i].error;
    if (i == 0) return std::nullopt;
    const Cost &a = front[i - 1], &b = front[i];
    return a.error * std::pow(b.error / a.error, std::log(x / a.x) / std::log(b.x / a.x));
  }
  return front.empty() ? std::nullopt : std::optional(front.back().error);
}

std::optional<double> cost_at(const std::vector<Cost>& front, double error) {
  std::vector<Cost> turned;
  for (auto it = front.rbegin(); it != front.rend(); ++it) turned.push_back({it->error, it->x});
  return error_at(turned, error);
}

}  // namespace lightloom::eval
