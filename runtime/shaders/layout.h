// What C++ and the shaders agree on: constants, records in storage buffers (std430), push constants. Included by both.
#ifndef LIGHTLOOM_SHADERS_LAYOUT_H
#define LIGHTLOOM_SHADERS_LAYOUT_H

#ifdef __cplusplus
#include <cstdint>
namespace lightloom::gpu {
using uint = uint32_t;
#define LL_CONSTANT inline constexpr
#else
#define LL_CONSTANT const
#endif

/// Invocations of every workgroup.
LL_CONSTANT uint kGroup = 64u;
/// Probes of one workgroup of the relight pass, and their rays that it keeps in shared memory at a time.
LL_CONSTANT uint kRelightProbes = 4u;
LL_CONSTANT uint kRayTile = 64u;
/// Columns of a cluster that one workgroup of the project pass computes.
LL_CONSTANT uint kJobColumns = 8u;
/// Receivers of one octet, the halfs of a uvec4.
LL_CONSTANT uint kOctet = 8u;

/// Instead of a surface element. Relight rays: RelightChunk::kDead, kSky. Receivers: padding of the last octet.
LL_CONSTANT uint kDead = 0xffffffffu;
LL_CONSTANT uint kSky = 0xfffffffeu;
LL_CONSTANT uint kNoElement = 0xffffffffu;

/// Offsets are into the arrays of the cluster's page.
struct Cluster {
  uint projection;      // uvec4: K rows of probes·stride halfs
  uint reconstruction;  // uvec4: K rows of `octets` uvec4
  uint first_probe;     // into probes[]
  uint probes;          // P
  uint first_correction;
  uint rank;               // K
  uint first_coefficient;  // c_0..c_K, vec4 each
  uint octets;
};

/// One workgroup of the project pass: columns [first_column, first_column + kJobColumns) of a cluster.
struct Job {
  uint cluster;
  uint first_column;
};

/// Eight receivers of a cluster, or the fewer that its last octet holds.
struct Octet {
  uint cluster;
  uint index;  // within the cluster
};

struct RadiosityPush {
  uint elements;
};
struct RelightPush {
  float sky_r, sky_g, sky_b;
  float scale;       // 4π/N
  uint rays;         // N
  uint stride8;      // sh_stride / 8
  uint first_probe;  // of this page
  uint probes;       // in this page
};
struct ProjectPush {
  uint jobs;
  uint stride8;  // sh_stride / 8
};
struct ReceivePush {
  uint octets;
};

#ifdef __cplusplus
static_assert(sizeof(Cluster) == 32 && sizeof(Job) == 8 && sizeof(Octet) == 8);
static_assert(sizeof(RadiosityPush) == 4 && sizeof(RelightPush) == 32 && sizeof(ProjectPush) == 8 &&
              sizeof(ReceivePush) == 4);
}  // namespace lightloom::gpu
#undef LL_CONSTANT
#else
/// Dispatches are two-dimensional because one dimension may be limited to 65535 groups.
uint group_index() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }
#endif

#endif  // LIGHTLOOM_SHADERS_LAYOUT_H
