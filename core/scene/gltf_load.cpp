#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/scene/affine.h"
#include "core/scene/gltf.h"
#include "core/scene/gltf_container.h"
#include "core/scene/gltf_material.h"
#include "core/scene/gltf_mesh.h"
#include "core/scene/gltf_transform.h"
#include "core/scene/gltf_warnings.h"

namespace lightloom {
namespace {

absl::Status invalid(std::string message) { return absl::InvalidArgumentError(std::move(message)); }

Vec3 axis(const Transform& m, size_t column, double sign = 1) {
  return unit({sign * m[4 * column], sign * m[4 * column + 1], sign * m[4 * column + 2]});
}

Vec3 origin(const Transform& m) {
  return {static_cast<float>(m[12]), static_cast<float>(m[13]), static_cast<float>(m[14])};
}

class Loader {
 public:
  Loader(const tinygltf::Model& model, Scene* scene)
      : model_(model), scene_(scene), meshes_(model, scene, &warnings_) {}

  absl::Status load() {
    LL_RETURN_IF_ERROR(read_materials(model_, scene_, &warnings_));
    LL_ASSIGN_OR_RETURN(const std::vector<int> roots, root_nodes());
    LL_RETURN_IF_ERROR(visit_nodes(roots));
    scene_->warnings = warnings_.lines();
    if (scene_->triangle_count() == 0) return invalid("contains no triangles; give a level with meshes");
    assign_object_ids(scene_);
    return absl::OkStatus();
  }

 private:
  absl::StatusOr<std::vector<int>> root_nodes() const {
    if (!model_.scenes.empty()) {
      const int scene = model_.defaultScene < 0 ? 0 : model_.defaultScene;
      if (static_cast<size_t>(scene) >= model_.scenes.size()) {
        return invalid("its default scene " + std::to_string(scene) + " does not exist; export the file again");
      }
      return model_.scenes[static_cast<size_t>(scene)].nodes;
    }
    std::set<int> children;
    for (const tinygltf::Node& node : model_.nodes) children.insert(node.children.begin(), node.children.end());
    std::vector<int> roots;
    for (int i = 0; i < static_cast<int>(model_.nodes.size()); ++i) {
      if (!children.count(i)) roots.push_back(i);
    }
    return roots;
  }

  /// Depth first, in the file's order.
  absl::Status visit_nodes(const std::vector<int>& roots) {
    std::vector<std::pair<int, Transform>> stack;
    const auto push = [&](const std::vector<int>& nodes, const Transform& parent) {
      for (auto it = nodes.rbegin(); it != nodes.rend(); ++it) stack.emplace_back(*it, parent);
    };
    std::vector<bool> visited(model_.nodes.size(), false);
    push(roots, kIdentity);
    while (!stack.empty()) {
      const auto [index, parent] = stack.back();
      stack.pop_back();
      if (index < 0 || static_cast<size_t>(index) >= model_.nodes.size()) {
        return invalid("node " + std::to_string(index) + " does not exist; export the file again");
      }
      const auto i = static_cast<size_t>(index);
      const tinygltf::Node& node = model_.nodes[i];
      const std::string whose = "node " + std::to_string(index) + " " + shown(node.name);
      if (visited[i]) return invalid(whose + " is reached twice: nodes must form trees; export the file again");
      visited[i] = true;

      const auto local = local_transform(node.matrix, node.translation, node.rotation, node.scale);
      if (!local.ok()) return invalid(whose + ": " + std::string(local.status().message()));
      const Transform world = compose(parent, *local);
      if (!std::all_of(world.begin(), world.end(), [](double v) { return std::abs(v) < 1e15; })) {
        return invalid(whose + ": its transform is not finite; reset it");
      }
      if (node.mesh >= 0) LL_RETURN_IF_ERROR(add_object(node, index, whose, world));
      if (node.camera >= 0) LL_RETURN_IF_ERROR(add_camera(node, whose, world));
      LL_RETURN_IF_ERROR(add_light(node, whose, world));
      push(node.children, world);
    }
    return absl::OkStatus();
  }

  /// Messages and edits refer to objects by name, so every object has one of its own.
  std::string object_name(const std::string& wanted, int index) {
    std::string base = wanted.empty() ? "node " + std::to_string(index) : wanted;
    for (char& c : base) {
      if (static_cast<unsigned char>(c) < 32 || c == 127) c = '?';
    }
    std::string name = base;
    for (uint64_t& n = copies_[base]; !names_.insert(name).second;) name = base + " #" + std::to_string(++n + 1);
    return name;
  }

  absl::Status add_object(const tinygltf::Node& node, int index, const std::string& whose, const Transform& world) {
    Object object;
    object.name = object_name(node.name, index);
    object.transform = world;
    object.node = index;
    LL_RETURN_IF_ERROR(read_extras(node.extras, whose, &object));
    LL_RETURN_IF_ERROR(meshes_.read(node.mesh, &object));
    if (node.skin >= 0) warnings_.add("nodes had skins, which were ignored", object.name);
    if (object.triangles.empty()) {
      warnings_.add("objects without triangles were left out", object.name);
      return absl::OkStatus();
    }
    scene_->objects.push_back(std::move(object));
    return absl::OkStatus();
  }

  absl::Status read_extras(const tinygltf::Value& extras, const std::string& whose, Object* object) {
    if (!extras.Has("lightloom")) return absl::OkStatus();
    const tinygltf::Value& ours = extras.Get("lightloom");
    const std::string where = whose + ": extras.lightloom";
    if (!ours.IsObject()) return invalid(where + " must be an object");
    for (const std::string& key : ours.Keys()) {
      const tinygltf::Value& value = ours.Get(key);
      if (key == "static") {
        if (!value.IsBool()) return invalid(where + ".static must be true or false");
        object->is_static = value.Get<bool>();
      } else if (key == "texel_scale") {
        object->texel_scale = value.IsNumber() ? static_cast<float>(value.GetNumberAsDouble()) : 0;
        if (!(object->texel_scale > 0) || !std::isfinite(object->texel_scale)) {
          return invalid(where + ".texel_scale must be a number above 0");
        }
      } else if (key == "receive") {
        const std::string text = value.IsString() ? value.Get<std::string>() : "";
        if (text != "lightmap" && text != "volume" && text != "none") {
          return invalid(where + R"(.receive must be "lightmap", "volume" or "none")");
        }
        object->receive = text == "lightmap" ? Receive::kLightmap
                          : text == "volume" ? Receive::kVolume
                                             : Receive::kNone;
      } else {
        warnings_.add("unknown keys of extras.lightloom were ignored", node_label(object->name, key));
      }
    }
    return absl::OkStatus();
  }

  static std::string node_label(const std::string& name, const std::string& key) { return name + ": " + key; }

  absl::Status add_camera(const tinygltf::Node& node, const std::string& whose, const Transform& world) {
    if (static_cast<size_t>(node.camera) >= model_.cameras.size()) {
      return invalid(whose + " uses camera " + std::to_string(node.camera) + ", which does not exist");
    }
    const tinygltf::Camera& in = model_.cameras[static_cast<size_t>(node.camera)];
    if (in.type != "perspective") {
      warnings_.add("cameras that are not perspective were left out", node.name);
      return absl::OkStatus();
    }
    Camera out;
    out.name = !node.name.empty() ? node.name : in.name;
    out.position = origin(world);
    out.forward = axis(world, 2, -1);
    const Vec3 side = cross(out.forward, axis(world, 1));
    out.right = unit({side.x, side.y, side.z});
    out.up = cross(out.right, out.forward);
    out.yfov = static_cast<float>(in.perspective.yfov);
    if (in.perspective.aspectRatio > 0) out.aspect = static_cast<float>(in.perspective.aspectRatio);
    if (!(out.yfov > 0 && out.yfov < std::numbers::pi_v<float>) || !std::isfinite(out.aspect) || !(out.aspect > 0)) {
      return invalid(whose + ": its camera's yfov must lie in (0, pi) and its aspect ratio above 0");
    }
    if (out.right == Vec3{}) return invalid(whose + ": a camera cannot be scaled to nothing; reset its scale");
    scene_->cameras.push_back(out);
    return absl::OkStatus();
  }

  absl::Status add_light(const tinygltf::Node& node, const std::string& whose, const Transform& world) {
    const auto extension = node.extensions.find("KHR_lights_punctual");
    if (extension == node.extensions.end()) return absl::OkStatus();
    const tinygltf::Value* value = extension->second.Has("light") ? &extension->second.Get("light") : nullptr;
    const int index = value && value->IsInt() ? value->GetNumberAsInt() : -1;
    if (index < 0 || static_cast<size_t>(index) >= model_.lights.size()) {
      return invalid(whose + " uses a light that does not exist; export the file again");
    }
    const tinygltf::Light& in = model_.lights[static_cast<size_t>(index)];

    Light out;
    if (in.type == "point") {
      out.type = LightType::kPoint;
    } else if (in.type == "spot") {
      out.type = LightType::kSpot;
    } else if (in.type == "directional") {
      out.type = LightType::kDirectional;
    } else {
      return invalid(whose + ": light type " + shown(in.type) + " is unknown; use point, spot or directional");
    }
    out.name = !node.name.empty() ? node.name : in.name;
    out.position = origin(world);
    if (out.type != LightType::kPoint) {
      out.direction = axis(world, 2, -1);
      if (out.direction == Vec3{}) return invalid(whose + ": a light cannot be scaled to nothing; reset its scale");
    }
    if (!in.color.empty() && in.color.size() != 3) return invalid(whose + ": its light's color must have 3 numbers");
    for (int c = 0; c < 3 && !in.color.empty(); ++c)
      out.color[c] = static_cast<float>(in.color[static_cast<size_t>(c)]);
    out.intensity = static_cast<float>(in.intensity);
    out.range = static_cast<float>(in.range);
    out.inner_cone_angle = static_cast<float>(in.spot.innerConeAngle);
    out.outer_cone_angle = static_cast<float>(in.spot.outerConeAngle);
    for (const float v : {out.color.x, out.color.y, out.color.z, out.intensity, out.range}) {
      if (!(v >= 0) || !std::isfinite(v)) {
        return invalid(whose + ": its light's color, intensity and range must be finite and not negative");
      }
    }
    if (out.type == LightType::kSpot && !(out.inner_cone_angle >= 0 && out.inner_cone_angle <= out.outer_cone_angle &&
                                          out.outer_cone_angle > 0 && out.outer_cone_angle <= 1.5708f)) {
      return invalid(whose + ": its light's cone angles must be 0 <= inner <= outer <= pi/2");
    }
    scene_->lights.push_back(std::move(out));
    return absl::OkStatus();
  }

  const tinygltf::Model& model_;
  Scene* scene_;
  GltfWarnings warnings_;
  MeshReader meshes_;
  std::set<std::string> names_;
  std::map<std::string, uint64_t> copies_;
};

}  // namespace

absl::StatusOr<Scene> load_gltf(const std::filesystem::path& path) {
  const auto in_file = [&](const absl::Status& status) {
    // Errors of the file system name the path already.
    if (status.message().find(path.string()) != std::string_view::npos) return status;
    return absl::Status(status.code(), path.string() + ": " + std::string(status.message()));
  };
  auto model = read_gltf_model(path);
  if (!model.ok()) return in_file(model.status());
  Scene scene;
  if (absl::Status status = Loader(**model, &scene).load(); !status.ok()) return in_file(status);
  return scene;
}

}  // namespace lightloom
