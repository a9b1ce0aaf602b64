// Radiance at each probe: λ_pj = 4π/N · Σ_r Y_j(ω_r) · L_r, L_r the radiosity of what ray r hits, the sky or nothing.
// A matrix product, Y (J × N) by L (N × 3P). One workgroup takes kRelightProbes probes of a pool's
// list and all j; an invocation owns eight j and every slices-th quad of rays, so that each Y and each L that it loads is used many times.
#version 450
#extension GL_EXT_control_flow_attributes : require
#include "layout.h"

layout(push_constant) uniform Push { RelightPush push; };
layout(std430, binding = 0) readonly buffer Pool { uint words[]; };           // rays, then tiles, of each slot
layout(std430, binding = 1) readonly buffer Radiosity { vec4 radiosity[]; };  // S
layout(std430, binding = 2) readonly buffer Sh { vec4 sh[]; };                // N/4 × stride: Y_j of four rays
layout(std430, binding = 3) writeonly buffer Lambda { vec4 lambda[]; };       // all probes × 3 × stride/4
layout(std430, binding = 4) readonly buffer Active { uint active_slots[]; };
layout(std430, binding = 5) readonly buffer SlotTable { Slot slot_table[]; };
layout(std430, binding = 6) readonly buffer Shared { Control control; };

const uint kQuads = kRayTile / 4;

shared vec4 radiance[kQuads * kRelightProbes * 3];  // of four rays: r, g, b
shared vec4 partial[6 * kGroup];
shared uint slots[kRelightProbes];  // within the pool

vec3 fetch(uint slot, uint ray) {
  if (ray >= push.rays || slot == kNoProbe) return vec3(0.0);
  const uint element = words[slot * push.slot_words + ray];
  if (element == kDead) return vec3(0.0);
  if (element == kSky) return vec3(push.sky_r, push.sky_g, push.sky_b);
  return radiosity[element].rgb;
}

void main() {
  const uint first = group_index() * kRelightProbes;
  const uint count = control.relight_count[push.pool];
  if (first >= count) return;
  const uint local = gl_LocalInvocationIndex;
  if (local < kRelightProbes) {
    slots[local] = first + local < count ? active_slots[push.first_slot + first + local] : kNoProbe;
  }
  barrier();
  const uint stride = 8 * push.stride8;
  const uint octets = min(push.stride8, kGroup);  // that invocations own at a time
  const uint slices = kGroup / octets;
  const uint slice = local / octets;

  for (uint first_octet = 0; first_octet < push.stride8; first_octet += octets) {
    const uint octet = first_octet + local % octets;
    const bool works = slice < slices && octet < push.stride8;
    vec3 sum[kRelightProbes][8];
    [[unroll]] for (uint p = 0; p < kRelightProbes; ++p) {
      [[unroll]] for (uint n = 0; n < 8; ++n) sum[p][n] = vec3(0.0);
    }
    for (uint first_ray = 0; first_ray < push.rays; first_ray += kRayTile) {
      for (uint n = local; n < kQuads * kRelightProbes; n += kGroup) {
        const uint ray = first_ray + n / kRelightProbes * 4;
        const uint slot = slots[n % kRelightProbes];
        const vec3 a = fetch(slot, ray), b = fetch(slot, ray + 1);
        const vec3 c = fetch(slot, ray + 2), d = fetch(slot, ray + 3);
        radiance[3 * n] = vec4(a.r, b.r, c.r, d.r);
        radiance[3 * n + 1] = vec4(a.g, b.g, c.g, d.g);
        radiance[3 * n + 2] = vec4(a.b, b.b, c.b, d.b);
      }
      barrier();
      if (works) {
        for (uint q = slice; q < kQuads; q += slices) {
          const uint at = (first_ray / 4 + q) * stride + 8 * octet;
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
      if (works && slice == 0 && slots[p] != kNoProbe) {
        const uint to = slot_table[push.first_slot + slots[p]].probe * 3 * (stride / 4) + 2 * octet;
        [[unroll]] for (uint n = 0; n < 6; ++n) {
          vec4 total = partial[6 * local + n];
          for (uint s = 1; s < slices; ++s) total += partial[6 * (s * octets + local) + n];
          lambda[to + n / 2 * (stride / 4) + n % 2] = push.scale * total;
        }
      }
      barrier();
    }
  }
}
