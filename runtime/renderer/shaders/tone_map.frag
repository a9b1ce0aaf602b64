// Radiance to what a screen shows: core/scene/picture.h's expose and core/scene/srgb.h's curve.
#version 450
#include "frame.h"

layout(push_constant) uniform Push { ToneMapPush push; };
layout(set = 0, binding = 0) uniform sampler2D radiance;
layout(location = 0) out vec4 shown;

void main() {
  vec3 c = texelFetch(radiance, ivec2(gl_FragCoord.xy), 0).rgb;
  if (push.exposure > 0) {
    c *= push.exposure;
    c = c * (1 + c / 16) / (1 + c);
  }
  c = clamp(c, 0, 1);
  shown = vec4(mix(1.055 * pow(c, vec3(1 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308))), 1);
}
