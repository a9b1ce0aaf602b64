// The smallest rectangle around a convex polygon has a side along one of its edges: Freeman & Shapira,
// "Determining the Minimum-Area Encasing Rectangle for an Arbitrary Closed Curve", CACM 18(7), 1975. Convex
// hull: Andrew, "Another Efficient Algorithm for Convex Hulls in Two Dimensions", IPL 9(5), 1979.
#include "core/receivers/flatten.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

namespace lightloom {
namespace {

// Charts that fill less of their rectangle are worth a seam, if the cut saves this much.
constexpr double kPoorFill = 0.55, kWorthwhile = 0.8;
constexpr double kSmallRectangle = 64;  // texels; smaller ones are left whole
// Work limit, in visits per triangle. Beyond it, what is left becomes one chart per triangle: only meshes
// made of hundreds of coincident layers get there.
constexpr uint64_t kVisits = 32;

struct Point {
  double x = 0, y = 0;
};
using FlatTriangle = std::array<Point, 3>;

struct Box {
  Point lo{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  Point hi{-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};

  void extend(const FlatTriangle& t) {
    for (const Point& p : t) {
      lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)};
      hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
    }
  }
  double width() const { return hi.x - lo.x; }
  double height() const { return hi.y - lo.y; }
  /// With a gutter of one texel, as packing sees it.
  double cost() const { return (width() + 1) * (height() + 1); }
};

double cross(Point o, Point a, Point b) { return (a.x - o.x) * (b.y - o.y) - (a.y - o.y) * (b.x - o.x); }

std::vector<FlatTriangle> project(const Object& object, const Chart& chart, double scale) {
  Vec3 s, t;
  orthonormal_basis(chart.axis, &s, &t);
  const Vec3 origin = object.positions[object.triangles[chart.triangles[0]].v[0]];
  std::vector<FlatTriangle> flat(chart.triangles.size());
  for (size_t i = 0; i < flat.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) {
      const Vec3 p = object.positions[object.triangles[chart.triangles[i]].v[k]];
      const double x = double{p.x} - origin.x, y = double{p.y} - origin.y, z = double{p.z} - origin.z;
      flat[i][k] = {scale * (x * s.x + y * s.y + z * s.z), scale * (x * t.x + y * t.y + z * t.z)};
    }
  }
  return flat;
}

std::vector<Point> convex_hull(const std::vector<FlatTriangle>& flat) {
  std::vector<Point> points;
  points.reserve(3 * flat.size());
  for (const FlatTriangle& t : flat) points.insert(points.end(), t.begin(), t.end());
  const auto less = [](Point a, Point b) { return a.x != b.x ? a.x < b.x : a.y < b.y; };
  const auto equal = [](Point a, Point b) { return a.x == b.x && a.y == b.y; };
  std::sort(points.begin(), points.end(), less);
  points.erase(std::unique(points.begin(), points.end(), equal), points.end());
  std::vector<Point> hull;
  for (int side = 0; side < 2; ++side) {
    const size_t start = hull.size();
    for (const Point& p : points) {
      while (hull.size() >= start + 2 && cross(hull[hull.size() - 2], hull.back(), p) <= 0) hull.pop_back();
      hull.push_back(p);
    }
    hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

/// Turns the chart so that its smallest rectangle is upright and wider than high, and moves that to the
/// origin.
Box stand_upright(std::vector<FlatTriangle>* flat) {
  const std::vector<Point> hull = convex_hull(*flat);
  const size_t stride = 1 + hull.size() / 256;  // a hull this round has no edge that matters
  Point best{1, 0};
  double best_area = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < hull.size(); i += stride) {
    const Point a = hull[i], b = hull[(i + 1) % hull.size()];
    const double l = std::sqrt((b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y));
    if (!(l > 0)) continue;
    const Point d{(b.x - a.x) / l, (b.y - a.y) / l};
    Box box;
    for (const Point& p : hull) {
      const Point q{d.x * p.x + d.y * p.y, d.x * p.y - d.y * p.x};
      box.extend({q, q, q});
    }
    // Rounding must not decide between equal rectangles.
    if (box.width() * box.height() < best_area * (1 - 1e-9)) {
      best_area = box.width() * box.height();
      best = box.width() >= box.height() ? d : Point{-d.y, d.x};
    }
  }
  Box box;
  for (FlatTriangle& t : *flat) {
    for (Point& p : t) p = {best.x * p.x + best.y * p.y, best.x * p.y - best.y * p.x};
    box.extend(t);
  }
  for (FlatTriangle& t : *flat) {
    for (Point& p : t) p = {p.x - box.lo.x, p.y - box.lo.y};
  }
  return {{0, 0}, {box.width(), box.height()}};
}

/// Which triangles lie beyond the straight cut that leaves the smallest two rectangles; empty if no cut is
/// worth it.
std::vector<bool> find_cut(const std::vector<FlatTriangle>& flat, const Box& box) {
  double area = 0;
  for (const FlatTriangle& t : flat) area += 0.5 * std::abs(cross(t[0], t[1], t[2]));
  const double rectangle = box.width() * box.height();
  if (flat.size() < 2 || rectangle < kSmallRectangle || area > kPoorFill * rectangle) return {};

  constexpr int kPlaces = 8;
  const auto beyond = [&](const FlatTriangle& t, int axis, int place) {
    return axis == 0 ? t[0].x + t[1].x + t[2].x > 3 * box.width() * place / kPlaces
                     : t[0].y + t[1].y + t[2].y > 3 * box.height() * place / kPlaces;
  };
  double best_cost = kWorthwhile * box.cost();
  int best_axis = 0, best_place = 0;
  for (int axis = 0; axis < 2; ++axis) {
    for (int place = 1; place < kPlaces; ++place) {
      Box near, far;
      for (const FlatTriangle& t : flat) (beyond(t, axis, place) ? far : near).extend(t);
      if (near.width() < 0 || far.width() < 0) continue;
      if (near.cost() + far.cost() < best_cost) {
        best_cost = near.cost() + far.cost();
        best_axis = axis;
        best_place = place;
      }
    }
  }
  if (best_place == 0) return {};
  std::vector<bool> cut(flat.size());
  for (size_t i = 0; i < flat.size(); ++i) cut[i] = beyond(flat[i], best_axis, best_place);
  return cut;
}

int32_t to_grid(double texels) { return static_cast<int32_t>(std::floor(texels * kGrid + 0.5)); }

/// Stretches the rectangle to whole texels and rounds corners to the grid. A flat rectangle fills its texels
/// whole.
void snap(const std::vector<FlatTriangle>& flat, const Box& box, FlatChart* chart) {
  const auto whole = [](double extent) { return std::max(1.0, std::floor(extent + 0.5)); };
  const double w = whole(box.width()), h = whole(box.height());
  const double sx = box.width() > 0 ? w / box.width() : 0, sy = box.height() > 0 ? h / box.height() : 0;
  chart->width = static_cast<int>(w);
  chart->height = static_cast<int>(h);
  chart->corners.resize(flat.size());
  for (size_t i = 0; i < flat.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) {
      chart->corners[i][k] = {std::clamp(to_grid(flat[i][k].x * sx), 0, chart->width * kGrid),
                              std::clamp(to_grid(flat[i][k].y * sy), 0, chart->height * kGrid)};
    }
  }
}

/// Removes triangles that overlap an earlier one of the chart and returns them, in order. Samples lie finer
/// than texels, texel centres among them; those within a hair of an edge are left out so that rounded
/// T-junctions are not taken for overlap.
std::vector<uint32_t> remove_overlap(FlatChart* chart) {
  int32_t fineness = 4;
  const auto columns = [&] { return static_cast<size_t>(chart->width * fineness + 1); };
  const auto rows = [&] { return static_cast<size_t>(chart->height * fineness + 1); };
  while (fineness > 2 && columns() * rows() > (size_t{1} << 26)) fineness /= 2;
  const SampleLattice lattice{kGrid / fineness, 0};
  constexpr int32_t kHair = kGrid / 64;

  std::vector<bool> owned(columns() * rows());
  const auto sample = [&](int j, int i) { return static_cast<size_t>(j) * columns() + static_cast<size_t>(i); };
  std::vector<uint32_t> removed;
  size_t kept = 0;
  for (size_t n = 0; n < chart->triangles.size(); ++n) {
    bool free = true;
    rasterise(chart->corners[n], lattice, kHair, [&](int j, int first, int last) {
      for (int i = first; free && i <= last; ++i) free = !owned[sample(j, i)];
      return free;
    });
    if (!free) {
      removed.push_back(chart->triangles[n]);
      continue;
    }
    rasterise(chart->corners[n], lattice, kHair, [&](int j, int first, int last) {
      for (int i = first; i <= last; ++i) owned[sample(j, i)] = true;
      return true;
    });
    chart->triangles[kept] = chart->triangles[n];
    chart->corners[kept++] = chart->corners[n];
  }
  chart->triangles.resize(kept);
  chart->corners.resize(kept);
  return removed;
}

/// Shrinks the rectangle to the texels that are left.
void crop(FlatChart* chart) {
  GridPoint lo = chart->corners[0][0], hi = lo;
  for (const GridTriangle& t : chart->corners) {
    for (const GridPoint& p : t) {
      lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)};
      hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
    }
  }
  const GridPoint shift{lo.x / kGrid * kGrid, lo.y / kGrid * kGrid};
  for (GridTriangle& t : chart->corners) {
    for (GridPoint& p : t) p = {p.x - shift.x, p.y - shift.y};
  }
  chart->width = std::max(1, (hi.x - shift.x + kGrid - 1) / kGrid);
  chart->height = std::max(1, (hi.y - shift.y + kGrid - 1) / kGrid);
}

/// Maps a chart of one texel so that its largest triangle holds the texel's centre and all stays within the
/// texel.
void centre_in_texel(const std::vector<FlatTriangle>& flat, FlatChart* chart) {
  const auto area = [](const FlatTriangle& t) { return std::abs(cross(t[0], t[1], t[2])); };
  const FlatTriangle largest =
      *std::max_element(flat.begin(), flat.end(), [&](const auto& a, const auto& b) { return area(a) < area(b); });
  const Point c{(largest[0].x + largest[1].x + largest[2].x) / 3, (largest[0].y + largest[1].y + largest[2].y) / 3};
  double rx = 0, ry = 0;
  for (const FlatTriangle& t : flat) {
    for (const Point& p : t) {
      rx = std::max(rx, std::abs(p.x - c.x));
      ry = std::max(ry, std::abs(p.y - c.y));
    }
  }
  if (!(rx > 0) || !(ry > 0)) return;
  for (size_t i = 0; i < flat.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) {
      chart->corners[i][k] = {to_grid(0.5 + 0.5 * (flat[i][k].x - c.x) / rx),
                              to_grid(0.5 + 0.5 * (flat[i][k].y - c.y) / ry)};
    }
  }
}

/// Moves a chart by less than a texel so that its largest triangle holds a texel centre.
void shift_onto_centre(FlatChart* chart) {
  const GridTriangle largest = *std::max_element(
      chart->corners.begin(), chart->corners.end(),
      [](const GridTriangle& a, const GridTriangle& b) { return std::abs(twice_area(a)) < std::abs(twice_area(b)); });
  const auto to_centre = [](int32_t sum) { return (kGrid + kGrid / 2 - (sum / 3) % kGrid) % kGrid; };
  const GridPoint shift{to_centre(largest[0].x + largest[1].x + largest[2].x),
                        to_centre(largest[0].y + largest[1].y + largest[2].y)};
  for (GridTriangle& t : chart->corners) {
    for (GridPoint& p : t) p = {p.x + shift.x, p.y + shift.y};
  }
}

/// Gives a chart that lies between texel centres one of them: without it, it would receive nothing.
void cover_a_centre(const std::vector<FlatTriangle>& flat, FlatChart* chart) {
  // Between two triangles a centre on the edge is well covered, at the border of one it is not.
  const int32_t margin = chart->corners.size() == 1 ? 1 : 0;
  bool covered = false;
  for (size_t i = 0; i < chart->corners.size() && !covered; ++i) {
    rasterise(chart->corners[i], {}, margin, [&](int, int, int) {
      covered = true;
      return false;
    });
  }
  if (covered) return;
  if (chart->width == 1 && chart->height == 1 && flat.size() == chart->triangles.size()) {
    centre_in_texel(flat, chart);
  } else {
    shift_onto_centre(chart);
    crop(chart);
  }
}

}  // namespace

absl::StatusOr<std::vector<FlatChart>> flatten_charts(const Object& object, const MeshTopology& mesh,
                                                      std::vector<Chart> charts, double texels_per_metre,
                                                      int max_size) {
  std::deque<Chart> queue(std::make_move_iterator(charts.begin()), std::make_move_iterator(charts.end()));
  std::vector<uint32_t> label(mesh.area.size(), MeshTopology::kNone);
  const uint64_t limit = kVisits * mesh.area.size();
  uint64_t visits = 0;
  std::vector<FlatChart> done;
  while (!queue.empty()) {
    Chart chart = std::move(queue.front());
    queue.pop_front();
    visits += chart.triangles.size();
    const auto requeue = [&](const std::vector<uint32_t>& triangles) {
      for (std::vector<uint32_t>& part : connected_components(mesh, triangles, &label)) {
        if (visits <= limit) {
          queue.push_back({std::move(part), chart.axis});
        } else {
          for (uint32_t t : part) queue.push_back({{t}, mesh.normal[t]});
        }
      }
    };

    std::vector<FlatTriangle> flat = project(object, chart, texels_per_metre);
    const Box box = stand_upright(&flat);
    if (!(std::max(box.width(), box.height()) <= max_size)) {
      return absl::InvalidArgumentError(absl::StrCat("object '", object.name, "': a lightmap chart would be ",
                                                     box.width(), " texels long, over ", max_size,
                                                     "; lower the texels per metre or the object's texel scale"));
    }
    if (const std::vector<bool> cut = find_cut(flat, box); !cut.empty()) {
      std::vector<uint32_t> near, far;
      for (size_t i = 0; i < cut.size(); ++i) (cut[i] ? far : near).push_back(chart.triangles[i]);
      requeue(near);
      requeue(far);
      continue;
    }

    FlatChart result;
    result.triangles = chart.triangles;
    snap(flat, box, &result);
    requeue(remove_overlap(&result));
    crop(&result);
    cover_a_centre(flat, &result);
    done.push_back(std::move(result));
  }
  return done;
}

}  // namespace lightloom
