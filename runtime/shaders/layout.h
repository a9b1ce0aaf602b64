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

/// Invocations of a workgroup where the specialisation does not say otherwise.
LL_CONSTANT uint kDefaultGroup = 64u;
/// Probes of one workgroup of the relight pass, and their rays that it keeps in shared memory at a time.
LL_CONSTANT uint kRelightProbes = 4u;
LL_CONSTANT uint kRayTile = 64u;
/// Columns of a cluster that one workgroup of the project pass computes.
LL_CONSTANT uint kJobColumns = 16u;
/// Receivers of one octet, the halfs of a uvec4.
LL_CONSTANT uint kOctet = 8u;
/// Octets of one workgroup of the receive pass.
LL_CONSTANT uint kReceiveOctets = 64u;
/// Buffers that hold relight sets, and that hold cells, at most.
LL_CONSTANT uint kMaxPools = 64u;
/// Slots of a pool are a multiple of this.
LL_CONSTANT uint kSlotGranule = 64u;
/// The unit in which cells lie in their pool, bytes.
LL_CONSTANT uint kCellUnit = 32u;

/// Instead of a surface element. Relight rays: RelightChunk::kDead, kSky. Receivers: padding of the last octet. Image
/// texels: none near.
LL_CONSTANT uint kDead = 0xffffffffu;
LL_CONSTANT uint kSky = 0xfffffffeu;
LL_CONSTANT uint kNoElement = 0xffffffffu;
/// Image texels that take a neighbour's element.
LL_CONSTANT uint kDilated = 0x80000000u;
/// The cell has another model than before: its E goes to the new values little by little.
LL_CONSTANT uint kFades = 0x80000000u;
/// Slots without probe.
LL_CONSTANT uint kNoProbe = 0xffffffffu;

/// vkCmdDispatchIndirect's.
struct Groups {
  uint x, y, z;
};

/// What passes tell each other and the host; all but the first row is 0 at the start of a frame.
struct Control {
  uint probe_cursor, cell_cursor, unused0, unused1;
  uint changed_tiles, updated_probes, waiting_probes, updated_cells;
  uint waiting_cells, project_quads, receive_quads, coarse_probes;  // of the updated ones: with few rays
  uint limit[3];                                                    // greatest |radiance| of anything, float bits
  uint unused3;
  Groups mark, mark_cells, image;
  uint unused4[3];
  Groups relight[kMaxPools];
  uint relight_count[kMaxPools];
  Groups project[kMaxPools];
  Groups receive[kMaxPools];
  uint first_cell[kMaxPools];  // of the pool's list of cells to update
  uint cells[kMaxPools];
  uint jobs[kMaxPools];    // workgroups of the project pass
  uint groups[kMaxPools];  // workgroups of the receive pass
};

/// A bake cell of the manifest, as far as it is resident.
struct Cell {
  uint pool, base;                    // where it lies, in kCellUnit
  uint jobs, octets;                  // all
  uint first_probe, probes;           // its probe list
  uint live;                          // 0: not there with all its probes; else a number that is new each time it is
  uint project_quads, receive_quads;  // uvec4 that the passes read
  uint unused0, unused1, unused2;
};
/// A place for a probe's relight set.
struct Slot {
  uint probe;
  uint generation;  // new each time
};
/// A cell to be updated. Its workgroups are those from first_job, first_group on up to the next one's.
struct ActiveCell {
  uint base;
  uint octets;  // and kFades
  uint first_job, first_group;
};

/// At the start of a cell's block. Offsets from there, in words or quads (uvec4).
struct CellHeader {
  uint clusters;                                     // in units of Cluster
  uint jobs, probes, corrections, octets, elements;  // words
  uint uniforms, coefficients;                       // quads
  uint stride8;                                      // of a probe's halfs in a row of the matrix, in eights
  uint near_first, near;                             // words: per receiver of every octet and one more; NearTexel
  uint unused[5];
};
/// What a receiver sees close by: weight · B of an element adds to its irradiance.
struct NearTexel {
  uint element;
  float weight;
};
/// Quads are counted from the start of the block.
struct Cluster {
  uint projection;      // quad: K rows of probes·stride halfs
  uint reconstruction;  // quad: K rows of `octets` quads
  uint first_probe;     // into the block's probes
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

/// lightloom_light with what the pass needs precomputed.
struct Light {
  float position[3];
  uint type;
  float direction[3];
  uint first_view;
  float intensity[3];
  float range;
  float cone_scale, cone_offset;
  float unused0, unused1;
};
struct ShadowView {
  float columns[16];
  uint layer, unused0, unused1, unused2;
};

struct DirectPush {
  uint elements, lights;
  float map_size;
};
struct RadiosityPush {
  uint elements;
  float epsilon, floor;
  uint tile_shift;      // log2 of a tile's elements
  uint sky_tile;        // 0xffffffff: the sky is what it was
  uint mark_x, mark_y;  // groups of the mark pass
  float sky_r, sky_g, sky_b;
};
struct MarkPush {
  uint first_slot, slots;  // of this pool
  uint slot_words, rays, tile_words;
};
struct SelectProbesPush {
  uint slots, pool_slots, max_probes, frame, cell_groups, max_groups;
  uint coarse_pool;  // from this pool on relight sets have few rays
};
struct RelightPush {
  float sky_r, sky_g, sky_b;
  float scale;   // 4π/N
  uint rays;     // N
  uint stride8;  // sh_stride / 8
  uint first_slot, slot_words, pool;
};
struct MarkCellsPush {
  uint cells, frame;
  uint tile_words;  // of a cell's set of tiles
};
struct SelectCellsPush {
  uint cells, max_cells, image_groups, max_groups;
};
struct ProjectPush {
  uint stride8;  // of λ: sh_stride / 8
  uint pool;
};
struct ReceivePush {
  uint pool;
  uint target;  // where the targets begin in the buffer of E, in floats; 0: E takes its value at once
  uint keep;    // 1: only targets are written
};
struct SettlePush {
  uint values;  // 3·S
  uint target;  // as ReceivePush
  float alpha;
  float arrived, black;  // runtime/rounding.h
};
struct ImagePush {
  uint width, height, layers;
  float exposure;  // factor on E
};

#ifdef __cplusplus
static_assert(sizeof(Cluster) == kCellUnit && sizeof(CellHeader) % kCellUnit == 0 && sizeof(Cell) == 48);
static_assert(sizeof(Light) == 64 && sizeof(ShadowView) == 80 && sizeof(Control) % 16 == 0);
}  // namespace lightloom::gpu
#undef LL_CONSTANT
#else
layout(local_size_x_id = 0) in;
layout(constant_id = 0) const uint kGroup = 64u;
/// Dispatches are two-dimensional because one dimension may be limited to 65535 groups.
uint group_index() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }
uint invocation_index() { return group_index() * kGroup + gl_LocalInvocationIndex; }
#endif

#endif  // LIGHTLOOM_SHADERS_LAYOUT_H
