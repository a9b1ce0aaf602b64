// Radiance at each probe: λ_pj = 4π/N · Σ_r Y_j(ω_r) · L_r, L_r the radiosity of what ray r hits, the sky or nothing.
// A matrix product, Y (J × N) by L (N × 3P). One workgroup takes kRelightProbes probes and all j; an invocation owns eight
// j and every slices-th quad of rays, so that each Y and each L that it loads is used many times.
#version 450
#extension GL_EXT_control_flow_attributes : require
#include "layout.h"

layout(local_size_x = kGroup) in;
layout(push_constant) uniform Push { RelightPush push; };
layout(std430, binding = 0) readonly buffer Rays { uint rays[]; };            // probes × N
layout(std430, binding = 1) readonly buffer Radiosity { vec4 radiosity[]; };  // S
layout(std430, binding = 2) readonly buffer Sh { vec4 sh[]; };                // N/4 × stride: Y_j of four rays
layout(std430, binding = 3) writeonly buffer Lambda { vec4 lambda[]; };       // all probes × 3 × stride/4

const uint kQuads = kRayTile / 4;

shared vec4 radiance[kQuads * kRelightProbes * 3];  // of four rays: r, g, b
shared vec4 partial[6 * kGroup];

vec3 fetch(uint probe, uint ray) {
  if (ray >= push.rays || probe >= push.probes) return vec3(0.0);
  const uint element = rays[probe * push.rays + ray];
  if (element == kDead) return vec3(0.0);
  if (element == kSky) return vec3(push.sky_r, push.sky_g, push.sky_b);
  return radiosity[element].rgb;
}

void main() {
  const uint first_probe = group_index() * kRelightProbes;
  if (first_probe >= push.probes) return;
  const uint local = gl_LocalInvocationIndex;
  const uint stride = 8 * push.stride8;
  const uint slices = kGroup / push.stride8;
  const uint octet = local % push.stride8;
  const uint slice = local / push.stride8;

  vec3 sum[kRelightProbes][8];
  [[unroll]] for (uint p = 0; p < kRelightProbes; ++p) {
    [[unroll]] for (uint n = 0; n < 8; ++n) sum[p][n] = vec3(0.0);
  }
  for (uint first = 0; first < push.rays; first += kRayTile) {
    for (uint n = local; n < kQuads * kRelightProbes; n += kGroup) {
      const uint ray = first + n / kRelightProbes * 4;
      const uint probe = first_probe + n % kRelightProbes;
      const vec3 a = fetch(probe, ray), b = fetch(probe, ray + 1);
      const vec3 c = fetch(probe, ray + 2), d = fetch(probe, ray + 3);
      radiance[3 * n] = vec4(a.r, b.r, c.r, d.r);
      radiance[3 * n + 1] = vec4(a.g, b.g, c.g, d.g);
      radiance[3 * n + 2] = vec4(a.b, b.b, c.b, d.b);
    }
    barrier();
    if (slice < slices) {
      for (uint q = slice; q < kQuads; q += slices) {
        const uint at = (first / 4 + q) * stride + 8 * octet;
        vec4 y[8];
        [[unroll]] for (uint n = 0; n < 8; ++n) y[n] = sh[at + n];
        [[unroll]] for (uint p = 0; p < kRelightProbes; ++p) {
          const uint from = 3 * (q * kRelightProbes + p);
          const vec4 r = radiance[from], g = radiance[from + 1], b = radiance[from + 2];
          [[unroll]] for (uint n = 0; n < 8; ++n) sum[p][n] += vec3(dot(y[n], r), dot(y[n], g), dot(y[n], b));
        }
      }
    }
    barrier();
  }

  // Sum the slices, probe after probe.
  [[unroll]] for (uint p = 0; p < kRelightProbes; ++p) {
    [[unroll]] for (uint c = 0; c < 3; ++c) {
      partial[6 * local + 2 * c] = vec4(sum[p][0][c], sum[p][1][c], sum[p][2][c], sum[p][3][c]);
      partial[6 * local + 2 * c + 1] = vec4(sum[p][4][c], sum[p][5][c], sum[p][6][c], sum[p][7][c]);
    }
    barrier();
    if (slice == 0 && first_probe + p < push.probes) {
      const uint to = (push.first_probe + first_probe + p) * 3 * (stride / 4) + 2 * octet;
      [[unroll]] for (uint n = 0; n < 6; ++n) {
        vec4 total = partial[6 * local + n];
        for (uint s = 1; s < slices; ++s) total += partial[6 * (s * push.stride8 + octet) + n];
        lambda[to + n / 2 * (stride / 4) + n % 2] = push.scale * total;
      }
    }
    barrier();
  }
}
