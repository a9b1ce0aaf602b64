// Cells that read a probe which is relit in this frame, or have something in their near fields that has changed.
#version 450
#include "layout.h"

layout(push_constant) uniform Push { MarkCellsPush push; };
layout(std430, binding = 0) readonly buffer Cells { Cell cells[]; };
layout(std430, binding = 1) readonly buffer CellProbes { uint cell_probes[]; };
layout(std430, binding = 2) readonly buffer Stamps { uint stamps[]; };
layout(std430, binding = 3) buffer Dirty { uint cell_dirty[]; };
layout(std430, binding = 4) readonly buffer NearTiles { uint near_tiles[]; };  // a set of tiles per cell
layout(std430, binding = 5) readonly buffer Changed { uint changed[]; };

void main() {
  const uint c = invocation_index();
  if (c >= push.cells || cells[c].live == 0u || cell_dirty[c] != 0u) return;
  const uint first = cells[c].first_probe, count = cells[c].probes;
  uint relit = 0u;
  for (uint i = 0; i < count; ++i) relit += stamps[cell_probes[first + i]] == push.frame ? 1u : 0u;
  for (uint w = 0; w < push.tile_words && relit == 0u; ++w) relit |= near_tiles[c * push.tile_words + w] & changed[w];
  if (relit > 0u) cell_dirty[c] = 1u;
}
