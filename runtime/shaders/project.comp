// Coefficients of each cluster from the radiance λ at its P probes (SL17 Eq. 11, core/asset/chunk.h):
//   c_0 = Σ_i √(4π)·λ_i0 ÷ (4π·P)
//   c_k = Σ_ij projection[k][i][j]·λ_ij − correction[k]·c_0
// One workgroup per job. An invocation loads eight λ of each colour once and uses them for all columns of the job.
#version 450
#extension GL_EXT_control_flow_attributes : require
#include "layout.h"

layout(push_constant) uniform Push { ProjectPush push; };
// The pool, as four types.
layout(std430, binding = 0) readonly buffer Clusters { Cluster clusters[]; };
layout(std430, binding = 1) readonly buffer Words { uint words[]; };
layout(std430, binding = 2) readonly buffer Quads { uvec4 matrix[]; };
layout(std430, binding = 3) writeonly buffer Coefficients { vec4 coefficients[]; };
layout(std430, binding = 4) readonly buffer Lambda { vec4 lambda[]; };
layout(std430, binding = 5) readonly buffer Active { ActiveCell active_cells[]; };
layout(std430, binding = 6) readonly buffer Shared { Control control; };

const float kInvShUniform = 0.28209479177387814;  // √(4π) ÷ 4π
// Sums of a job: three colours of each column, then of c_0.
const uint kSums = 3 * (kJobColumns + 1);
const uint kRow = kGroup + 1;  // an odd stride keeps the summing invocations on different banks

shared float partial[kSums * kRow];
shared float sums[kSums];

float dot8(vec4 a0, vec4 a1, vec4 w0, vec4 w1) { return dot(a0, w0) + dot(a1, w1); }

/// The last of the pool's cells whose first job is not behind `job`.
uint find_cell(uint job) {
  uint lo = control.first_cell[push.pool], hi = lo + control.cells[push.pool];
  while (hi - lo > 1) {
    const uint middle = (lo + hi) / 2;
    if (active_cells[middle].first_job <= job) lo = middle;
    else hi = middle;
  }
  return lo;
}

void main() {
  const uint group = group_index();
  if (group >= control.jobs[push.pool]) return;
  const uint cell = find_cell(group);
  const uint word = active_cells[cell].base * (kCellUnit / 4);
  const uint quad = active_cells[cell].base * (kCellUnit / 16);
  const uint job = word + words[word + 1] + 2 * (group - active_cells[cell].first_job);
  const uint local = gl_LocalInvocationIndex;
  const Cluster cluster = clusters[active_cells[cell].base + words[word] + words[job]];
  const uint first = words[job + 1];
  const uint probes = word + words[word + 2] + cluster.first_probe;
  const uint corrections = word + words[word + 3] + cluster.first_correction;
  const uint coefficient = quad + words[word + 7] + cluster.first_coefficient;
  const uint columns = min(kJobColumns, cluster.rank - first);
  const uint stride8 = words[word + 8];  // no more bands than λ has
  const uint row = cluster.probes * stride8;
  const uint stride4 = 2 * push.stride8;

  // Without a branch in the middle: where the job has fewer columns the last one is read again.
  vec3 column[kJobColumns];
  [[unroll]] for (uint k = 0; k < kJobColumns; ++k) column[k] = vec3(0.0);
  const uint matrix_at = quad + cluster.projection + first * row;
  for (uint e = local; columns > 0 && e < row; e += kGroup) {
    const uint i = e / stride8;
    const uint at = words[probes + i] * 3 * stride4 + 2 * (e - i * stride8);
    const vec4 r0 = lambda[at], r1 = lambda[at + 1];
    const vec4 g0 = lambda[at + stride4], g1 = lambda[at + stride4 + 1];
    const vec4 b0 = lambda[at + 2 * stride4], b1 = lambda[at + 2 * stride4 + 1];
    [[unroll]] for (uint k = 0; k < kJobColumns; ++k) {
      const uvec4 w = matrix[matrix_at + min(k, columns - 1) * row + e];
      const vec4 w0 = vec4(unpackHalf2x16(w.x), unpackHalf2x16(w.y));
      const vec4 w1 = vec4(unpackHalf2x16(w.z), unpackHalf2x16(w.w));
      column[k] += vec3(dot8(r0, r1, w0, w1), dot8(g0, g1, w0, w1), dot8(b0, b1, w0, w1));
    }
  }
  vec3 mean = vec3(0.0);
  for (uint i = local; i < cluster.probes; i += kGroup) {
    const uint at = words[probes + i] * 3 * stride4;
    mean += vec3(lambda[at].x, lambda[at + stride4].x, lambda[at + 2 * stride4].x);
  }

  // Sum over the invocations, in a fixed order whatever the subgroups are.
  [[unroll]] for (uint k = 0; k < kJobColumns; ++k) {
    [[unroll]] for (uint c = 0; c < 3; ++c) partial[(3 * k + c) * kRow + local] = column[k][c];
  }
  [[unroll]] for (uint c = 0; c < 3; ++c) partial[(3 * kJobColumns + c) * kRow + local] = mean[c];
  barrier();
  for (uint m = local; m < kSums; m += kGroup) {
    float sum = 0.0;
    for (uint n = 0; n < kGroup; ++n) sum += partial[m * kRow + n];
    sums[m] = sum;
  }
  barrier();

  const vec3 c0 = cluster.probes == 0 ? vec3(0.0)
                                      : vec3(sums[3 * kJobColumns], sums[3 * kJobColumns + 1],
                                             sums[3 * kJobColumns + 2]) * (kInvShUniform / float(cluster.probes));
  if (local == 0 && first == 0) coefficients[coefficient] = vec4(c0, 0.0);
  for (uint k = local; k < columns; k += kGroup) {
    const vec3 sum = vec3(sums[3 * k], sums[3 * k + 1], sums[3 * k + 2]);
    coefficients[coefficient + 1 + first + k] =
        vec4(sum - uintBitsToFloat(words[corrections + first + k]) * c0, 0.0);
  }
}
