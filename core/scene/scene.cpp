#include "core/scene/scene.h"

#include <cmath>
#include <map>
#include <utility>

#include "core/scene/srgb.h"

namespace lightloom {
namespace {

// sRGB to linear, per 8-bit value.
const std::array<float, 256>& srgb_table() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (int i = 0; i < 256; ++i) {
      const double c = i / 255.0;
      t[static_cast<size_t>(i)] = static_cast<float>(from_srgb(c));
    }
    return t;
  }();
  return table;
}

int wrap(int i, int n, Wrap mode) {
  switch (mode) {
    case Wrap::kClamp:
      return std::clamp(i, 0, n - 1);
    case Wrap::kMirror: {
      const int period = 2 * n;
      const int m = ((i % period) + period) % period;
      return m < n ? m : period - 1 - m;
    }
    case Wrap::kRepeat:
      break;
  }
  return ((i % n) + n) % n;
}

/// The four texels around uv and their weights.
struct Footprint {
  std::array<size_t, 4> texel;
  std::array<float, 4> weight;
};

Footprint footprint(const Texture& t, Vec2 uv) {
  // A coordinate far outside [0,1] would overflow int: its fraction is noise anyway.
  const auto tame = [](float c) { return std::abs(c) < 1e6f ? c : 0.0f; };
  const float x = tame(uv.x) * static_cast<float>(t.width) - 0.5f;
  const float y = tame(uv.y) * static_cast<float>(t.height) - 0.5f;
  const float fx = std::floor(x), fy = std::floor(y);
  const float ax = x - fx, ay = y - fy;
  const int x0 = wrap(static_cast<int>(fx), t.width, t.wrap_s);
  const int x1 = wrap(static_cast<int>(fx) + 1, t.width, t.wrap_s);
  const int y0 = wrap(static_cast<int>(fy), t.height, t.wrap_t);
  const int y1 = wrap(static_cast<int>(fy) + 1, t.height, t.wrap_t);
  const auto at = [&](int xx, int yy) {
    return (static_cast<size_t>(yy) * static_cast<size_t>(t.width) + static_cast<size_t>(xx)) * 4;
  };
  return {{at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1)},
          {(1 - ax) * (1 - ay), ax * (1 - ay), (1 - ax) * ay, ax * ay}};
}

const std::vector<Vec2>& uv_set(const Object& object, int set) { return set == 1 ? object.uv1 : object.uv0; }

}  // namespace

Vec3 Texture::sample(Vec2 uv) const {
  const Footprint f = footprint(*this, uv);
  Vec3 sum;
  for (size_t i = 0; i < 4; ++i) {
    const uint8_t* p = &rgba[f.texel[i]];
    const Vec3 c = srgb ? Vec3{srgb_table()[p[0]], srgb_table()[p[1]], srgb_table()[p[2]]}
                        : Vec3{p[0] / 255.0f, p[1] / 255.0f, p[2] / 255.0f};
    sum += c * f.weight[i];
  }
  return sum;
}

float Texture::sample_alpha(Vec2 uv) const {
  const Footprint f = footprint(*this, uv);
  float sum = 0;
  for (size_t i = 0; i < 4; ++i) sum += rgba[f.texel[i] + 3] / 255.0f * f.weight[i];
  return sum;
}

Aabb Scene::bounds() const {
  Aabb box;
  for (const Object& object : objects) {
    if (!object.is_static) continue;
    for (const Vec3 p : object.positions) box.extend(p);
  }
  return box;
}

uint64_t Scene::triangle_count() const {
  uint64_t n = 0;
  for (const Object& object : objects) n += object.triangles.size();
  return n;
}

void assign_object_ids(Scene* scene) {
  std::map<std::pair<Digest, Transform>, uint32_t> seen;
  for (Object& object : scene->objects) {
    object.ordinal = seen[{object.mesh_hash, object.transform}]++;
    Hasher h;
    h.string("object").digest(object.mesh_hash);
    h.bytes(object.transform.data(), sizeof object.transform).value(object.ordinal);
    object.id = h.finish();
  }
}

Vec2 interpolate(const std::vector<Vec2>& values, const Triangle& t, float b1, float b2) {
  return values[t.v[0]] * (1 - b1 - b2) + values[t.v[1]] * b1 + values[t.v[2]] * b2;
}

Vec3 interpolate(const std::vector<Vec3>& values, const Triangle& t, float b1, float b2) {
  return values[t.v[0]] * (1 - b1 - b2) + values[t.v[1]] * b1 + values[t.v[2]] * b2;
}

Vec3 albedo_at(const Scene& scene, const Object& object, const Triangle& t, float b1, float b2) {
  const Material& m = scene.materials[t.material];
  Vec3 c = m.base_color;
  const auto& uv = uv_set(object, m.base_color_uv);
  if (m.base_color_texture >= 0 && !uv.empty()) {
    c = c * scene.textures[static_cast<size_t>(m.base_color_texture)].sample(interpolate(uv, t, b1, b2));
  }
  return {std::clamp(c.x, 0.0f, 1.0f), std::clamp(c.y, 0.0f, 1.0f), std::clamp(c.z, 0.0f, 1.0f)};
}

Vec3 emission_at(const Scene& scene, const Object& object, const Triangle& t, float b1, float b2) {
  const Material& m = scene.materials[t.material];
  const auto& uv = uv_set(object, m.emission_uv);
  if (m.emission_texture < 0 || uv.empty() || m.emission == Vec3{}) return m.emission;
  return m.emission * scene.textures[static_cast<size_t>(m.emission_texture)].sample(interpolate(uv, t, b1, b2));
}

bool opaque_at(const Scene& scene, const Object& object, const Triangle& t, float b1, float b2) {
  const Material& m = scene.materials[t.material];
  if (m.alpha_mode != AlphaMode::kMask) return true;
  float alpha = m.alpha;
  const auto& uv = uv_set(object, m.base_color_uv);
  if (m.base_color_texture >= 0 && !uv.empty()) {
    alpha *= scene.textures[static_cast<size_t>(m.base_color_texture)].sample_alpha(interpolate(uv, t, b1, b2));
  }
  return alpha >= m.alpha_cutoff;
}

Incident incident_light(const Light& light, Vec3 point) {
  if (light.type == LightType::kDirectional) {
    return {light.color * light.intensity, -light.direction, std::numeric_limits<float>::infinity()};
  }
  const Vec3 d = light.position - point;
  const float distance = length(d);
  if (!(distance > 0) || (light.range > 0 && distance > light.range)) return {};
  Incident in{light.color * (light.intensity / (distance * distance)), d / distance, distance};
  if (light.type == LightType::kSpot) {
    // Cone falloff as KHR_lights_punctual recommends.
    const float cos_outer = std::cos(light.outer_cone_angle), cos_inner = std::cos(light.inner_cone_angle);
    const float scale = 1.0f / std::max(0.001f, cos_inner - cos_outer);
    const float a = std::clamp((-dot(light.direction, in.to_light) - cos_outer) * scale, 0.0f, 1.0f);
    in.irradiance *= a * a;
  }
  return in;
}

}  // namespace lightloom
