// Which probes saw a change: one workgroup per slot compares the tiles that its rays hit with those that changed.
#version 450
#include "layout.h"

layout(push_constant) uniform Push { MarkPush push; };
layout(std430, binding = 0) readonly buffer Pool { uint words[]; };
layout(std430, binding = 1) readonly buffer SlotTable { Slot slots[]; };
layout(std430, binding = 2) readonly buffer Changed { uint changed[]; };
layout(std430, binding = 3) buffer Dirty { uint dirty[]; };

void main() {
  const uint n = group_index();
  if (n >= push.slots || slots[push.first_slot + n].probe == kNoProbe) return;
  const uint tiles = n * push.slot_words + push.rays;
  uint seen = 0u;
  for (uint w = gl_LocalInvocationIndex; w < push.tile_words; w += kGroup) seen |= words[tiles + w] & changed[w];
  if (seen != 0u) atomicOr(dirty[push.first_slot + n], 1u);
}
