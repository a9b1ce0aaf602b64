#include "core/probes/voxels.h"

#include <algorithm>
#include <cmath>

#include "core/base/check.h"
#include "core/base/overlap.h"

namespace lightloom {
namespace {

constexpr int kMargin = 1;  // empty voxels around the level

int32_t voxels_along(const Aabb& bounds, int axis, float side) {
  return static_cast<int32_t>(std::floor((bounds.hi[axis] - bounds.lo[axis]) / side)) + 1 + 2 * kMargin;
}

}  // namespace

double Voxels::count_for(const Aabb& bounds, float side) {
  double count = 1;
  for (int a = 0; a < 3; ++a) {
    count *= std::floor((static_cast<double>(bounds.hi[a]) - bounds.lo[a]) / side) + 1 + 2 * kMargin;
  }
  return count;
}

Voxels::Voxels(const Scene& scene, float side) : side_(side) {
  const Aabb bounds = scene.bounds();
  LL_CHECK(count_for(bounds, side) <= kMost);
  origin_ = bounds.lo - Vec3{side, side, side} * static_cast<float>(kMargin);
  for (int a = 0; a < 3; ++a) size_[static_cast<size_t>(a)] = voxels_along(bounds, a, side);
  state_.assign(static_cast<size_t>(size_[0]) * static_cast<size_t>(size_[1]) * static_cast<size_t>(size_[2]), kEmpty);
  for (const Object& object : scene.objects) {
    if (!object.is_static) continue;
    for (const Triangle& t : object.triangles) {
      mark(object.positions[t.v[0]], object.positions[t.v[1]], object.positions[t.v[2]]);
    }
  }
}

Voxels::Index Voxels::index_of(Vec3 p) const {
  Index i;
  for (int a = 0; a < 3; ++a) {
    const float f = std::floor((p[a] - origin_[a]) / side_);
    i[static_cast<size_t>(a)] = static_cast<int32_t>(std::clamp(f, -1.0f, static_cast<float>(1 << 30)));
  }
  return i;
}

Vec3 Voxels::centre(Index i) const {
  return origin_ +
         Vec3{static_cast<float>(i[0]) + 0.5f, static_cast<float>(i[1]) + 0.5f, static_cast<float>(i[2]) + 0.5f} *
             side_;
}

size_t Voxels::at(Index i) const {
  return (static_cast<size_t>(i[0]) * static_cast<size_t>(size_[1]) + static_cast<size_t>(i[1])) *
             static_cast<size_t>(size_[2]) +
         static_cast<size_t>(i[2]);
}

bool Voxels::inside(Index i) const {
  for (size_t a = 0; a < 3; ++a) {
    if (i[a] < 0 || i[a] >= size_[a]) return false;
  }
  return true;
}

void Voxels::mark(Vec3 a, Vec3 b, Vec3 c) {
  Index lo, hi;
  for (int axis = 0; axis < 3; ++axis) {
    const auto [least, most] = std::minmax({a[axis], b[axis], c[axis]});
    const size_t n = static_cast<size_t>(axis);
    // A voxel more on each side: a triangle in the face between two voxels crosses both.
    lo[n] = std::max(0, static_cast<int32_t>(std::floor((least - origin_[axis]) / side_)) - 1);
    hi[n] = std::min(size_[n] - 1, static_cast<int32_t>(std::floor((most - origin_[axis]) / side_)) + 1);
  }
  const float half = 0.5f * side_ * 1.001f;  // errs towards surface: what floods must not leak
  for (int32_t x = lo[0]; x <= hi[0]; ++x) {
    for (int32_t y = lo[1]; y <= hi[1]; ++y) {
      for (int32_t z = lo[2]; z <= hi[2]; ++z) {
        uint8_t& state = state_[at({x, y, z})];
        if (state == kSurface) continue;
        const Vec3 m = centre({x, y, z});
        if (overlaps(a - m, b - m, c - m, half)) state = kSurface;
      }
    }
  }
}

bool Voxels::empty(Vec3 p) const {
  const Index i = index_of(p);
  return inside(i) && state_[at(i)] != kSurface;
}

void Voxels::flood(Vec3 p) {
  const Index start = index_of(p);
  if (!inside(start) || state_[at(start)] != kEmpty) return;
  std::vector<Index> front{start};
  state_[at(start)] = kConnected;
  while (!front.empty()) {
    const Index i = front.back();
    front.pop_back();
    for (size_t axis = 0; axis < 3; ++axis) {
      for (const int32_t step : {-1, 1}) {
        Index next = i;
        next[axis] += step;
        if (!inside(next) || state_[at(next)] != kEmpty) continue;
        state_[at(next)] = kConnected;
        front.push_back(next);
      }
    }
  }
}

std::vector<Vec3> Voxels::connected_near_surfaces() const {
  std::vector<Vec3> out;
  const auto near_surface = [&](Index i) {
    for (int32_t dx = -1; dx <= 1; ++dx) {
      for (int32_t dy = -1; dy <= 1; ++dy) {
        for (int32_t dz = -1; dz <= 1; ++dz) {
          const Index n{i[0] + dx, i[1] + dy, i[2] + dz};
          if (inside(n) && state_[at(n)] == kSurface) return true;
        }
      }
    }
    return false;
  };
  for (int32_t x = 0; x < size_[0]; ++x) {
    for (int32_t y = 0; y < size_[1]; ++y) {
      for (int32_t z = 0; z < size_[2]; ++z) {
        if (state_[at({x, y, z})] == kConnected && near_surface({x, y, z})) out.push_back(centre({x, y, z}));
      }
    }
  }
  return out;
}

}  // namespace lightloom
