// Direct light of each surface element by KHR_lights_punctual (incident_light in core/scene), irradiance with cosine.
// Shadows by percentage-closer filtering (Reeves et al. 1987) over about the element's footprint, looked up from a point
// moved along the normal. Compiled with and without LL_SHADOWS.
#version 450
#include "layout.h"

layout(push_constant) uniform Push { DirectPush push; };
layout(std430, binding = 0) readonly buffer Points { vec4 points[]; };   // position, radius; radius 0: not resident
layout(std430, binding = 1) readonly buffer Normals { uint normals[]; };  // octahedral, two snorm16
layout(std430, binding = 2) readonly buffer Lights { Light lights[]; };
layout(std430, binding = 3) readonly buffer Views { ShadowView views[]; };
layout(std430, binding = 4) writeonly buffer Direct { float direct[]; };
#ifdef LL_SHADOWS
layout(binding = 5) uniform sampler2DArrayShadow shadow_maps;
#endif

const uint kPoint = 0u, kSpot = 1u, kDirectional = 2u;
const uint kNoShadow = 0xffffffffu;

vec3 decode_normal(uint packed) {
  const vec2 uv = unpackSnorm2x16(packed);
  vec3 n = vec3(uv, 1.0 - abs(uv.x) - abs(uv.y));
  if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
  return normalize(n);
}

#ifdef LL_SHADOWS
/// Which of +X -X +Y -Y +Z -Z the direction is in.
uint cube_face(vec3 d) {
  const vec3 a = abs(d);
  if (a.x >= a.y && a.x >= a.z) return d.x >= 0.0 ? 0u : 1u;
  if (a.y >= a.z) return d.y >= 0.0 ? 2u : 3u;
  return d.z >= 0.0 ? 4u : 5u;
}

mat4 matrix_of(uint view) {
  mat4 m;
  for (uint c = 0; c < 4; ++c) {
    m[c] = vec4(views[view].columns[4 * c], views[view].columns[4 * c + 1], views[view].columns[4 * c + 2],
                views[view].columns[4 * c + 3]);
  }
  return m;
}

/// 1: lit.
float visibility(uint view, vec3 position, float radius, vec3 normal) {
  const mat4 m = matrix_of(view);
  const float w = (m * vec4(position, 1.0)).w;
  if (!(w > 0.0)) return 1.0;
  // Metres that a texel of the map covers at this distance.
  const float texel = 2.0 * w / (length(vec3(m[0][0], m[1][0], m[2][0])) * push.map_size);
  const vec4 clip = m * vec4(position + 1.5 * max(texel, 0.25 * radius) * normal, 1.0);
  const vec3 p = clip.xyz / clip.w;
  if (!(clip.w > 0.0) || p.z < 0.0 || p.z > 1.0 || any(greaterThan(abs(p.xy), vec2(1.0)))) return 1.0;
  const float spread = clamp(radius / texel, 0.5, 4.0) * (2.0 / 3.0) / push.map_size;
  float lit = 0.0;
  for (int y = -1; y <= 1; ++y) {
    for (int x = -1; x <= 1; ++x) {
      const vec2 uv = 0.5 * p.xy + 0.5 + spread * vec2(x, y);
      lit += texture(shadow_maps, vec4(uv, float(views[view].layer), p.z));
    }
  }
  return lit / 9.0;
}
#endif

void main() {
  const uint s = invocation_index();
  if (s >= push.elements) return;
  const vec3 position = points[s].xyz;
  const float radius = points[s].w;
  const vec3 normal = decode_normal(normals[s]);
  vec3 sum = vec3(0.0);
  for (uint n = 0; n < push.lights && radius > 0.0; ++n) {
    const Light light = lights[n];
    const vec3 axis = vec3(light.direction[0], light.direction[1], light.direction[2]);
    vec3 irradiance = vec3(light.intensity[0], light.intensity[1], light.intensity[2]);
    vec3 to_light = -axis;
    if (light.type != kDirectional) {
      const vec3 d = vec3(light.position[0], light.position[1], light.position[2]) - position;
      const float distance = length(d);
      if (!(distance > 0.0) || (light.range > 0.0 && distance > light.range)) continue;
      to_light = d / distance;
      irradiance /= distance * distance;
      if (light.type == kSpot) {
        const float a = clamp(-dot(axis, to_light) * light.cone_scale + light.cone_offset, 0.0, 1.0);
        irradiance *= a * a;
      }
    }
    const float cosine = dot(normal, to_light);
    if (!(cosine > 0.0)) continue;
#ifdef LL_SHADOWS
    if (light.first_view != kNoShadow) {
      irradiance *= visibility(light.first_view + (light.type == kPoint ? cube_face(-to_light) : 0u), position, radius,
                               normal);
    }
#endif
    sum += irradiance * cosine;
  }
  direct[3 * s] = sum.r;
  direct[3 * s + 1] = sum.g;
  direct[3 * s + 2] = sum.b;
}
