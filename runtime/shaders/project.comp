// Coefficients of each cluster from the radiance λ at its P probes (SL17 Eq. 11, core/asset/chunk.h):
//   c_0 = Σ_i √(4π)·λ_i0 ÷ (4π·P)
//   c_k = Σ_ij projection[k][i][j]·λ_ij − correction[k]·c_0
// One workgroup per job. An invocation loads eight λ of each colour once and uses them for all columns of the job.
#version 450
#include "layout.h"

layout(local_size_x = kGroup) in;
layout(push_constant) uniform Push { ProjectPush push; };
layout(std430, binding = 0) readonly buffer Clusters { Cluster clusters[]; };
layout(std430, binding = 1) readonly buffer Jobs { Job jobs[]; };
layout(std430, binding = 2) readonly buffer Probes { uint probes[]; };
layout(std430, binding = 3) readonly buffer Corrections { float corrections[]; };
layout(std430, binding = 4) readonly buffer Matrix { uvec4 matrix[]; };
layout(std430, binding = 5) readonly buffer Lambda { vec4 lambda[]; };
layout(std430, binding = 6) writeonly buffer Coefficients { vec4 coefficients[]; };

const float kInvShUniform = 0.28209479177387814;  // √(4π) ÷ 4π
// Sums of a job: three colours of each column, then of c_0.
const uint kSums = 3 * (kJobColumns + 1);
const uint kRow = kGroup + 1;  // an odd stride keeps the summing invocations on different banks

shared float partial[kSums * kRow];
shared float sums[kSums];

float dot8(vec4 a0, vec4 a1, vec4 w0, vec4 w1) { return dot(a0, w0) + dot(a1, w1); }

void main() {
  const uint job = group_index();
  if (job >= push.jobs) return;
  const uint local = gl_LocalInvocationIndex;
  const Cluster cluster = clusters[jobs[job].cluster];
  const uint first = jobs[job].first_column;
  const uint columns = min(kJobColumns, cluster.rank - first);
  const uint row = cluster.probes * push.stride8;
  const uint stride4 = 2 * push.stride8;

  vec3 column[kJobColumns];
  for (uint k = 0; k < kJobColumns; ++k) column[k] = vec3(0.0);
  for (uint e = local; e < row; e += kGroup) {
    const uint i = e / push.stride8;
    const uint at = probes[cluster.first_probe + i] * 3 * stride4 + 2 * (e - i * push.stride8);
    const vec4 r0 = lambda[at], r1 = lambda[at + 1];
    const vec4 g0 = lambda[at + stride4], g1 = lambda[at + stride4 + 1];
    const vec4 b0 = lambda[at + 2 * stride4], b1 = lambda[at + 2 * stride4 + 1];
    for (uint k = 0; k < kJobColumns; ++k) {
      if (k >= columns) break;
      const uvec4 w = matrix[cluster.projection + (first + k) * row + e];
      const vec4 w0 = vec4(unpackHalf2x16(w.x), unpackHalf2x16(w.y));
      const vec4 w1 = vec4(unpackHalf2x16(w.z), unpackHalf2x16(w.w));
      column[k] += vec3(dot8(r0, r1, w0, w1), dot8(g0, g1, w0, w1), dot8(b0, b1, w0, w1));
    }
  }
  vec3 mean = vec3(0.0);
  for (uint i = local; i < cluster.probes; i += kGroup) {
    const uint at = probes[cluster.first_probe + i] * 3 * stride4;
    mean += vec3(lambda[at].x, lambda[at + stride4].x, lambda[at + 2 * stride4].x);
  }

  // Sum over the invocations, in a fixed order whatever the subgroups are.
  for (uint k = 0; k < kJobColumns; ++k) {
    for (uint c = 0; c < 3; ++c) partial[(3 * k + c) * kRow + local] = column[k][c];
  }
  for (uint c = 0; c < 3; ++c) partial[(3 * kJobColumns + c) * kRow + local] = mean[c];
  barrier();
  if (local < kSums) {
    float sum = 0.0;
    for (uint n = 0; n < kGroup; ++n) sum += partial[local * kRow + n];
    sums[local] = sum;
  }
  barrier();

  if (local > columns) return;
  const vec3 c0 = cluster.probes == 0 ? vec3(0.0)
                                      : vec3(sums[3 * kJobColumns], sums[3 * kJobColumns + 1],
                                             sums[3 * kJobColumns + 2]) * (kInvShUniform / float(cluster.probes));
  if (local == columns) {
    if (first == 0) coefficients[cluster.first_coefficient] = vec4(c0, 0.0);
  } else {
    const vec3 sum = vec3(sums[3 * local], sums[3 * local + 1], sums[3 * local + 2]);
    coefficients[cluster.first_coefficient + 1 + first + local] =
        vec4(sum - corrections[cluster.first_correction + first + local] * c0, 0.0);
  }
}
