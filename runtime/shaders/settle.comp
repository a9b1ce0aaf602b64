// Smoothing: E goes the share alpha of the way to what the receive pass found.
#version 450
#include "layout.h"

layout(push_constant) uniform Push { SettlePush push; };
layout(std430, binding = 0) readonly buffer Target { float target[]; };
layout(std430, binding = 1) buffer Irradiance { float irradiance[]; };

void main() {
  const uint i = invocation_index();
  if (i >= push.values) return;
  const float e = irradiance[i];
  irradiance[i] = push.alpha == 1.0 ? target[i] : e + push.alpha * (target[i] - e);
}
