// What the viewer draws over the picture: how the level was baked.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "core/asset/manifest.h"
#include "core/relight/surface_inputs.h"
#include "runtime/renderer/lines.h"

namespace lightloom::view {

/// Per surface element: the cell and the cluster (both indices into the manifest) that light it, or kNone; half the side
/// of a square of its area, metres.
struct ElementOwners {
  static constexpr uint32_t kNone = 0xffffffffu;
  std::vector<uint32_t> cell, cluster;
  std::vector<float> half;
};
/// Reads every cell and surface chunk.
absl::StatusOr<ElementOwners> find_owners(const std::filesystem::path& loom, const Manifest& manifest,
                                          const Scene& scene, const SurfaceElements& elements);

/// Blue over green and yellow to red for 0 to 1.
renderer::Rgba heat(float share, uint8_t alpha);
/// A colour of its own for each number, neighbours far apart.
renderer::Rgba distinct(uint32_t number, uint8_t alpha);

/// `shown`: of kOverlays; those of other kinds are passed over. `levels`: LiveRuntime::cell_levels.
///   cells   boxes of the bake cells' receivers and the surfaces they light, a colour each
///   ranks   surfaces by the rank of their cluster, blue 0 to red the greatest rank of the bake
///   probes  where they stand
///   residency   boxes of the cells and their surfaces by `levels`: grey nothing, red the base, yellow some, green all
///   stale   surfaces and boxes of cells that a bake with a tolerance kept (red: more), fresh ones green
renderer::Marks overlay_marks(const std::set<std::string>& shown, const Manifest& manifest,
                              const SurfaceElements& elements, const ElementOwners& owners,
                              const std::vector<uint8_t>& levels);

}  // namespace lightloom::view
