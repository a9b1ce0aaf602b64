// Irradiance of each receiver from its cluster's coefficients (SL17 Eq. 11, core/asset/chunk.h):
//   E_r = π·uniform[r]/65535·c_0 + Σ_k reconstruction[k][r]·c_k
// One invocation per octet of receivers, the halfs of one uvec4 of a column.
#version 450
#include "layout.h"

layout(local_size_x = kGroup) in;
layout(push_constant) uniform Push { ReceivePush push; };
layout(std430, binding = 0) readonly buffer Clusters { Cluster clusters[]; };
layout(std430, binding = 1) readonly buffer Octets { Octet octets[]; };
layout(std430, binding = 2) readonly buffer Elements { uint elements[]; };  // 8 per octet
layout(std430, binding = 3) readonly buffer Uniforms { uvec4 uniforms[]; };  // 8 × unorm16 per octet
layout(std430, binding = 4) readonly buffer Matrix { uvec4 matrix[]; };
layout(std430, binding = 5) readonly buffer Coefficients { vec4 coefficients[]; };
layout(std430, binding = 6) writeonly buffer Irradiance { float irradiance[]; };

const float kPi = 3.14159265358979324;

void main() {
  const uint o = group_index() * kGroup + gl_LocalInvocationIndex;
  if (o >= push.octets) return;
  const Cluster cluster = clusters[octets[o].cluster];
  const uint index = octets[o].index;

  const vec3 c0 = coefficients[cluster.first_coefficient].rgb;
  const uvec4 u = uniforms[o];
  const vec4 u0 = kPi * vec4(unpackUnorm2x16(u.x), unpackUnorm2x16(u.y));
  const vec4 u1 = kPi * vec4(unpackUnorm2x16(u.z), unpackUnorm2x16(u.w));
  vec4 r0 = u0 * c0.r, r1 = u1 * c0.r;
  vec4 g0 = u0 * c0.g, g1 = u1 * c0.g;
  vec4 b0 = u0 * c0.b, b1 = u1 * c0.b;
  for (uint k = 0; k < cluster.rank; ++k) {
    const uvec4 w = matrix[cluster.reconstruction + k * cluster.octets + index];
    const vec4 w0 = vec4(unpackHalf2x16(w.x), unpackHalf2x16(w.y));
    const vec4 w1 = vec4(unpackHalf2x16(w.z), unpackHalf2x16(w.w));
    const vec3 c = coefficients[cluster.first_coefficient + 1 + k].rgb;
    r0 += w0 * c.r, r1 += w1 * c.r;
    g0 += w0 * c.g, g1 += w1 * c.g;
    b0 += w0 * c.b, b1 += w1 * c.b;
  }

  for (uint n = 0; n < kOctet; ++n) {
    const uint element = elements[kOctet * o + n];
    if (element == kNoElement) continue;
    const bool low = n < 4;
    const uint m = n & 3u;
    irradiance[3 * element] = low ? r0[m] : r1[m];
    irradiance[3 * element + 1] = low ? g0[m] : g1[m];
    irradiance[3 * element + 2] = low ? b0[m] : b1[m];
  }
}
