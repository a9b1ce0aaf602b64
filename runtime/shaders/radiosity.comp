// Light that leaves each surface element: B = albedo/π · (direct + E) + emission, E of the frame before. B is replaced
// only if it changed by more than epsilon, and then its tile is marked: differences add up until they count.
#version 450
#include "layout.h"

layout(push_constant) uniform Push { RadiosityPush push; };
layout(std430, binding = 0) readonly buffer Direct { float direct[]; };
layout(std430, binding = 1) readonly buffer Albedo { float albedo[]; };
layout(std430, binding = 2) readonly buffer Emission { float emission[]; };
layout(std430, binding = 3) readonly buffer Irradiance { float irradiance[]; };
layout(std430, binding = 4) buffer Radiosity { vec4 radiosity[]; };
layout(std430, binding = 5) buffer Changed { uint changed[]; };
layout(std430, binding = 6) buffer Shared { Control control; };

const float kInvPi = 0.31830988618379067;

void mark(uint tile) {
  const uint bit = 1u << (tile & 31u);
  if ((atomicOr(changed[tile >> 5], bit) & bit) != 0u) return;
  atomicAdd(control.changed_tiles, 1u);
  atomicMax(control.mark.x, push.mark_x);
  atomicMax(control.mark.y, push.mark_y);
  atomicMax(control.mark.z, 1u);
}

// Maxima, sums of ones and bits: the same in any order.
shared uint greatest[3];

void main() {
  const uint s = invocation_index();
  if (gl_LocalInvocationIndex == 0u) {
    for (uint c = 0; c < 3; ++c) greatest[c] = 0u;
  }
  barrier();
  if (s == 0u) {
    if (push.sky_tile != 0xffffffffu) mark(push.sky_tile);
    atomicMax(control.limit[0], floatBitsToUint(abs(push.sky_r)));
    atomicMax(control.limit[1], floatBitsToUint(abs(push.sky_g)));
    atomicMax(control.limit[2], floatBitsToUint(abs(push.sky_b)));
  }
  if (s < push.elements) {
    const vec3 d = vec3(direct[3 * s], direct[3 * s + 1], direct[3 * s + 2]);
    const vec3 a = vec3(albedo[3 * s], albedo[3 * s + 1], albedo[3 * s + 2]);
    const vec3 l = vec3(emission[3 * s], emission[3 * s + 1], emission[3 * s + 2]);
    const vec3 e = vec3(irradiance[3 * s], irradiance[3 * s + 1], irradiance[3 * s + 2]);
    const vec3 now = a * kInvPi * (d + e) + l;
    vec3 stored = radiosity[s].rgb;
    const vec3 tolerated = push.epsilon * max(abs(stored), vec3(push.floor));
    if (any(greaterThan(abs(now - stored), tolerated))) {
      stored = now;
      radiosity[s] = vec4(now, 0.0);
      mark(s >> push.tile_shift);
    }
    for (uint c = 0; c < 3; ++c) atomicMax(greatest[c], floatBitsToUint(abs(stored[c])));
  }
  barrier();
  if (gl_LocalInvocationIndex < 3u) atomicMax(control.limit[gl_LocalInvocationIndex], greatest[gl_LocalInvocationIndex]);
}
