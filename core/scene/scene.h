// The level as every stage sees it: world-space triangles grouped by object, materials, lights, cameras.
//
// Units: metres; light intensities of KHR_lights_punctual are read 1:1 as radiometric (point, spot: W/sr; directional:
// W/m²) and this is the one place that says so. Colours are linear Rec.709. Axes are glTF's: right-handed, y up.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/hash.h"
#include "core/base/vec.h"

namespace lightloom {

enum class Wrap : uint8_t { kRepeat, kClamp, kMirror };

/// 8-bit RGBA image, row 0 first (v = 0). `srgb` says how rgb decodes to linear; alpha is always linear.
struct Texture {
  std::string name;
  int width = 0, height = 0;
  bool srgb = true;
  Wrap wrap_s = Wrap::kRepeat, wrap_t = Wrap::kRepeat;
  std::vector<uint8_t> rgba;

  /// Bilinear sample, linear rgb in [0,1].
  Vec3 sample(Vec2 uv) const;
  /// Bilinear alpha in [0,1].
  float sample_alpha(Vec2 uv) const;
};

enum class AlphaMode : uint8_t { kOpaque, kMask, kBlend };

/// Lambertian reflector and emitter.
struct Material {
  std::string name;
  Vec3 base_color{1, 1, 1};
  float alpha = 1;
  int base_color_texture = -1;  ///< index into Scene::textures, -1: none
  int base_color_uv = 0;        ///< which TEXCOORD set
  Vec3 emission{0, 0, 0};       ///< emitted radiance, W·m⁻²·sr⁻¹ (emissiveFactor × KHR emissiveStrength)
  int emission_texture = -1;
  int emission_uv = 0;
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  float alpha_cutoff = 0.5f;
  bool double_sided = false;
};

struct Triangle {
  std::array<uint32_t, 3> v{};  ///< indices into the object's vertex arrays, counter-clockwise seen from the front
  uint32_t material = 0;        ///< index into Scene::materials
};

/// What a static object gets from the bake.
enum class Receive : uint8_t { kLightmap, kVolume, kNone };

/// Column-major 4×4, double: a level may lie far from the origin.
using Transform = std::array<double, 16>;

/// One glTF node with a mesh, its geometry in world space.
struct Object {
  std::string name;
  Digest mesh_hash;  ///< of the local-space geometry and everything per triangle that geometry depends on
  Transform transform{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  uint32_t ordinal = 0;  ///< 0, 1, … among objects equal in mesh_hash and transform
  Digest id;             ///< of (mesh_hash, transform, ordinal): what receivers are keyed by
  int node = -1;         ///< of the glTF file it was read from

  std::vector<Vec3> positions;  ///< world space
  std::vector<Vec3> normals;    ///< world space, unit; one per vertex
  std::vector<Vec2> uv0;        ///< TEXCOORD_0, or empty
  std::vector<Vec2> uv1;        ///< TEXCOORD_1, or empty
  std::vector<Triangle> triangles;

  bool is_static = true;  ///< dynamic objects neither block, reflect nor receive in the bake
  float texel_scale = 1;  ///< lightmap texels per metre, relative to the scene's
  Receive receive = Receive::kLightmap;
};

enum class LightType : uint8_t { kPoint, kSpot, kDirectional };

struct Light {
  LightType type = LightType::kPoint;
  std::string name;
  Vec3 position;             ///< point, spot
  Vec3 direction{0, 0, -1};  ///< spot, directional: unit, the way the light travels
  Vec3 color{1, 1, 1};
  float intensity = 1;         ///< W/sr, or W/m² for directional
  float inner_cone_angle = 0;  ///< radians from the axis
  float outer_cone_angle = 0.7853981634f;
  float range = 0;  ///< metres; 0: unlimited
};

/// Perspective camera looking along `forward`.
struct Camera {
  std::string name;
  Vec3 position, right{1, 0, 0}, up{0, 1, 0}, forward{0, 0, -1};
  float yfov = 0.8f;  ///< radians
  float aspect = 1;   ///< width / height
};

struct Scene {
  std::vector<Object> objects;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::vector<Light> lights;
  std::vector<Camera> cameras;
  Vec3 environment{0, 0, 0};          ///< radiance of the sky, constant over directions
  std::vector<std::string> warnings;  ///< one line for each kind of usable defect, with counts and names

  /// Of the static objects.
  Aabb bounds() const;
  uint64_t triangle_count() const;
};

/// Fills Object::ordinal and Object::id from mesh_hash and transform, in order of appearance.
void assign_object_ids(Scene* scene);

/// Interpolates vertex attributes. b1, b2: barycentric weights of the second and third vertex.
Vec2 interpolate(const std::vector<Vec2>& values, const Triangle& triangle, float b1, float b2);
Vec3 interpolate(const std::vector<Vec3>& values, const Triangle& triangle, float b1, float b2);

/// Albedo in [0,1] and emitted radiance at a point of a triangle (emission is of the front side only).
Vec3 albedo_at(const Scene& scene, const Object& object, const Triangle& triangle, float b1, float b2);
Vec3 emission_at(const Scene& scene, const Object& object, const Triangle& triangle, float b1, float b2);
/// False where an alpha-masked material lets rays through.
bool opaque_at(const Scene& scene, const Object& object, const Triangle& triangle, float b1, float b2);

/// Irradiance per unit cosine at `point` by an unoccluded light, W·m⁻², and the unit direction towards the light with
/// its distance (infinity for directional). Zero outside the cone or range.
struct Incident {
  Vec3 irradiance;  ///< multiply by cosθ
  Vec3 to_light;
  float distance = 0;
};
Incident incident_light(const Light& light, Vec3 point);

}  // namespace lightloom
