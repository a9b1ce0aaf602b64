#version 450
#include "frame.h"

layout(push_constant) uniform Push { LinesPush push; };
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 colour;
layout(location = 0) out vec4 out_colour;

void main() {
  out_colour = colour;
  gl_Position = push.view_projection * vec4(position, 1);
  gl_Position.z *= push.nearer;
}
