#version 450
#include "frame.h"

layout(set = 0, binding = 0) uniform Frame { FrameData frame; };
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 geometric;
layout(location = 3) in vec2 base_uv;
layout(location = 4) in vec2 emission_uv;
layout(location = 5) in vec2 lightmap_uv;
layout(location = 0) out vec3 out_position;
layout(location = 1) out vec3 out_normal;
layout(location = 2) flat out vec3 out_geometric;
layout(location = 3) out vec2 out_base_uv;
layout(location = 4) out vec2 out_emission_uv;
layout(location = 5) out vec2 out_lightmap_uv;

void main() {
  out_position = position;
  out_normal = normal;
  out_geometric = geometric;
  out_base_uv = base_uv;
  out_emission_uv = emission_uv;
  out_lightmap_uv = lightmap_uv;
  gl_Position = frame.view_projection * vec4(position, 1);
}
