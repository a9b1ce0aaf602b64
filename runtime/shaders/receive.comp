// Irradiance of each receiver from its cluster's coefficients (SL17 Eq. 11, core/asset/chunk.h):
//   E_r = π·uniform[r]/65535·c_0 + Σ_k reconstruction[k][r]·c_k
// No |E| above π times the greatest radiance there is, so that feedback stays bounded whatever the asset says
// (docs/runtime.md). One invocation per octet of receivers, the halfs of one uvec4 of a column.
#version 450
#include "layout.h"

layout(push_constant) uniform Push { ReceivePush push; };
// The pool, as four types.
layout(std430, binding = 0) readonly buffer Clusters { Cluster clusters[]; };
layout(std430, binding = 1) readonly buffer Words { uint words[]; };
layout(std430, binding = 2) readonly buffer Quads { uvec4 quads[]; };
layout(std430, binding = 3) readonly buffer Coefficients { vec4 coefficients[]; };
layout(std430, binding = 4) readonly buffer Active { ActiveCell active_cells[]; };
layout(std430, binding = 5) readonly buffer Shared { Control control; };
layout(std430, binding = 6) writeonly buffer Irradiance { float irradiance[]; };

const float kPi = 3.14159265358979324;

/// The last of the pool's cells whose first group is not behind `group`.
uint find_cell(uint group) {
  uint lo = control.first_cell[push.pool], hi = lo + control.cells[push.pool];
  while (hi - lo > 1) {
    const uint middle = (lo + hi) / 2;
    if (active_cells[middle].first_group <= group) lo = middle;
    else hi = middle;
  }
  return lo;
}

void main() {
  const uint group = group_index();
  if (group >= control.groups[push.pool]) return;
  const uint cell = find_cell(group);
  const uint word = active_cells[cell].base * (kCellUnit / 4);
  const uint quad = active_cells[cell].base * (kCellUnit / 16);
  const vec3 limit = kPi * vec3(uintBitsToFloat(control.limit[0]), uintBitsToFloat(control.limit[1]),
                                uintBitsToFloat(control.limit[2]));
  const uint begin = kReceiveOctets * (group - active_cells[cell].first_group);
  const uint end = min(begin + kReceiveOctets, active_cells[cell].octets);
  for (uint o = begin + gl_LocalInvocationIndex; o < end; o += kGroup) {
    const Cluster cluster = clusters[active_cells[cell].base + words[word] + words[word + words[word + 4] + 2 * o]];
    const uint index = words[word + words[word + 4] + 2 * o + 1];
    const uint coefficient = quad + words[word + 7] + cluster.first_coefficient;

    const vec3 c0 = coefficients[coefficient].rgb;
    const uvec4 u = quads[quad + words[word + 6] + o];
    const vec4 u0 = kPi * vec4(unpackUnorm2x16(u.x), unpackUnorm2x16(u.y));
    const vec4 u1 = kPi * vec4(unpackUnorm2x16(u.z), unpackUnorm2x16(u.w));
    vec4 r0 = u0 * c0.r, r1 = u1 * c0.r;
    vec4 g0 = u0 * c0.g, g1 = u1 * c0.g;
    vec4 b0 = u0 * c0.b, b1 = u1 * c0.b;
    for (uint k = 0; k < cluster.rank; ++k) {
      const uvec4 w = quads[quad + cluster.reconstruction + k * cluster.octets + index];
      const vec4 w0 = vec4(unpackHalf2x16(w.x), unpackHalf2x16(w.y));
      const vec4 w1 = vec4(unpackHalf2x16(w.z), unpackHalf2x16(w.w));
      const vec3 c = coefficients[coefficient + 1 + k].rgb;
      r0 += w0 * c.r, r1 += w1 * c.r;
      g0 += w0 * c.g, g1 += w1 * c.g;
      b0 += w0 * c.b, b1 += w1 * c.b;
    }

    for (uint n = 0; n < kOctet; ++n) {
      const uint element = words[word + words[word + 5] + kOctet * o + n];
      if (element == kNoElement) continue;
      const bool low = n < 4;
      const uint m = n & 3u;
      const vec3 e = low ? vec3(r0[m], g0[m], b0[m]) : vec3(r1[m], g1[m], b1[m]);
      const vec3 bounded = clamp(e, -limit, limit);
      irradiance[3 * element] = bounded.r;
      irradiance[3 * element + 1] = bounded.g;
      irradiance[3 * element + 2] = bounded.b;
    }
  }
}
