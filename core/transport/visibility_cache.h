// Whether probes see the surface of a texel: V_i of SL17 Eq. 2, asked once per texel and probe instead of once per ray.
//
// Neighbouring points see the same probes but for where a shadow's edge passes. So a texel is trusted where all of its
// sample points agree; where they do not, rays are traced for the very point. The sky is asked in the same way, by small
// sets of directions.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "core/receivers/layout.h"
#include "core/receivers/surface_point.h"
#include "core/receivers/texels.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

/// Thread-safe. Answers are pure functions of the arguments. The cache only remembers them, within `byte_budget`; beyond
/// it they are worked out anew each time. Keeps references to all arguments.
class VisibilityCache {
 public:
  static constexpr uint64_t kDefaultBudget = uint64_t{512} << 20;

  /// `grids` per object, as rasterise() gives them.
  VisibilityCache(const RayTracer& tracer, const AtlasLayout& layout, std::span<const TexelGrid> grids,
                  std::span<const Vec3> probes, uint64_t byte_budget = kDefaultBudget);
  ~VisibilityCache();
  VisibilityCache(const VisibilityCache&) = delete;
  VisibilityCache& operator=(const VisibilityCache&) = delete;

  /// Names a side of a texel.
  using Patch = uint32_t;
  static constexpr Patch kNoPatch = 0xffffffffu;
  /// The patch that the hit lies in; kNoPatch if the hit's surface has no texel, or one that stands for other surface.
  /// `reach`, if any, becomes a distance from the point, metres, within which lie all the points that the patch is asked by.
  Patch patch_of(const Hit& hit, const ShadingPoint& point, float* reach = nullptr);

  /// Of all sample points of a patch.
  enum Verdict : uint32_t { kUnknown, kHidden, kSeen, kSplit };
  /// Never kUnknown. Adds the rays that were traced to *rays; of an answer that is remembered, only the first time.
  Verdict find(Patch patch, uint32_t probe, uint64_t* rays);
  /// The same for the sky in the directions around `direction`, which is unit.
  Verdict find_sky(Vec3 direction, uint32_t probe, uint64_t* rays);

  uint64_t bytes() const { return bytes_.load(std::memory_order_relaxed); }

 private:
  static constexpr uint32_t kSamples = 4;
  struct Surface {
    Vec3 centre, normal;
    float reach2 = 0;                    ///< squared distance from the centre within which the patch lies
    std::array<Vec3, kSamples> samples;  ///< pushed off
  };
  /// Where an object's texels are, to find them by their place in its lightmap.
  struct Rows {
    Patch first = 0;  ///< patch of the front of texel 0; the back follows, then texel 1
    uint32_t first_row = 0;
    std::vector<uint32_t> begin;  ///< first texel of each row from first_row on, and the end
    std::vector<uint32_t> x;      ///< of each texel
  };
  static constexpr uint32_t kPagePatches = 64, kGroup = 16;
  using Surfaces = std::array<Surface, kPagePatches>;
  /// Verdicts of 16 probes, two bits each, per patch: what a hit asks about lies together.
  using Verdicts = std::array<std::atomic<uint32_t>, kPagePatches>;
  /// Verdicts of one probe on the cells of an octahedral map of directions.
  static constexpr uint32_t kSkySide = 64;
  using Sky = std::array<std::atomic<uint32_t>, kSkySide * kSkySide / kGroup>;

  template <class Trace>
  static Verdict remember(std::atomic<uint32_t>* word, uint32_t place, const Trace& trace, uint64_t* rays);
  template <class Page>
  Page* publish(std::atomic<Page*>* slot, Page* page);
  Surface make_surface(Patch patch) const;
  const Surface& surface(Patch patch, Surface* spare);
  Verdict trace(Patch patch, uint32_t probe, uint64_t* rays);
  Verdict trace_sky(uint32_t cell, uint32_t probe, uint64_t* rays) const;

  const RayTracer& tracer_;
  const AtlasLayout& layout_;
  std::span<const TexelGrid> grids_;
  std::span<const Vec3> probes_;
  uint64_t budget_;
  size_t groups_;
  std::vector<Rows> rows_;  // per object
  Patch patches_ = 0;
  std::vector<std::atomic<Surfaces*>> surfaces_;
  std::vector<std::atomic<Verdicts*>> verdicts_;
  std::vector<std::atomic<Sky*>> skies_;  // per probe
  std::atomic<uint64_t> bytes_{0};
};

}  // namespace lightloom
