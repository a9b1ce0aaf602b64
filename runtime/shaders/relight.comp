// Radiance at each probe: λ_pj = 4π/N · Σ_r Y_j(ω_r) · L_r, L_r the radiosity of what ray r hits, the sky or nothing.
// One workgroup per probe. An invocation owns four coefficients j (one vec4 of the Y table) and every slices-th ray.
#version 450
#include "layout.h"

layout(local_size_x = kGroup) in;
layout(push_constant) uniform Push { RelightPush push; };
layout(std430, binding = 0) readonly buffer Rays { uint rays[]; };            // probes × N
layout(std430, binding = 1) readonly buffer Radiosity { vec4 radiosity[]; };  // S
layout(std430, binding = 2) readonly buffer Sh { vec4 sh[]; };                // N × stride/4
layout(std430, binding = 3) writeonly buffer Lambda { vec4 lambda[]; };       // all probes × 3 × stride/4

shared vec4 radiance[kRayTile];
shared vec4 partial[3 * kGroup];

vec4 fetch(uint ray) {
  if (ray == kDead) return vec4(0.0);
  if (ray == kSky) return vec4(push.sky_r, push.sky_g, push.sky_b, 0.0);
  return radiosity[ray];
}

void main() {
  const uint probe = group_index();
  if (probe >= push.probes) return;
  const uint local = gl_LocalInvocationIndex;
  const uint slices = kGroup / push.stride4;
  const uint quad = local % push.stride4;
  const uint slice = local / push.stride4;

  vec4 r = vec4(0.0), g = vec4(0.0), b = vec4(0.0);
  for (uint first = 0; first < push.rays; first += kRayTile) {
    const uint count = min(kRayTile, push.rays - first);
    for (uint t = local; t < count; t += kGroup) radiance[t] = fetch(rays[probe * push.rays + first + t]);
    barrier();
    if (slice < slices) {
      for (uint t = slice; t < count; t += slices) {
        const vec4 y = sh[(first + t) * push.stride4 + quad];
        const vec4 l = radiance[t];
        r += y * l.r;
        g += y * l.g;
        b += y * l.b;
      }
    }
    barrier();
  }

  // Sum the slices.
  partial[3 * local] = r;
  partial[3 * local + 1] = g;
  partial[3 * local + 2] = b;
  barrier();
  if (local >= push.stride4) return;
  for (uint s = 1; s < slices; ++s) {
    const uint from = 3 * (s * push.stride4 + quad);
    r += partial[from];
    g += partial[from + 1];
    b += partial[from + 2];
  }
  const uint to = (push.first_probe + probe) * 3 * push.stride4 + quad;
  lambda[to] = push.scale * r;
  lambda[to + push.stride4] = push.scale * g;
  lambda[to + 2 * push.stride4] = push.scale * b;
}
