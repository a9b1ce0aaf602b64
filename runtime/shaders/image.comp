// E times the exposure in the lightmap's layout. LL_FORMAT is the image's, LL_LARGEST its largest number: it saturates, as infinity would
// spread under bilinear filtering.
#version 450
#include "layout.h"

layout(push_constant) uniform Push { ImagePush push; };
layout(std430, binding = 0) readonly buffer Map { uint map[]; };  // layers × height × width: surface element
layout(std430, binding = 1) readonly buffer Irradiance { float irradiance[]; };
layout(binding = 2, LL_FORMAT) writeonly uniform image2DArray image;

void main() {
  const uint t = invocation_index();
  const uint texels = push.width * push.height;
  if (t >= texels * push.layers) return;
  const uint entry = map[t];
  vec4 value = vec4(0.0);
  if (entry != kNoElement) {
    const uint s = entry & ~kDilated;
    value = vec4(irradiance[3 * s], irradiance[3 * s + 1], irradiance[3 * s + 2], entry < kDilated ? 1.0 : 0.0);
  }
  const uint in_layer = t % texels;
  value.rgb = clamp(value.rgb * push.exposure, -LL_LARGEST, LL_LARGEST);
  imageStore(image, ivec3(in_layer % push.width, in_layer / push.width, t / texels), value);
}
