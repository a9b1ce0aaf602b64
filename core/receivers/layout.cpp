#include "core/receivers/layout.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/receivers/mesh_topology.h"
#include "core/receivers/placement.h"
#include "core/receivers/uv_check.h"

namespace lightloom {
namespace {

constexpr int kMaxImageSide = 16384;  // of all objects' lightmaps together
constexpr double kDefaultTexels = 65536;

bool receives_lightmap(const Object& object) {
  return object.is_static && object.receive == Receive::kLightmap && !object.triangles.empty();
}

/// In m²; triangles that are not finite count nothing.
double area_of(const Object& object) {
  double area = 0;
  for (const Triangle& t : object.triangles) {
    const double a = triangle_area(object, t);
    if (std::isfinite(a)) area += a;
  }
  return area;
}

/// What area_of() is at texel_scale 1.
double scaled_area(const Object& object) { return area_of(object) * object.texel_scale * object.texel_scale; }

/// Rounded to three significant bits.
double round_coarsely(double value) {
  int exponent = 0;
  const double mantissa = std::frexp(value, &exponent);
  return std::ldexp(std::floor(mantissa * 8 + 0.5) / 8, exponent);
}

absl::Status check_arguments(const Scene& scene, const LayoutOptions& options) {
  if (options.lightmap_size < 0 || options.lightmap_size > kMaxLightmapSide) {
    return absl::InvalidArgumentError(absl::StrCat("lightmap size ", options.lightmap_size,
                                                   " is out of range; it must be 1 to ", kMaxLightmapSide, " texels"));
  }
  if (!(options.texels_per_metre >= 0) || !std::isfinite(options.texels_per_metre)) {
    return absl::InvalidArgumentError(
        absl::StrCat("texels per metre is ", options.texels_per_metre, "; it must be positive"));
  }
  for (const Object& object : scene.objects) {
    if (receives_lightmap(object) && !(object.texel_scale > 0 && std::isfinite(object.texel_scale))) {
      return absl::InvalidArgumentError(
          absl::StrCat("object '", object.name, "': texel scale is ", object.texel_scale, "; it must be positive"));
    }
    for (const Triangle& t : object.triangles) {
      if (*std::max_element(t.v.begin(), t.v.end()) >= object.positions.size()) {
        return absl::InvalidArgumentError(
            absl::StrCat("object '", object.name, "': a triangle index is beyond its vertices"));
      }
    }
  }
  return absl::OkStatus();
}

/// Texels per metre, of the options or from the scene's area.
double choose_density(const Scene& scene, const LayoutOptions& options) {
  if (options.texels_per_metre > 0) return options.texels_per_metre;
  double area = 0;
  for (const Object& object : scene.objects) {
    if (receives_lightmap(object)) area += scaled_area(object);
  }
  const double texels =
      options.lightmap_size > 0 ? double{1} * options.lightmap_size * options.lightmap_size : kDefaultTexels;
  return area > 0 && std::isfinite(area) ? round_coarsely(std::sqrt(texels / area)) : 1;
}

/// Side of a scene atlas in which objects have the wanted density on average: a multiple of 64, maybe too
/// large.
double scene_atlas_side(const Scene& scene, double texels_per_metre) {
  double texels = 0, uv_area = 0;
  for (const Object& object : scene.objects) {
    if (!receives_lightmap(object)) continue;
    texels += scaled_area(object) * texels_per_metre * texels_per_metre;
    uv_area += uv1_area(object);
  }
  const double side = uv_area > 0 ? std::sqrt(texels / uv_area) : 64;
  return std::max(64.0, 64 * std::ceil(side / 64));
}

/// The layout of mode kScene, or nothing if the objects' TEXCOORD_1 is no common atlas.
absl::StatusOr<std::optional<AtlasLayout>> scene_layout(const Scene& scene, const LayoutOptions& options,
                                                        double texels_per_metre) {
  for (const Object& object : scene.objects) {
    if (receives_lightmap(object) && !(has_unit_uv1(object) && uv1_area(object) > 0)) return std::nullopt;
  }
  const double wanted = options.lightmap_size > 0 ? options.lightmap_size : scene_atlas_side(scene, texels_per_metre);
  if (!(wanted <= kMaxLightmapSide)) {
    return absl::InvalidArgumentError(absl::StrCat("the scene's atlas would be ", wanted, " texels wide, over ",
                                                   kMaxLightmapSide, "; lower the texels per metre"));
  }
  const int side = static_cast<int>(wanted);
  AtlasLayout layout;
  layout.mode = LayoutMode::kScene;
  layout.width = layout.height = side;
  layout.uv.resize(scene.objects.size());
  layout.placements.resize(scene.objects.size());
  TexelClaims claims(side, side);
  for (size_t i = 0; i < scene.objects.size(); ++i) {
    if (!receives_lightmap(scene.objects[i])) continue;
    layout.uv[i] = scaled_uv1(scene.objects[i], side, side);
    claims.claim(layout.uv[i], static_cast<uint32_t>(i));
  }
  if (!claims.disjoint()) return std::nullopt;
  return std::optional(std::move(layout));
}

/// Metres per unit of u and of v, averaged over the surface: the lengths of dp/du and dp/dv.
Vec2 metres_per_uv(const Object& object) {
  double along_u = 0, along_v = 0, area = 0;
  for (const Triangle& t : object.triangles) {
    const Vec2 a = object.uv1[t.v[0]];
    const Vec2 e = object.uv1[t.v[1]] - a, f = object.uv1[t.v[2]] - a;
    const Vec3 p = object.positions[t.v[1]] - object.positions[t.v[0]];
    const Vec3 q = object.positions[t.v[2]] - object.positions[t.v[0]];
    const float determinant = e.x * f.y - f.x * e.y;
    const double weight = triangle_area(object, t);
    const double du = length((p * f.y - q * e.y) / determinant), dv = length((q * e.x - p * f.x) / determinant);
    if (!std::isfinite(weight * du) || !std::isfinite(weight * dv)) continue;
    along_u += weight * du;
    along_v += weight * dv;
    area += weight;
  }
  return area > 0 ? Vec2{static_cast<float>(along_u / area), static_cast<float>(along_v / area)} : Vec2{};
}

/// The object's own TEXCOORD_1 at the wanted density, cropped to what it uses; nothing if it is missing,
/// overlaps itself, or wastes so much of [0,1]² that the image would be too large.
std::optional<LightmapUv> own_uv1(const Object& object, double texels_per_metre) {
  if (!has_unit_uv1(object)) return std::nullopt;
  const double uv_area = uv1_area(object);
  const Vec2 metres = metres_per_uv(object);
  if (!(uv_area > 0) || !(metres.x > 0) || !(metres.y > 0)) return std::nullopt;

  // The means give the aspect, the areas the scale.
  const double wanted = scaled_area(object) * texels_per_metre * texels_per_metre / uv_area;
  const double aspect = double{metres.x} / metres.y;
  const double width = std::ceil(std::sqrt(wanted * aspect)), height = std::ceil(std::sqrt(wanted / aspect));
  if (!(width <= kMaxLightmapSide && height <= kMaxLightmapSide)) return std::nullopt;
  LightmapUv uv = scaled_uv1(object, std::max(1, static_cast<int>(width)), std::max(1, static_cast<int>(height)));

  Vec2 lo = uv.corners[0][0], hi = lo;
  for (const auto& corners : uv.corners) {
    for (const Vec2& p : corners) {
      lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)};
      hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
    }
  }
  const Vec2 origin{std::floor(lo.x), std::floor(lo.y)};
  for (auto& corners : uv.corners) {
    for (Vec2& p : corners) p = p - origin;
  }
  uv.width = std::max(1, static_cast<int>(std::ceil(hi.x - origin.x)));
  uv.height = std::max(1, static_cast<int>(std::ceil(hi.y - origin.y)));

  TexelClaims claims(uv.width, uv.height);
  claims.claim_each(uv);
  if (!claims.disjoint()) return std::nullopt;
  return uv;
}

absl::StatusOr<AtlasLayout> per_object_layout(const Scene& scene, const LayoutOptions& options,
                                              double texels_per_metre) {
  AtlasLayout layout;
  layout.mode = LayoutMode::kPerObject;
  layout.uv.resize(scene.objects.size());
  std::vector<RectSize> sizes(scene.objects.size());
  std::vector<Digest> ids(scene.objects.size());
  for (size_t i = 0; i < scene.objects.size(); ++i) {
    const Object& object = scene.objects[i];
    ids[i] = object.id;
    if (!receives_lightmap(object)) continue;
    if (std::optional<LightmapUv> own = own_uv1(object, texels_per_metre)) {
      layout.uv[i] = *std::move(own);
    } else {
      AtlasOptions atlas;
      atlas.texels_per_metre = static_cast<float>(texels_per_metre);
      atlas.max_size = kMaxLightmapSide;
      LL_ASSIGN_OR_RETURN(layout.uv[i], generate_atlas(object, atlas));
    }
    sizes[i] = {layout.uv[i].width, layout.uv[i].height};
  }
  LL_ASSIGN_OR_RETURN(PlacedImage image, place_objects(sizes, ids, options, kMaxImageSide));
  layout.width = image.width;
  layout.height = image.height;
  layout.placements = std::move(image.placements);
  return layout;
}

}  // namespace

absl::StatusOr<AtlasLayout> make_layout(const Scene& scene, const LayoutOptions& options) {
  LL_RETURN_IF_ERROR(check_arguments(scene, options));
  const double texels_per_metre = choose_density(scene, options);
  std::optional<AtlasLayout> common;
  AtlasLayout layout;
  if (std::none_of(scene.objects.begin(), scene.objects.end(), receives_lightmap)) {
    layout.mode = LayoutMode::kPerObject;
    layout.width = options.earlier_width;
    layout.height = options.earlier_height;
    layout.uv.resize(scene.objects.size());
    layout.placements.resize(scene.objects.size());
  } else {
    if (options.earlier_width <= 0) {
      LL_ASSIGN_OR_RETURN(common, scene_layout(scene, options, texels_per_metre));
    }
    if (common) {
      layout = *std::move(common);
    } else {
      LL_ASSIGN_OR_RETURN(layout, per_object_layout(scene, options, texels_per_metre));
    }
  }
  layout.texels_per_metre = static_cast<float>(texels_per_metre);
  return layout;
}

}  // namespace lightloom
