#include "core/probes/links.h"

#include <algorithm>
#include <cmath>

namespace lightloom {

std::array<int32_t, 3> probe_cell(Vec3 p, float spacing) {
  std::array<int32_t, 3> cell;
  for (int a = 0; a < 3; ++a) {
    cell[static_cast<size_t>(a)] = static_cast<int32_t>(std::floor(static_cast<double>(p[a]) / spacing));
  }
  return cell;
}

ProbeGrid::ProbeGrid(std::span<const Probe> probes, float spacing) : probes_(probes), spacing_(spacing) {}

std::vector<ProbeGrid::Near> ProbeGrid::nearest(Vec3 p, int count) const {
  const std::array<int32_t, 3> home = probe_cell(p, spacing_);
  std::vector<Near> found;
  const auto add_row = [&](int32_t x, int32_t y, int32_t z0, int32_t z1) {
    const auto key_less = [](const Probe& a, const std::array<int32_t, 3>& cell) { return a.cell < cell; };
    auto it = std::lower_bound(probes_.begin(), probes_.end(), std::array<int32_t, 3>{x, y, z0}, key_less);
    for (; it != probes_.end() && it->cell <= std::array<int32_t, 3>{x, y, z1}; ++it) {
      const Vec3 d = it->position - p;
      found.push_back({dot(d, d), static_cast<uint32_t>(it - probes_.begin())});
    }
  };
  for (int radius = 0; radius <= kReach; ++radius) {
    // Shell of cells at Chebyshev distance `radius`, row by row along z.
    for (int dx = -radius; dx <= radius; ++dx) {
      for (int dy = -radius; dy <= radius; ++dy) {
        const int32_t x = home[0] + dx, y = home[1] + dy;
        if (std::max(std::abs(dx), std::abs(dy)) == radius) {
          add_row(x, y, home[2] - radius, home[2] + radius);
        } else {
          add_row(x, y, home[2] - radius, home[2] - radius);
          add_row(x, y, home[2] + radius, home[2] + radius);
        }
      }
    }
    // Nothing in farther shells is nearer than `radius` cells.
    if (found.size() >= static_cast<size_t>(count)) {
      std::nth_element(found.begin(), found.begin() + (count - 1), found.end());
      const float reach = static_cast<float>(radius) * spacing_;
      if (found[static_cast<size_t>(count - 1)].distance2 <= reach * reach) break;
    }
  }
  std::sort(found.begin(), found.end());
  if (found.size() > static_cast<size_t>(count)) found.resize(static_cast<size_t>(count));
  return found;
}

std::vector<ProbeGrid::Near> ProbeGrid::within(Vec3 p, float radius) const {
  std::vector<Near> found;
  for (uint32_t i = 0; i < probes_.size(); ++i) {
    const Vec3 d = probes_[i].position - p;
    if (dot(d, d) <= radius * radius) found.push_back({dot(d, d), i});
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace lightloom
