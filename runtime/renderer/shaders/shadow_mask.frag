// The holes of alpha-masked surfaces let light through.
#version 450
#include "frame.h"

layout(push_constant) uniform Push { ShadowPush push; };
layout(set = 0, binding = 0) uniform sampler2D base_map;
layout(location = 0) in vec2 base_uv;

void main() {
  const float map = base_uv.x > kNoUv ? 1 : textureLod(base_map, base_uv, 0).a;
  if (push.alpha * map < push.cutoff) discard;
}
