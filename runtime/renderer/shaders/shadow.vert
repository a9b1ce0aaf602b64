// Depth as a light sees it.
#version 450
#include "frame.h"

layout(push_constant) uniform Push { ShadowPush push; };
layout(location = 0) in vec3 position;
layout(location = 3) in vec2 base_uv;
layout(location = 0) out vec2 out_base_uv;

void main() {
  out_base_uv = base_uv;
  gl_Position = push.view_projection * vec4(position, 1);
}
