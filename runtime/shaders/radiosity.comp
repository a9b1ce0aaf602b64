// Light that leaves each surface element: B = albedo/π · (direct + E) + emission, E of the frame before.
#version 450
#include "layout.h"

layout(local_size_x = kGroup) in;
layout(push_constant) uniform Push { RadiosityPush push; };
layout(std430, binding = 0) readonly buffer Direct { float direct[]; };
layout(std430, binding = 1) readonly buffer Albedo { float albedo[]; };
layout(std430, binding = 2) readonly buffer Emission { float emission[]; };
layout(std430, binding = 3) readonly buffer Irradiance { float irradiance[]; };
layout(std430, binding = 4) writeonly buffer Radiosity { vec4 radiosity[]; };

const float kInvPi = 0.31830988618379067;

void main() {
  const uint s = group_index() * kGroup + gl_LocalInvocationIndex;
  if (s >= push.elements) return;
  const vec3 d = vec3(direct[3 * s], direct[3 * s + 1], direct[3 * s + 2]);
  const vec3 a = vec3(albedo[3 * s], albedo[3 * s + 1], albedo[3 * s + 2]);
  const vec3 l = vec3(emission[3 * s], emission[3 * s + 1], emission[3 * s + 2]);
  const vec3 e = vec3(irradiance[3 * s], irradiance[3 * s + 1], irradiance[3 * s + 2]);
  radiosity[s] = vec4(a * kInvPi * (d + e) + l, 0.0);
}
