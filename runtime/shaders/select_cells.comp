// The cells whose E is computed in this frame: at most max_cells of those that mark_cells.comp has marked, in turn, as one list per
// pool with the workgroups that each one needs. One workgroup, so that the lists' order is that of the cells.
#version 450
#include "layout.h"
#include "spread.h"

layout(push_constant) uniform Push { SelectCellsPush push; };
layout(std430, binding = 0) readonly buffer Cells { Cell cells[]; };
layout(std430, binding = 1) readonly buffer CellProbes { uint cell_probes[]; };
layout(std430, binding = 2) readonly buffer Stamps { uint stamps[]; };
layout(std430, binding = 3) coherent buffer Dirty { uint cell_dirty[]; };  // 1: to be updated; 2 + pool: chosen
layout(std430, binding = 4) writeonly buffer Active { ActiveCell active_cells[]; };
layout(std430, binding = 5) buffer Shared { Control control; };
layout(std430, binding = 6) buffer Seen { uint seen[]; };  // the Cell::live that was computed

const uint kNoPool = 0xffffffffu;

shared uint wanted[kGroup], pools[kGroup], jobs[kGroup], groups[kGroup];
shared uint entries_of[kMaxPools], first_of[kMaxPools], jobs_of[kMaxPools], groups_of[kMaxPools];
shared uint found, taken, next_cursor, project_quads, receive_quads;

/// Not before each of its probes has been lit once.
bool ready(uint c) {
  const uint first = cells[c].first_probe, count = cells[c].probes;
  uint dark = 0u;
  for (uint i = 0; i < count; ++i) dark += stamps[cell_probes[first + i]] == 0u ? 1u : 0u;
  return dark == 0u;
}

/// Chooses among cells [first, last), at most kGroup of them.
void choose(uint first, uint last) {
  const uint local = gl_LocalInvocationIndex;
  const uint c = first + local;
  const bool is_dirty = c < last && cells[c].live != 0u && (cell_dirty[c] == 1u || seen[c] != cells[c].live) && ready(c);
  wanted[local] = is_dirty ? 1u : 0u;
  barrier();
  uint before = 0u, total = 0u;
  for (uint n = 0; n < kGroup; ++n) {
    if (n < local) before += wanted[n];
    total += wanted[n];
  }
  const uint room = push.max_cells - taken;
  if (is_dirty && before < room) {
    // Computed before, by another model of the cell or of a probe.
    const bool fades = seen[c] != 0u && seen[c] != cells[c].live;
    cell_dirty[c] = (2u + cells[c].pool) | (fades ? kFades : 0u);
    seen[c] = cells[c].live;
    atomicAdd(entries_of[cells[c].pool], 1u);
    atomicAdd(project_quads, cells[c].project_quads);
    atomicAdd(receive_quads, cells[c].receive_quads);
    if (before + 1u == room) next_cursor = c + 1u;
  }
  barrier();
  if (local == 0u) {
    found += total;
    taken += min(total, room);
  }
  barrier();
}

/// Appends the chosen of cells [first, first + kGroup) to the lists.
void append(uint first) {
  const uint local = gl_LocalInvocationIndex;
  const uint c = first + local;
  const uint pool = c < push.cells && cell_dirty[c] >= 2u ? (cell_dirty[c] & ~kFades) - 2u : kNoPool;
  pools[local] = pool;
  jobs[local] = pool == kNoPool ? 0u : cells[c].jobs;
  groups[local] = pool == kNoPool ? 0u : (cells[c].octets + kReceiveOctets - 1u) / kReceiveOctets;
  barrier();
  if (pool != kNoPool) {
    uint entry = entries_of[pool], first_job = jobs_of[pool], first_group = groups_of[pool];
    for (uint n = 0; n < local; ++n) {
      if (pools[n] != pool) continue;
      entry += 1u;
      first_job += jobs[n];
      first_group += groups[n];
    }
    ActiveCell a;
    a.base = cells[c].base;
    a.octets = cells[c].octets | (cell_dirty[c] & kFades);
    a.first_job = first_job;
    a.first_group = first_group;
    active_cells[first_of[pool] + entry] = a;
    cell_dirty[c] = 0u;
  }
  barrier();
  if (local == 0u) {
    for (uint n = 0; n < kGroup; ++n) {
      if (pools[n] == kNoPool) continue;
      entries_of[pools[n]] += 1u;
      jobs_of[pools[n]] += jobs[n];
      groups_of[pools[n]] += groups[n];
    }
  }
  barrier();
}

void main() {
  const uint local = gl_LocalInvocationIndex;
  for (uint p = local; p < kMaxPools; p += kGroup) {
    entries_of[p] = 0u;
    jobs_of[p] = 0u;
    groups_of[p] = 0u;
  }
  const uint cursor = control.cell_cursor < push.cells ? control.cell_cursor : 0u;
  if (local == 0u) {
    found = 0u;
    taken = 0u;
    project_quads = 0u;
    receive_quads = 0u;
    next_cursor = cursor;
  }
  barrier();
  for (uint at = cursor; at < push.cells; at += kGroup) choose(at, push.cells);
  for (uint at = 0u; at < cursor; at += kGroup) choose(at, cursor);
  memoryBarrierBuffer();
  barrier();

  if (local == 0u) {
    uint first = 0u;
    for (uint p = 0; p < kMaxPools; ++p) {
      first_of[p] = first;
      control.first_cell[p] = first;
      control.cells[p] = entries_of[p];
      first += entries_of[p];
      entries_of[p] = 0u;
    }
  }
  barrier();
  if (taken > 0u) {
    for (uint at = 0u; at < push.cells; at += kGroup) append(at);
  }

  for (uint p = local; p < kMaxPools; p += kGroup) {
    control.project[p] = spread(jobs_of[p], push.max_groups);
    control.receive[p] = spread(groups_of[p], push.max_groups);
    control.jobs[p] = jobs_of[p];
    control.groups[p] = groups_of[p];
  }
  if (local == 0u) {
    control.updated_cells = taken;
    control.waiting_cells = found - taken;
    control.project_quads = project_quads;
    control.receive_quads = receive_quads;
    control.cell_cursor = next_cursor;
    control.image = spread(taken > 0u ? push.image_groups : 0u, push.max_groups);
  }
}
