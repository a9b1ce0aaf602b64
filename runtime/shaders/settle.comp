// Smoothing and fading: E goes the share alpha of the way to its target, and the whole of the last step.
#version 450
#include "layout.h"

layout(push_constant) uniform Push { SettlePush push; };
layout(std430, binding = 0) buffer Irradiance { float irradiance[]; };  // E, then its targets

void main() {
  const uint i = invocation_index();
  if (i >= push.values) return;
  const float to = irradiance[push.target + i];
  const float left = to - irradiance[i];
  const bool arrives = push.alpha >= 1.0 || abs(left) <= push.arrived * max(abs(to), push.black);
  irradiance[i] = arrives ? to : irradiance[i] + push.alpha * left;
}
