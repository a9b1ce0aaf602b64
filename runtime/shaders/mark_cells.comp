// Cells that read a probe which is relit in this frame.
#version 450
#include "layout.h"

layout(push_constant) uniform Push { MarkCellsPush push; };
layout(std430, binding = 0) readonly buffer Cells { Cell cells[]; };
layout(std430, binding = 1) readonly buffer CellProbes { uint cell_probes[]; };
layout(std430, binding = 2) readonly buffer Stamps { uint stamps[]; };
layout(std430, binding = 3) buffer Dirty { uint cell_dirty[]; };

void main() {
  const uint c = invocation_index();
  if (c >= push.cells || cells[c].live == 0u || cell_dirty[c] != 0u) return;
  for (uint i = 0; i < cells[c].probes; ++i) {
    if (stamps[cell_probes[cells[c].first_probe + i]] == push.frame) {
      cell_dirty[c] = 1u;
      return;
    }
  }
}
