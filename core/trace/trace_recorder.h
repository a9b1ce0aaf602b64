// Writes down where a task's rays go, at a small part of the cost of the rays.
//
// Rays are not followed one by one. Those that end in the same world cell, and start in the same one, are drawn at once, as
// the hull of where they start and where they end; and so are the rays by which a probe was asked whether it sees what is in
// a cell. A hull holds every segment between its boxes, so a trace may name too many cells, never too few.
#pragma once

#include <absl/container/flat_hash_map.h>

#include <cstdint>
#include <span>
#include <vector>

#include "core/trace/trace.h"

namespace lightloom {

class TraceRecorder {
 public:
  /// `probes`: how many can be asked.
  TraceRecorder(const WorldGrid& grid, size_t probes);

  /// Rays that follow start in the box, until it is said otherwise.
  void from(const Aabb& box);
  /// Where a ray went; REQUIRES: from().
  using Place = uint32_t;
  /// It ended at p, and what it found there was made of points up to `reach` metres from it.
  Place hit(Vec3 p, float reach);
  /// It left the level, towards `direction`.
  Place sky(Vec3 direction);
  /// The probe was asked whether it sees what the last ray to `place` found.
  void ask(Place place, uint32_t probe) { asked_[size_t{place} * words_ + probe / 64] |= uint64_t{1} << (probe % 64); }

  /// What was written down. `probes`: positions of those that were asked.
  Trace finish(std::span<const Vec3> probes);

 private:
  struct Seen {
    uint64_t where = 0;  ///< index of a cell of the grid, or of the map of directions
    uint32_t origin = 0;
    uint32_t rays = 0;
    float reach = 0;
  };
  /// A box that moves and changes its size evenly, in cells of the grid.
  struct Sweep {
    float lo[2][3], hi[2][3];  ///< at the start and at the end
  };

  Place count(uint64_t where);
  Aabb box_of(const Seen& seen, float reach) const;
  void draw(const Aabb& from, const Aabb& to, uint32_t rays);
  void draw(const Sweep& sweep, uint32_t rays);

  WorldGrid grid_;
  size_t words_;                     // of asked_, per place
  Vec3 corner_;                      // of the grid
  float side_, per_metre_, margin_;  // of a cell, metres
  std::vector<Aabb> origins_;
  absl::flat_hash_map<uint64_t, uint32_t> origin_of_;  // by the world cell of the box's middle
  uint32_t origin_ = 0;
  absl::flat_hash_map<uint64_t, Place> place_of_;
  std::vector<Seen> places_;
  std::vector<uint64_t> asked_;
  std::vector<uint64_t> crossed_;  // rays, per cell
  bool left_grid_ = false;         // something was drawn that is not all in the grid
};

}  // namespace lightloom
