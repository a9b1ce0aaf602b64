// What a surface sends to the eye: albedo/π·(direct + E) + emission, as core/relight/camera_view does on the CPU.
// Direct light goes through shadow maps, E comes from the lightmap.
#version 450
#include "frame.h"

layout(push_constant) uniform Push { MaterialPush push; };
layout(set = 0, binding = 0) uniform Frame { FrameData frame; };
layout(set = 0, binding = 1) readonly buffer Lights { LightData lights[]; };
layout(set = 0, binding = 2) readonly buffer Views { ViewData views[]; };
layout(set = 0, binding = 3) uniform sampler2DArray shadow_maps;
layout(set = 0, binding = 4) uniform sampler2DArray irradiance_map;  // layer 0 fronts, 1 backs
layout(set = 1, binding = 0) uniform sampler2D base_map;
layout(set = 1, binding = 1) uniform sampler2D emission_map;

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 vertex_normal;
layout(location = 2) flat in vec3 front;
layout(location = 3) in vec2 base_uv;
layout(location = 4) in vec2 emission_uv;
layout(location = 5) in vec2 lightmap_uv;  // texels; negative: none
layout(location = 0) out vec4 radiance;

const float kPi = 3.14159265358979324;
/// A 3×3 box of bilinear comparisons reaches 2 texels along an axis, 2·√2 across, from where it looks.
const float kFilterReach = 2.83;

/// Bilinear over valid texels; over filled ones where there is none.
vec3 irradiance(bool back) {
  if (lightmap_uv.x < 0) return vec3(0);
  const ivec2 last = textureSize(irradiance_map, 0).xy - 1;
  const vec2 at = lightmap_uv - 0.5, base = floor(at), f = at - base;
  vec3 valid = vec3(0), filled = vec3(0);
  float weight = 0;
  for (int k = 0; k < 4; ++k) {
    const ivec2 offset = ivec2(k & 1, k >> 1);
    const vec4 e = texelFetch(irradiance_map, ivec3(clamp(ivec2(base) + offset, ivec2(0), last), back ? 1 : 0), 0);
    const vec2 w2 = mix(1 - f, f, vec2(offset));
    const float w = w2.x * w2.y;
    filled += w * e.rgb;
    valid += w * e.a * e.rgb;
    weight += w * e.a;
  }
  return weight > 1e-4 ? valid / weight : filled;
}

/// Faces in the order +X −X +Y −Y +Z −Z.
uint cube_face(vec3 d) {
  const vec3 a = abs(d);
  if (a.x >= a.y && a.x >= a.z) return d.x < 0 ? 1 : 0;
  if (a.y >= a.z) return d.y < 0 ? 3 : 2;
  return d.z < 0 ? 5 : 4;
}

/// Share of light that arrives, 3×3 bilinear comparisons as one tent over 4×4 texels. `geometric`: of the side seen.
float visibility(LightData light, vec3 geometric, vec3 to_light) {
  // A surface must not shadow itself within the filter: step off along its normal by what the slope needs, and half a
  // texel towards the light.
  const vec3 from_light = position - light.position_range.xyz;
  float texel = light.direction.w;
  if (light.type == kPoint) texel *= max(max(abs(from_light.x), abs(from_light.y)), abs(from_light.z));
  if (light.type == kSpot) texel *= dot(from_light, light.direction.xyz);
  const float cosine = dot(geometric, to_light);
  const float sine = sqrt(max(0, 1 - cosine * cosine));
  const vec3 p = position + texel * (kFilterReach * sine * geometric + 0.5 * to_light);

  uint view = light.first_view;
  if (light.type == kPoint) view += cube_face(p - light.position_range.xyz);
  const vec4 clip = views[view].view_projection * vec4(p, 1);
  if (clip.w <= 0) return 1;
  const vec3 ndc = clip.xyz / clip.w;
  if (any(greaterThan(abs(ndc.xy), vec2(1))) || ndc.z > 1) return 1;
  const float size = float(frame.shadow_size), layer = float(views[view].layer);
  const vec2 at = (ndc.xy * 0.5 + 0.5) * size - 0.5, base = floor(at), f = at - base;
  const vec4 wx = vec4(1 - f.x, 1, 1, f.x) / 3, wy = vec4(1 - f.y, 1, 1, f.y) / 3;
  float sum = 0;
  for (int k = 0; k < 4; ++k) {
    const ivec2 block = 2 * ivec2(k & 1, k >> 1);
    // The corner shared by the four texels. Gather: (0,1) (1,1) (1,0) (0,0).
    const vec4 depth = textureGather(shadow_maps, vec3((base + vec2(block)) / size, layer));
    const vec4 lit = step(vec4(ndc.z), depth);
    const vec2 x = vec2(wx[block.x], wx[block.x + 1]), y = vec2(wy[block.y], wy[block.y + 1]);
    sum += dot(lit, vec4(x[0] * y[1], x[1] * y[1], x[1] * y[0], x[0] * y[0]));
  }
  return sum;
}

/// core/scene's incident_light, times cosine and visibility.
vec3 direct(LightData light, vec3 normal, vec3 geometric) {
  vec3 to_light = -light.direction.xyz, e = light.colour.rgb;
  if (light.type != kDirectional) {
    const vec3 d = light.position_range.xyz - position;
    const float distance = length(d);
    if (distance <= 0 || (light.position_range.w > 0 && distance > light.position_range.w)) return vec3(0);
    to_light = d / distance;
    e /= distance * distance;
    if (light.type == kSpot) {
      const float a = clamp((-dot(light.direction.xyz, to_light) - light.cos_outer) * light.cone_scale, 0, 1);
      e *= a * a;
    }
  }
  const float cosine = dot(normal, to_light);
  if (cosine <= 0 || dot(geometric, to_light) <= 0 || e == vec3(0)) return vec3(0);
  return e * cosine * visibility(light, geometric, to_light);
}

void main() {
  const vec4 base = mix(texture(base_map, base_uv), vec4(1), greaterThan(base_uv.xxxx, vec4(kNoUv)));
  const vec3 shine_map = mix(texture(emission_map, emission_uv).rgb, vec3(1), greaterThan(emission_uv.xxx, vec3(kNoUv)));
  const vec3 shine = push.emission.rgb * shine_map;
  if (push.base_colour.a * base.a < push.emission.a) discard;
  const bool back = dot(front, position - frame.eye.xyz) > 0;
  if (back && push.double_sided == 0) {
    radiance = vec4(0, 0, 0, 1);
    return;
  }
  const vec3 albedo = clamp(push.base_colour.rgb * base.rgb, 0, 1);
  const vec3 geometric = normalize(back ? -front : front);
  vec3 normal = normalize(back ? -vertex_normal : vertex_normal);
  if (!(dot(normal, geometric) > 0)) normal = geometric;

  vec3 light = vec3(0);
  if (frame.layer == kFull || frame.layer == kIndirect || frame.layer == kE) light += irradiance(back);
  if (frame.layer == kFull || frame.layer == kDirect) {
    for (uint i = 0; i < frame.lights; ++i) light += direct(lights[i], normal, geometric);
  }
  vec3 colour = frame.layer == kAlbedo ? albedo : (frame.layer == kE ? vec3(1) : albedo) * light / kPi;
  if (!back && (frame.layer == kFull || frame.layer == kDirect)) colour += shine;
  radiance = vec4(colour, 1);
}
