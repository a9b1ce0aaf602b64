#include "cli/eval/pareto.h"

#include <algorithm>
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

}  // namespace lightloom::eval
