// The probes to be relit in this frame: at most max_probes of those that saw a change, in turn, as one list per pool. One
// workgroup, so that the list's order is that of the slots.
#version 450
#include "layout.h"
#include "spread.h"

layout(push_constant) uniform Push { SelectProbesPush push; };
layout(std430, binding = 0) buffer Dirty { uint dirty[]; };
layout(std430, binding = 1) readonly buffer SlotTable { Slot slots[]; };
layout(std430, binding = 2) writeonly buffer Stamps { uint stamps[]; };
layout(std430, binding = 3) writeonly buffer Active { uint active_slots[]; };
layout(std430, binding = 4) buffer Shared { Control control; };
layout(std430, binding = 5) buffer Seen { uint seen[]; };  // the generation that was lit

shared uint wanted[kGroup];
shared uint in_pool[kMaxPools];
shared uint found, taken, next_cursor;

/// Slots [first, last), at most kGroup of them, all in one pool.
void scan(uint first, uint last) {
  const uint local = gl_LocalInvocationIndex;
  const uint slot = first + local;
  const bool is_dirty = slot < last && slots[slot].probe != kNoProbe && (dirty[slot] != 0u || seen[slot] != slots[slot].generation);
  wanted[local] = is_dirty ? 1u : 0u;
  barrier();
  uint before = 0u, total = 0u;
  for (uint n = 0; n < kGroup; ++n) {
    if (n < local) before += wanted[n];
    total += wanted[n];
  }
  const uint room = push.max_probes - taken;
  const uint pool = first / push.pool_slots;
  if (is_dirty && before < room) {
    active_slots[pool * push.pool_slots + in_pool[pool] + before] = slot - pool * push.pool_slots;
    dirty[slot] = 0u;
    seen[slot] = slots[slot].generation;
    stamps[slots[slot].probe] = push.frame;
    if (before + 1u == room) next_cursor = slot + 1u;
  }
  barrier();
  if (local == 0u) {
    found += total;
    taken += min(total, room);
    in_pool[pool] += min(total, room);
  }
  barrier();
}

void scan_range(uint first, uint last) {
  for (uint at = first; at < last;) {
    // Up to the next multiple of the granule, so that no pool boundary is crossed.
    const uint end = min(min(last, at + kGroup), (at / kSlotGranule + 1u) * kSlotGranule);
    scan(at, end);
    at = end;
  }
}

void main() {
  const uint local = gl_LocalInvocationIndex;
  for (uint p = local; p < kMaxPools; p += kGroup) in_pool[p] = 0u;
  const uint cursor = control.probe_cursor < push.slots ? control.probe_cursor : 0u;
  if (local == 0u) {
    found = 0u;
    taken = 0u;
    next_cursor = cursor;
  }
  barrier();
  scan_range(cursor, push.slots);
  scan_range(0u, cursor);

  for (uint p = local; p < kMaxPools; p += kGroup) {
    control.relight_count[p] = in_pool[p];
    control.relight[p] = spread((in_pool[p] + kRelightProbes - 1u) / kRelightProbes, push.max_groups);
  }
  if (local == 0u) {
    uint coarse = 0u;
    for (uint p = push.coarse_pool; p < kMaxPools; ++p) coarse += in_pool[p];
    control.coarse_probes = coarse;
    control.updated_probes = taken;
    control.waiting_probes = found - taken;
    control.probe_cursor = next_cursor;
    control.mark_cells = spread(taken > 0u || control.changed_tiles > 0u ? push.cell_groups : 0u, push.max_groups);
  }
}
