// The fastest known way to read and use an fp16 matrix with what the passes may use (uvec4 loads, unpackHalf2x16):
// Y = M·X and nothing else. M has `rows` rows of uvec4, each eight halfs; LL_COLUMNS = 1 or 3 right-hand sides.
//   LL_ALONG  the eight halfs are neighbours along the sum, as in the project pass; an invocation owns LL_ROWS rows of M
//   else      they are eight results, as in the receive pass; an invocation owns LL_ROWS quads
#version 450
#extension GL_EXT_control_flow_attributes : require
#include "runtime/shaders/layout.h"

layout(push_constant) uniform Push { uint rows, quads; } push;  // quads: uvec4 of a row
layout(std430, binding = 0) readonly buffer Matrix { uvec4 matrix[]; };
layout(std430, binding = 1) readonly buffer X { vec4 x[]; };
layout(std430, binding = 2) writeonly buffer Y { vec4 y[]; };

vec4 low(uvec4 w) { return vec4(unpackHalf2x16(w.x), unpackHalf2x16(w.y)); }
vec4 high(uvec4 w) { return vec4(unpackHalf2x16(w.z), unpackHalf2x16(w.w)); }

#ifdef LL_ALONG

// x: quads × LL_COLUMNS × 2. One invocation sums LL_ROWS rows.
void main() {
  const uint first = invocation_index() * LL_ROWS;
  if (first >= push.rows) return;
  vec3 sum[LL_ROWS];
  [[unroll]] for (uint k = 0; k < LL_ROWS; ++k) sum[k] = vec3(0.0);
  for (uint e = 0; e < push.quads; ++e) {
    vec4 v[2 * LL_COLUMNS];
    [[unroll]] for (uint n = 0; n < 2 * LL_COLUMNS; ++n) v[n] = x[2 * LL_COLUMNS * e + n];
    [[unroll]] for (uint k = 0; k < LL_ROWS; ++k) {
      const uvec4 w = matrix[(first + k) * push.quads + e];
      const vec4 w0 = low(w), w1 = high(w);
      [[unroll]] for (uint c = 0; c < LL_COLUMNS; ++c) sum[k][c] += dot(v[2 * c], w0) + dot(v[2 * c + 1], w1);
    }
  }
  [[unroll]] for (uint k = 0; k < LL_ROWS; ++k) y[first + k] = vec4(sum[k], 0.0);
}

#else

// x: rows. One invocation has 8·LL_ROWS results, those of LL_ROWS quads of each row.
void main() {
  const uint o = invocation_index();
  const uint step = push.quads / LL_ROWS;
  if (o >= step) return;
  vec4 sum[2 * LL_COLUMNS * LL_ROWS];
  [[unroll]] for (uint n = 0; n < 2 * LL_COLUMNS * LL_ROWS; ++n) sum[n] = vec4(0.0);
  for (uint k = 0; k < push.rows; ++k) {
    const vec4 v = x[k];
    [[unroll]] for (uint q = 0; q < LL_ROWS; ++q) {
      const uvec4 w = matrix[k * push.quads + q * step + o];
      const vec4 w0 = low(w), w1 = high(w);
      [[unroll]] for (uint c = 0; c < LL_COLUMNS; ++c) {
        sum[2 * (LL_COLUMNS * q + c)] += v[c] * w0;
        sum[2 * (LL_COLUMNS * q + c) + 1] += v[c] * w1;
      }
    }
  }
  [[unroll]] for (uint n = 0; n < 2 * LL_COLUMNS * LL_ROWS; ++n) y[2 * LL_COLUMNS * LL_ROWS * o + n] = sum[n];
}

#endif
