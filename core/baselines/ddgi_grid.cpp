// Majercik, Marrs, Spjut, McGuire, "Scaling Probe-Based Real-Time Dynamic Global Illumination for Production", JCGT
// 10(2), 2021 (probe position adjustment, probe states); constants as in the authors' RTXGI-DDGI SDK
// (ProbeRelocationCS, ProbeClassificationCS).
#include "core/baselines/ddgi_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/base/sh.h"

namespace lightloom {
namespace {

constexpr uint32_t kRays = 256;  // RTXGI: 32
constexpr float kBackShare = 0.25f;
constexpr float kFarthest = 0.45f;  // of the spacing
constexpr int kRounds = 5;          // the paper's frames of initialisation

struct Seen {
  float distance;
  Vec3 direction;
};

struct Surroundings {
  Seen nearest_back{std::numeric_limits<float>::infinity(), {}};
  Seen nearest_front{std::numeric_limits<float>::infinity(), {}};
  Seen farthest_front{0, {}};
  uint32_t backs = 0;

  bool solid() const { return static_cast<float>(backs) > kBackShare * kRays; }
};

Surroundings look_around(const RayTracer& tracer, Vec3 p) {
  Surroundings s;
  for (uint32_t i = 0; i < kRays; ++i) {
    const Vec3 direction = sphere_direction(i, kRays);
    const Hit hit = tracer.closest(p, direction);
    if (hit && hit.back) {
      ++s.backs;
      if (hit.t < s.nearest_back.distance) s.nearest_back = {hit.t, direction};
    } else {
      if (hit.t < s.nearest_front.distance) s.nearest_front = {hit.t, direction};
      if (hit.t > s.farthest_front.distance) s.farthest_front = {hit.t, direction};
    }
  }
  return s;
}

/// Where a probe goes from here.
Vec3 next_offset(const Surroundings& s, Vec3 offset, float clearance) {
  if (s.solid()) return offset + s.nearest_back.direction * (s.nearest_back.distance + 0.5f * clearance);
  const float front = s.nearest_front.distance;
  if (front < clearance) {
    // Not if the way to the most distant surface leads towards the nearest one. RTXGI steps one unit of the scene.
    if (dot(s.nearest_front.direction, s.farthest_front.direction) > 0) return offset;
    return offset + s.farthest_front.direction * std::min(s.farthest_front.distance, clearance);
  }
  // As far back as there is room.
  const float far = length(offset);
  return far > 0 ? offset * (1 - std::min(front - clearance, far) / far) : offset;
}

}  // namespace

Vec3 DdgiGrid::rest(uint32_t probe) const {
  const uint32_t z = probe % counts[2], column = probe / counts[2];
  const uint32_t y = column % counts[1], x = column / counts[1];
  const Vec3 at{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
  return origin + spacing * at;
}

DdgiGrid::Cage DdgiGrid::cage(Vec3 p) const {
  Cage cage;
  for (int a = 0; a < 3; ++a) {
    const uint32_t n = counts[static_cast<size_t>(a)];
    const float at = std::clamp((p[a] - origin[a]) / spacing[a], 0.0f, static_cast<float>(n - 1));
    const uint32_t cell = std::min(static_cast<uint32_t>(at), n > 1 ? n - 2 : 0);
    cage.base = cage.base * n + cell;
    cage.alpha[a] = at - static_cast<float>(cell);
  }
  return cage;
}

std::array<uint32_t, 8> DdgiGrid::corners() const {
  const std::array<uint32_t, 3> step{counts[0] > 1 ? counts[1] * counts[2] : 0, counts[1] > 1 ? counts[2] : 0,
                                     counts[2] > 1 ? 1u : 0u};
  std::array<uint32_t, 8> out{};
  for (uint32_t c = 0; c < 8; ++c) {
    for (uint32_t a = 0; a < 3; ++a) out[c] += (c >> a & 1) * step[a];
  }
  return out;
}

absl::StatusOr<DdgiGrid> make_ddgi_grid(const Aabb& box, float spacing, bool enclose) {
  constexpr double kMost = 1 << 20;
  DdgiGrid grid;
  double probes = 1;
  for (int a = 0; a < 3; ++a) {
    const float size = box.size()[a];
    const float cells = enclose ? std::floor(size / spacing) + 1 : std::max(std::round(size / spacing), 0.0f);
    const bool around = enclose || cells == 0;
    const float planes = enclose ? cells + 1 : cells == 0 ? 2 : cells;
    probes *= static_cast<double>(planes);
    if (!(probes <= kMost)) {
      return absl::InvalidArgumentError("DDGI: a spacing of " + std::to_string(spacing) +
                                        " m gives this level more than " + std::to_string(static_cast<int>(kMost)) +
                                        " probes; make it larger");
    }
    grid.counts[static_cast<size_t>(a)] = static_cast<uint32_t>(planes);
    grid.spacing[a] = around ? spacing : size / cells;
    grid.origin[a] = box.center()[a] - 0.5f * (planes - 1) * grid.spacing[a];
  }
  return grid;
}

DdgiProbe place_ddgi_probe(const RayTracer& tracer, Vec3 rest, Vec3 spacing, float clearance) {
  Vec3 offset;
  Surroundings s = look_around(tracer, rest);
  const float metres = clearance * std::min({spacing.x, spacing.y, spacing.z});
  for (int round = 0; clearance > 0 && round < kRounds; ++round) {
    const Vec3 next = next_offset(s, offset, metres);
    const Vec3 share{next.x / spacing.x, next.y / spacing.y, next.z / spacing.z};
    if (!(dot(share, share) < kFarthest * kFarthest) || next == offset) break;
    offset = next;
    s = look_around(tracer, rest + offset);
  }
  return {rest + offset, !s.solid()};
}

}  // namespace lightloom
