#include <stb/stb_image_write.h>

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/file.h"
#include "core/base/text.h"
#include "core/scene/affine.h"
#include "core/scene/gltf.h"
#include "core/scene/gltf_container.h"

namespace lightloom {
namespace {

using Json = nlohmann::json;

enum Target { kNoTarget = 0, kArrayBuffer = 34962, kElementArrayBuffer = 34963 };

Json array(Vec3 v) { return {v.x, v.y, v.z}; }

/// Column-major, from the axes and origin of a frame.
Json matrix(Vec3 x, Vec3 y, Vec3 z, Vec3 o) {
  return {x.x, x.y, x.z, 0, y.x, y.y, y.z, 0, z.x, z.y, z.z, 0, o.x, o.y, o.z, 1};
}

class Writer {
 public:
  explicit Writer(const Scene& scene) : scene_(scene) {}

  absl::Status build() {
    root_["asset"] = {{"version", "2.0"}, {"generator", "lightloom"}};
    root_["scene"] = 0;
    for (const Texture& t : scene_.textures) LL_RETURN_IF_ERROR(add_texture(t));
    for (const Material& m : scene_.materials) root_["materials"].push_back(material(m));
    for (const Object& o : scene_.objects) {
      if (!o.triangles.empty()) add_object(o);
    }
    for (const Light& l : scene_.lights) add_light(l);
    for (const Camera& c : scene_.cameras) add_camera(c);
    Json nodes = Json::array();
    for (size_t i = 0; i < root_["nodes"].size(); ++i) nodes.push_back(i);
    root_["scenes"] = {{{"nodes", nodes}}};
    for (const char* extension : {"KHR_lights_punctual", "KHR_materials_emissive_strength"}) {
      if (uses(extension)) root_["extensionsUsed"].push_back(extension);
    }
    if (!bin_.empty()) root_["buffers"] = {{{"byteLength", bin_.size()}}};
    return absl::OkStatus();
  }

  absl::StatusOr<std::vector<uint8_t>> glb() const { return glb_bytes(root_.dump(), bin_); }

 private:
  bool uses(const std::string& extension) const {
    if (extension == "KHR_lights_punctual") return !scene_.lights.empty();
    return root_.contains("materials") && std::any_of(root_["materials"].begin(), root_["materials"].end(),
                                                      [](const Json& m) { return m.contains("extensions"); });
  }

  size_t add_view(const void* data, size_t size, Target target) {
    const size_t offset = bin_.size();
    const auto* bytes = static_cast<const uint8_t*>(data);
    bin_.insert(bin_.end(), bytes, bytes + size);
    bin_.resize((bin_.size() + 3) / 4 * 4, 0);
    Json view{{"buffer", 0}, {"byteOffset", offset}, {"byteLength", size}};
    if (target != kNoTarget) view["target"] = target;
    root_["bufferViews"].push_back(view);
    return root_["bufferViews"].size() - 1;
  }

  template <class T>
  size_t add_accessor(const std::vector<T>& values, const char* type, int component, Target target) {
    const size_t view = add_view(values.data(), values.size() * sizeof(T), target);
    root_["accessors"].push_back(
        {{"bufferView", view}, {"componentType", component}, {"count", values.size()}, {"type", type}});
    return root_["accessors"].size() - 1;
  }

  absl::Status add_texture(const Texture& t) {
    if (!t.srgb)
      return absl::InvalidArgumentError("texture \"" + printable(t.name) +
                                        "\" is not sRGB, which glTF has no word for");
    std::vector<uint8_t> png;
    const auto append = [](void* out, void* data, int size) {
      auto* bytes = static_cast<std::vector<uint8_t>*>(out);
      bytes->insert(bytes->end(), static_cast<uint8_t*>(data), static_cast<uint8_t*>(data) + size);
    };
    if (!stbi_write_png_to_func(append, &png, t.width, t.height, 4, t.rgba.data(), t.width * 4)) {
      return absl::ResourceExhaustedError("not enough memory to encode the texture \"" + printable(t.name) + "\"");
    }
    const size_t view = add_view(png.data(), png.size(), kNoTarget);
    const auto wrap = [](Wrap w) { return w == Wrap::kRepeat ? 10497 : w == Wrap::kClamp ? 33071 : 33648; };
    root_["images"].push_back({{"bufferView", view}, {"mimeType", "image/png"}, {"name", t.name}});
    root_["samplers"].push_back({{"wrapS", wrap(t.wrap_s)}, {"wrapT", wrap(t.wrap_t)}});
    const size_t index = root_["images"].size() - 1;
    root_["textures"].push_back({{"source", index}, {"sampler", index}});
    return absl::OkStatus();
  }

  static Json material(const Material& m) {
    const auto texture = [](int index, int uv) { return Json{{"index", index}, {"texCoord", uv}}; };
    Json pbr{{"baseColorFactor", {m.base_color.x, m.base_color.y, m.base_color.z, m.alpha}},
             {"metallicFactor", 0},
             {"roughnessFactor", 1}};
    if (m.base_color_texture >= 0) pbr["baseColorTexture"] = texture(m.base_color_texture, m.base_color_uv);
    Json out{{"name", m.name}, {"pbrMetallicRoughness", pbr}, {"doubleSided", m.double_sided}};
    if (m.emission != Vec3{}) {
      // Factors reach 1 only; the rest is strength. In double, factor · strength rounds back to the same
      // float.
      const double strength = std::max({1.0f, m.emission.x, m.emission.y, m.emission.z});
      out["emissiveFactor"] = {m.emission.x / strength, m.emission.y / strength, m.emission.z / strength};
      if (strength > 1) out["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] = strength;
    }
    if (m.emission_texture >= 0) out["emissiveTexture"] = texture(m.emission_texture, m.emission_uv);
    if (m.alpha_mode == AlphaMode::kBlend) out["alphaMode"] = "BLEND";
    if (m.alpha_mode == AlphaMode::kMask) {
      out["alphaMode"] = "MASK";
      out["alphaCutoff"] = m.alpha_cutoff;
    }
    return out;
  }

  /// One mesh: its primitives are the runs of triangles of one material, and share their vertices.
  void add_object(const Object& o) {
    Json node{{"name", o.name}};
    std::vector<Vec3> positions = o.positions, normals = o.normals;
    const double det = determinant(o.transform);
    // A flattened object has no local space to go back to: it is written where it stands.
    const bool moved = o.transform != kIdentity && det != 0;
    if (moved) {
      node["matrix"] = o.transform;
      to_local(o.transform, &positions, &normals);
    }

    Aabb box;
    for (const Vec3 p : positions) box.extend(p);
    Json attributes;
    const size_t position = add_accessor(positions, "VEC3", 5126, kArrayBuffer);
    root_["accessors"][position]["min"] = array(box.lo);
    root_["accessors"][position]["max"] = array(box.hi);
    attributes["POSITION"] = position;
    attributes["NORMAL"] = add_accessor(normals, "VEC3", 5126, kArrayBuffer);
    if (!o.uv0.empty()) attributes["TEXCOORD_0"] = add_accessor(o.uv0, "VEC2", 5126, kArrayBuffer);
    if (!o.uv1.empty()) attributes["TEXCOORD_1"] = add_accessor(o.uv1, "VEC2", 5126, kArrayBuffer);

    Json mesh{{"name", o.name}};
    for (size_t begin = 0; begin < o.triangles.size();) {
      const uint32_t material = o.triangles[begin].material;
      std::vector<uint32_t> indices;
      for (; begin < o.triangles.size() && o.triangles[begin].material == material; ++begin) {
        const auto& v = o.triangles[begin].v;
        const bool mirrored = moved && det < 0;
        indices.insert(indices.end(), {v[0], v[mirrored ? 2 : 1], v[mirrored ? 1 : 2]});
      }
      const size_t accessor = add_accessor(indices, "SCALAR", 5125, kElementArrayBuffer);
      mesh["primitives"].push_back({{"attributes", attributes}, {"indices", accessor}, {"material", material}});
    }
    root_["meshes"].push_back(mesh);
    node["mesh"] = root_["meshes"].size() - 1;

    Json ours;
    if (!o.is_static) ours["static"] = false;
    if (o.texel_scale != 1) ours["texel_scale"] = o.texel_scale;
    if (o.receive != Receive::kLightmap) ours["receive"] = o.receive == Receive::kVolume ? "volume" : "none";
    if (!ours.is_null()) node["extras"]["lightloom"] = ours;
    root_["nodes"].push_back(node);
  }

  static void to_local(const Transform& world, std::vector<Vec3>* positions, std::vector<Vec3>* normals) {
    const Transform back = inverse(world);
    for (Vec3& p : *positions) {
      const Dvec3 l = transform_point(back, {p.x, p.y, p.z});
      p = {static_cast<float>(l[0]), static_cast<float>(l[1]), static_cast<float>(l[2])};
    }
    for (Vec3& n : *normals) {  // the inverse of M⁻ᵀ is Mᵀ
      Dvec3 l{};
      for (size_t c = 0; c < 3; ++c) l[c] = world[4 * c] * n.x + world[4 * c + 1] * n.y + world[4 * c + 2] * n.z;
      n = unit(l);
    }
  }

  void add_light(const Light& l) {
    static constexpr const char* kTypes[] = {"point", "spot", "directional"};
    Json light{{"type", kTypes[static_cast<size_t>(l.type)]},
               {"name", l.name},
               {"color", array(l.color)},
               {"intensity", l.intensity}};
    if (l.range > 0) light["range"] = l.range;
    if (l.type == LightType::kSpot) {
      light["spot"] = {{"innerConeAngle", l.inner_cone_angle}, {"outerConeAngle", l.outer_cone_angle}};
    }
    Json& lights = root_["extensions"]["KHR_lights_punctual"]["lights"];
    lights.push_back(light);
    Json node{{"name", l.name}};
    node["extensions"]["KHR_lights_punctual"]["light"] = lights.size() - 1;
    Vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
    if (l.type != LightType::kPoint) {  // lights shine along their node's -z
      z = -l.direction;
      orthonormal_basis(z, &x, &y);
    }
    node["matrix"] = matrix(x, y, z, l.position);
    root_["nodes"].push_back(node);
  }

  void add_camera(const Camera& c) {
    root_["cameras"].push_back({{"type", "perspective"},
                                {"name", c.name},
                                {"perspective", {{"yfov", c.yfov}, {"aspectRatio", c.aspect}, {"znear", 0.05}}}});
    root_["nodes"].push_back({{"name", c.name},
                              {"camera", root_["cameras"].size() - 1},
                              {"matrix", matrix(c.right, c.up, -c.forward, c.position)}});
  }

  const Scene& scene_;
  Json root_;
  std::vector<uint8_t> bin_;
};

}  // namespace

absl::Status save_gltf(const Scene& scene, const std::filesystem::path& path) {
  const auto cannot = [&](const absl::Status& status) {
    return absl::Status(status.code(), "cannot write " + path.string() + ": " + std::string(status.message()));
  };
  Writer writer(scene);
  if (absl::Status status = writer.build(); !status.ok()) return cannot(status);
  auto bytes = writer.glb();
  if (!bytes.ok()) return cannot(bytes.status());
  return write_file_atomic(path, *bytes);
}

}  // namespace lightloom
