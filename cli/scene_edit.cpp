#include "cli/scene_edit.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <limits>
#include <map>
#include <sstream>

namespace lightloom {
namespace {

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::stringstream in(text);
  for (std::string part; std::getline(in, part, at);) parts.push_back(part);
  return parts;
}

absl::Status edit_objects(const std::string& option, const std::string& edits, float greatest, Scene* scene,
                          void (*change)(Vec3, Material*)) {
  for (const std::string& edit : split(edits, ';')) {
    const size_t colon = edit.rfind(':');
    if (colon == std::string::npos) {
      return absl::InvalidArgumentError(absl::StrCat(option, " '", edit, "' must be OBJECT:r,g,b"));
    }
    const std::string name = edit.substr(0, colon);
    LL_ASSIGN_OR_RETURN(const Vec3 value, parse_vec3(edit.substr(colon + 1)));
    for (int c = 0; c < 3; ++c) {
      if (!(value[c] >= 0 && value[c] <= greatest)) {
        return absl::InvalidArgumentError(
            absl::StrCat(option, " '", edit, "': a colour must be ", greatest <= 1 ? "0 to 1" : "≥ 0"));
      }
    }
    bool found = false;
    for (Object& object : scene->objects) {
      if (object.name != name) continue;
      found = true;
      own_materials(&object, scene);
      for (const Triangle& t : object.triangles) change(value, &scene->materials[t.material]);
    }
    if (!found) return absl::NotFoundError(absl::StrCat(option, ": the scene has no object '", name, "'"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Vec3> parse_vec3(const std::string& text) {
  std::istringstream in(text);
  in.imbue(std::locale::classic());
  Vec3 v;
  char comma1 = 0, comma2 = 0;
  std::string rest;
  if (!(in >> v.x >> comma1 >> v.y >> comma2 >> v.z) || comma1 != ',' || comma2 != ',' || in >> rest || !is_finite(v)) {
    return absl::InvalidArgumentError("'" + text + "' must be three numbers: x,y,z");
  }
  return v;
}

void own_materials(Object* object, Scene* scene) {
  std::map<uint32_t, uint32_t> own;
  for (Triangle& t : object->triangles) {
    const auto [it, added] = own.try_emplace(t.material, static_cast<uint32_t>(scene->materials.size()));
    if (added) {
      Material copy = scene->materials[t.material];
      scene->materials.push_back(std::move(copy));
    }
    t.material = it->second;
  }
}

void paint(Vec3 albedo, Material* m) {
  m->base_color = albedo;
  // The texture of a masked material holds the mask, which is geometry: it stays and is multiplied.
  if (m->alpha_mode != AlphaMode::kMask) m->base_color_texture = -1;
}

void shine(Vec3 radiance, Material* m) {
  m->emission = radiance;
  m->emission_texture = -1;
}

absl::Status set_albedo(const std::string& edits, Scene* scene) {
  return edit_objects("--set-albedo", edits, 1, scene, paint);
}

absl::Status set_emission(const std::string& edits, Scene* scene) {
  return edit_objects("--set-emission", edits, std::numeric_limits<float>::max(), scene, shine);
}

absl::StatusOr<LightPath> LightPath::parse(const std::string& light, const std::string& points, const Scene& scene) {
  LightPath path;
  if (light.empty() && scene.lights.size() != 1) {
    return absl::InvalidArgumentError("the level has " + std::to_string(scene.lights.size()) +
                                      " lights; name the one that moves with --light NAME");
  }
  while (path.light_ < scene.lights.size() && !light.empty() && scene.lights[path.light_].name != light) ++path.light_;
  if (path.light_ == scene.lights.size()) {
    std::string known;
    for (const Light& l : scene.lights) known += (known.empty() ? "" : ", ") + l.name;
    return absl::NotFoundError("the level has no light '" + light + "'; it has: " + (known.empty() ? "none" : known));
  }
  if (scene.lights[path.light_].type == LightType::kDirectional) {
    return absl::InvalidArgumentError("a directional light has no position to move; choose another --light");
  }
  for (const std::string& point : split(points, ';')) {
    LL_ASSIGN_OR_RETURN(const Vec3 p, parse_vec3(point));
    path.points_.push_back(p);
  }
  if (path.points_.size() < 2) return absl::InvalidArgumentError("--light-path needs two points or more: x,y,z;x,y,z");
  return path;
}

void LightPath::move(float t, Scene* scene) const {
  float total = 0;
  for (size_t i = 1; i < points_.size(); ++i) total += length(points_[i] - points_[i - 1]);
  float left = t * total;
  Vec3 at = points_.back();
  for (size_t i = 1; i < points_.size(); ++i) {
    const Vec3 step = points_[i] - points_[i - 1];
    const float l = length(step);
    if (left < l) {
      at = points_[i - 1] + step * (left / l);
      break;
    }
    left -= l;
  }
  scene->lights[light_].position = at;
}

}  // namespace lightloom
