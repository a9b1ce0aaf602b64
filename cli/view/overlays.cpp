#include "cli/view/overlays.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "core/asset/asset.h"

namespace lightloom::view {
namespace {

using renderer::Marks;
using renderer::Rgba;

constexpr uint8_t kTint = 110, kLine = 230;
constexpr float kOffSurface = 0.004f;  // metres: tints lie on their surface, not in it

/// A square on every element that `colour` gives a colour.
template <class Colour>
void tint(const SurfaceElements& elements, const ElementOwners& owners, const Colour& colour, Marks* marks) {
  for (size_t i = 0; i < elements.receivers.all.size(); ++i) {
    const Receiver& r = elements.receivers.all[i];
    const Rgba c = colour(i);
    if (c[3] == 0) continue;
    const Vec3 normal = r.point.geometric;
    marks->square(r.point.position + normal * kOffSurface, normal, owners.half[i], c);
  }
}

Rgba stale_colour(const CellEntry& cell, float worst, uint8_t alpha) {
  if (!(cell.stale > 0)) return {60, 200, 90, alpha};
  return heat(0.75f + 0.25f * cell.stale / worst, alpha);
}

void add_cells(const Manifest& manifest, const SurfaceElements& elements, const ElementOwners& owners, Marks* marks) {
  for (uint32_t c = 0; c < manifest.cells.size(); ++c) marks->box(manifest.cells[c].bounds, distinct(c, kLine));
  tint(
      elements, owners,
      [&](size_t i) { return owners.cell[i] == ElementOwners::kNone ? Rgba{} : distinct(owners.cell[i], kTint); },
      marks);
}

void add_ranks(const Manifest& manifest, const SurfaceElements& elements, const ElementOwners& owners, Marks* marks) {
  const float greatest = std::max(1.0f, static_cast<float>(manifest.params.max_rank));
  tint(
      elements, owners,
      [&](size_t i) {
        if (owners.cluster[i] == ElementOwners::kNone) return Rgba{};
        return heat(static_cast<float>(manifest.clusters[owners.cluster[i]].rank) / greatest, kTint + 40);
      },
      marks);
}

void add_probes(const Manifest& manifest, Marks* marks) {
  const float radius = std::clamp(manifest.params.spacing * 0.04f, 0.02f, 0.1f);
  for (const ProbeEntry& probe : manifest.probes) marks->octahedron(probe.position, radius, {255, 150, 40, 255});
}

void add_stale(const Manifest& manifest, const SurfaceElements& elements, const ElementOwners& owners, Marks* marks) {
  float worst = 0;
  for (const CellEntry& cell : manifest.cells) worst = std::max(worst, cell.stale);
  for (const CellEntry& cell : manifest.cells) marks->box(cell.bounds, stale_colour(cell, worst, kLine));
  tint(
      elements, owners,
      [&](size_t i) {
        if (owners.cell[i] == ElementOwners::kNone) return Rgba{};
        return stale_colour(manifest.cells[owners.cell[i]], worst, kTint);
      },
      marks);
}

void add_residency(const Manifest& manifest, const SurfaceElements& elements, const ElementOwners& owners,
                   const std::vector<uint8_t>& levels, Marks* marks) {
  const auto colour = [&](uint32_t cell, uint8_t alpha) -> Rgba {
    constexpr std::array<uint8_t, 3> kColours[] = {{120, 120, 120}, {230, 50, 40}, {240, 200, 40}, {60, 200, 90}};
    const auto& c = kColours[std::min<size_t>(levels[cell], 3)];
    return {c[0], c[1], c[2], alpha};
  };
  for (uint32_t c = 0; c < manifest.cells.size(); ++c) marks->box(manifest.cells[c].bounds, colour(c, kLine));
  tint(
      elements, owners,
      [&](size_t i) { return owners.cell[i] == ElementOwners::kNone ? Rgba{} : colour(owners.cell[i], kTint); }, marks);
}

/// The element of each (object, texel key) that a cell chunk names, and the cluster of each.
void assign(const Manifest& manifest, uint32_t cell, const CellChunk& chunk,
            const std::map<Digest, uint32_t>& scene_object, const Receivers& receivers, ElementOwners* owners) {
  for (uint32_t k = 0; k < chunk.clusters.size(); ++k) {
    const CellChunk::Cluster& cluster = chunk.clusters[k];
    for (uint32_t r = cluster.first_receiver; r < cluster.first_receiver + cluster.receivers; ++r) {
      const TexelRef ref = chunk.receivers[r];
      const auto object = scene_object.find(chunk.objects[ref.slot].id);
      if (object == scene_object.end()) continue;
      const uint32_t element = receivers.find(object->second, ref.key);
      if (element == Receivers::kNone) continue;
      owners->cell[element] = cell;
      owners->cluster[element] = manifest.cells[cell].first_cluster + k;
    }
  }
}

}  // namespace

absl::StatusOr<ElementOwners> find_owners(const std::filesystem::path& loom, const Manifest& manifest,
                                          const Scene& scene, const SurfaceElements& elements) {
  std::map<Digest, uint32_t> scene_object;
  for (uint32_t o = 0; o < elements.receivers.ranges.size(); ++o) scene_object[scene.objects[o].id] = o;
  ElementOwners owners;
  owners.cell.assign(elements.receivers.all.size(), ElementOwners::kNone);
  owners.cluster = owners.cell;
  const ChunkStore store = chunk_store(loom);
  for (const ObjectEntry& object : manifest.objects) {
    if (object.surface.size == 0) continue;
    LL_ASSIGN_OR_RETURN(const auto bytes, store.get(object.surface));
    LL_ASSIGN_OR_RETURN(const SurfaceChunk surface, decode_surface(bytes));
    for (const float area : surface.areas) owners.half.push_back(0.48f * std::sqrt(area));
  }
  owners.half.resize(elements.receivers.all.size());
  for (uint32_t c = 0; c < manifest.cells.size(); ++c) {
    LL_ASSIGN_OR_RETURN(const auto bytes, store.get(manifest.cells[c].chunk));
    LL_ASSIGN_OR_RETURN(const CellChunk chunk, decode_cell(bytes));
    assign(manifest, c, chunk, scene_object, elements.receivers, &owners);
  }
  return owners;
}

Rgba heat(float share, uint8_t alpha) {
  const float at = std::clamp(share, 0.0f, 1.0f) * 4;
  const auto ramp = [&](float centre) {
    return static_cast<uint8_t>(255 * std::clamp(2 - std::abs(at - centre), 0.0f, 1.0f));
  };
  return {ramp(4), ramp(2), ramp(0), alpha};
}

Rgba distinct(uint32_t number, uint8_t alpha) {
  // Golden ratio steps around the circle of hues.
  const float hue = std::fmod(static_cast<float>(number) * 0.61803399f, 1.0f) * 6;
  const auto channel = [&](float shift) {
    const float x = std::fmod(hue + shift, 6.0f);
    return static_cast<uint8_t>(40 + 215 * std::clamp(std::abs(x - 3) - 1, 0.0f, 1.0f));
  };
  return {channel(0), channel(4), channel(2), alpha};
}

Marks overlay_marks(const std::set<std::string>& shown, const Manifest& manifest, const SurfaceElements& elements,
                    const ElementOwners& owners, const std::vector<uint8_t>& levels) {
  Marks marks;
  if (shown.count("cells") > 0) add_cells(manifest, elements, owners, &marks);
  if (shown.count("ranks") > 0) add_ranks(manifest, elements, owners, &marks);
  if (shown.count("stale") > 0) add_stale(manifest, elements, owners, &marks);
  if (shown.count("residency") > 0) add_residency(manifest, elements, owners, levels, &marks);
  if (shown.count("probes") > 0) add_probes(manifest, &marks);
  return marks;
}

}  // namespace lightloom::view
