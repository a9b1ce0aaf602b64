// What C++ and the shaders of the renderer agree on. Included by both.
#ifndef LIGHTLOOM_RENDERER_FRAME_H
#define LIGHTLOOM_RENDERER_FRAME_H

#ifdef __cplusplus
#include <array>
#include <cstdint>
namespace lightloom::renderer::gpu {
using uint = uint32_t;
using vec4 = std::array<float, 4>;   // NOLINT(readability-identifier-naming): as GLSL says
using mat4 = std::array<float, 16>;  // NOLINT(readability-identifier-naming): column-major
#define LL_CONSTANT inline constexpr
#else
#define LL_CONSTANT const
#endif

/// Of LightData.type: LightType.
LL_CONSTANT uint kPoint = 0u;
LL_CONSTANT uint kSpot = 1u;
LL_CONSTANT uint kDirectional = 2u;

/// Of FrameData.layer: Layer.
LL_CONSTANT uint kFull = 0u;
LL_CONSTANT uint kDirect = 1u;
LL_CONSTANT uint kIndirect = 2u;
LL_CONSTANT uint kE = 3u;
LL_CONSTANT uint kAlbedo = 4u;

/// Texture coordinates above this: the mesh has none, and the texture is taken as white.
LL_CONSTANT float kNoUv = 1e8;

struct FrameData {
  mat4 view_projection;
  vec4 eye;  // w unused
  uint lights;
  uint layer;
  uint shadow_size;  // texels along a side
  uint unused;
};

struct LightData {
  vec4 position_range;  // range 0: unlimited
  vec4 direction;       // unit, the way the light travels; w: how wide a shadow texel is, metres (directional), metres
                        // per metre of depth (others)
  vec4 colour;          // rgb × intensity
  float cos_outer;
  float cone_scale;  // 1 ÷ (cos inner − cos outer)
  uint type;
  uint first_view;
};

struct ViewData {
  mat4 view_projection;
  uint layer;
  uint unused0, unused1, unused2;
};

/// Factors of a material. Alpha below the cutoff lets through; a cutoff of -1: opaque.
struct MaterialPush {
  vec4 base_colour;  // a: alpha
  vec4 emission;     // a: cutoff
  uint double_sided;
};

struct ShadowPush {
  mat4 view_projection;
  float alpha;
  float cutoff;
};

/// Exposure 0: the values are shown as they are.
struct ToneMapPush {
  float exposure;
};

/// What lies on a surface is drawn before it: its depth (1 near) is taken times `nearer`.
struct LinesPush {
  mat4 view_projection;
  float nearer;
};

#ifdef __cplusplus
static_assert(sizeof(FrameData) == 96 && sizeof(LightData) == 64 && sizeof(ViewData) == 80);
static_assert(sizeof(MaterialPush) == 36 && sizeof(ShadowPush) == 72 && sizeof(LinesPush) == 68);
}  // namespace lightloom::renderer::gpu
#undef LL_CONSTANT
#endif

#endif  // LIGHTLOOM_RENDERER_FRAME_H
