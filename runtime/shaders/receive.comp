// Irradiance of each receiver from its cluster's coefficients (SL17 Eq. 11, core/asset/chunk.h):
//   E_r = π·uniform[r]/65535·c_0 + Σ_k reconstruction[k][r]·c_k + Σ_i w_i·B_i over its near field
// No |E| above π times the greatest radiance there is, so that feedback stays bounded whatever the asset says
// (docs/runtime.md). One invocation per octet of receivers, the halfs of one uvec4 of a column.
#version 450
#extension GL_EXT_control_flow_attributes : require
#include "layout.h"

layout(push_constant) uniform Push { ReceivePush push; };
// The pool, as three types.
layout(std430, binding = 0) readonly buffer Radiosity { vec4 radiosity[]; };
layout(std430, binding = 1) readonly buffer Words { uint words[]; };
layout(std430, binding = 2) readonly buffer Quads { uvec4 quads[]; };
layout(std430, binding = 3) readonly buffer Coefficients { vec4 coefficients[]; };
layout(std430, binding = 4) readonly buffer Active { ActiveCell active_cells[]; };
layout(std430, binding = 5) readonly buffer Shared { Control control; };
layout(std430, binding = 6) buffer Irradiance { float irradiance[]; };  // E, then its targets

const float kPi = 3.14159265358979324;

/// Two quads of the pool.
Cluster cluster_of(uint at) {
  const uvec4 a = quads[2 * at], b = quads[2 * at + 1];
  return Cluster(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w);
}

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

/// With targets, the distance of E from its own stays as it is, and settle.comp makes it smaller: changes of light show
/// at once, those of the model do not.
void store(uint at, float value, float limit, bool stays) {
  if (push.target != 0u) {
    const float shown = irradiance[at], old = irradiance[push.target + at];
    irradiance[push.target + at] = value;
    if (stays) return;
    if (shown != old) value = clamp(shown + (value - old), -limit, limit);
  }
  irradiance[at] = value;
}

void main() {
  const uint group = group_index();
  if (group >= control.groups[push.pool]) return;
  const uint cell = find_cell(group);
  const uint word = active_cells[cell].base * (kCellUnit / 4);
  const uint quad = active_cells[cell].base * (kCellUnit / 16);
  const vec3 limit = kPi * vec3(uintBitsToFloat(control.limit[0]), uintBitsToFloat(control.limit[1]),
                                uintBitsToFloat(control.limit[2]));
  const uint cluster_at = active_cells[cell].base + words[word];
  const uint octet_at = word + words[word + 4], element_at = word + words[word + 5];
  const uint uniform_at = quad + words[word + 6], coefficient_at = quad + words[word + 7];
  const uint near_first_at = word + words[word + 9], near_at = word + words[word + 10];
  const uint begin = kReceiveOctets * (group - active_cells[cell].first_group);
  const uint end = min(begin + kReceiveOctets, active_cells[cell].octets & ~kFades);
  const bool stays = push.keep != 0u || (active_cells[cell].octets & kFades) != 0u;
  for (uint o = begin + gl_LocalInvocationIndex; o < end; o += kGroup) {
    const Cluster cluster = cluster_of(cluster_at + words[octet_at + 2 * o]);
    const uint coefficient = coefficient_at + cluster.first_coefficient;
    const vec3 c0 = coefficients[coefficient].rgb;
    const uvec4 u = quads[uniform_at + o];
    const vec4 u0 = kPi * vec4(unpackUnorm2x16(u.x), unpackUnorm2x16(u.y));
    const vec4 u1 = kPi * vec4(unpackUnorm2x16(u.z), unpackUnorm2x16(u.w));
    vec4 r[2] = {u0 * c0.r, u1 * c0.r}, g[2] = {u0 * c0.g, u1 * c0.g}, b[2] = {u0 * c0.b, u1 * c0.b};
    uint at = quad + cluster.reconstruction + words[octet_at + 2 * o + 1];
    for (uint k = 0; k < cluster.rank; ++k, at += cluster.octets) {
      const uvec4 w = quads[at];
      const vec4 w0 = vec4(unpackHalf2x16(w.x), unpackHalf2x16(w.y));
      const vec4 w1 = vec4(unpackHalf2x16(w.z), unpackHalf2x16(w.w));
      const vec3 c = coefficients[coefficient + 1 + k].rgb;
      r[0] += w0 * c.r, r[1] += w1 * c.r;
      g[0] += w0 * c.g, g[1] += w1 * c.g;
      b[0] += w0 * c.b, b[1] += w1 * c.b;
    }

    [[unroll]] for (uint n = 0; n < kOctet; ++n) {
      const uint element = words[element_at + kOctet * o + n];
      if (element != kNoElement) {
        vec3 e = vec3(r[n / 4][n % 4], g[n / 4][n % 4], b[n / 4][n % 4]);
        const uint near_end = words[near_first_at + kOctet * o + n + 1];
        for (uint i = words[near_first_at + kOctet * o + n]; i < near_end; ++i) {
          e += uintBitsToFloat(words[near_at + 2 * i + 1]) * radiosity[words[near_at + 2 * i]].rgb;
        }
        // A hostile asset can make NaN, which clamp() may keep, and feedback would for ever.
        const vec3 bounded = mix(clamp(e, -limit, limit), vec3(0.0), isnan(e));
        for (uint c = 0; c < 3; ++c) store(3 * element + c, bounded[c], limit[c], stays);
      }
    }
  }
}
