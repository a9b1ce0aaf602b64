#include "core/scene/rig.h"

#include <cmath>
#include <exception>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "core/base/file.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

using Json = nlohmann::json;

constexpr size_t kMaxBytes = size_t{16} << 20;
constexpr size_t kMaxLights = 65536;  // in a file

absl::Status invalid(std::string message) { return absl::InvalidArgumentError(std::move(message)); }

absl::Status check_keys(const Json& object, const std::set<std::string>& known, const std::string& where) {
  if (!object.is_object()) return invalid(where + " must be an object");
  for (const auto& [key, value] : object.items()) {
    if (known.count(key)) continue;
    std::string list;
    for (const std::string& k : known) list += (list.empty() ? "" : ", ") + k;
    return invalid(where + " has the unknown key \"" + printable(key) + "\"; it may have " + list);
  }
  return absl::OkStatus();
}

absl::StatusOr<float> number(const Json& value, const std::string& where) {
  if (value.is_number()) {
    const auto v = static_cast<float>(value.get<double>());
    if (std::isfinite(v)) return v;
  }
  return invalid(where + " must be a finite number");
}

absl::StatusOr<Vec3> vector(const Json& value, const std::string& where) {
  if (!value.is_array() || value.size() != 3) return invalid(where + " must be an array of 3 numbers");
  Vec3 out;
  for (int c = 0; c < 3; ++c) {
    LL_ASSIGN_OR_RETURN(out[c], number(value[static_cast<size_t>(c)], where + "[" + std::to_string(c) + "]"));
  }
  return out;
}

absl::StatusOr<Vec3> color(const Json& value, const std::string& where) {
  LL_ASSIGN_OR_RETURN(const Vec3 c, vector(value, where));
  if (c.x < 0 || c.y < 0 || c.z < 0) return invalid(where + " must not be negative");
  return c;
}

absl::StatusOr<Light> read_light(const Json& in, const std::string& where) {
  LL_RETURN_IF_ERROR(check_keys(
      in, {"type", "name", "position", "direction", "color", "intensity", "range", "innerConeAngle", "outerConeAngle"},
      where));
  Light out;
  const std::string type = in.contains("type") && in["type"].is_string() ? in["type"].get<std::string>() : "";
  if (type == "point") {
    out.type = LightType::kPoint;
  } else if (type == "spot") {
    out.type = LightType::kSpot;
  } else if (type == "directional") {
    out.type = LightType::kDirectional;
  } else {
    return invalid(where + R"(.type must be "point", "spot" or "directional")");
  }
  if (in.contains("name")) {
    if (!in["name"].is_string()) return invalid(where + ".name must be a string");
    out.name = in["name"].get<std::string>();
  }
  if (out.type != LightType::kDirectional && !in.contains("position")) {
    return invalid(where + ".position is missing");
  }
  if (out.type != LightType::kPoint && !in.contains("direction")) return invalid(where + ".direction is missing");
  if (in.contains("position")) {
    LL_ASSIGN_OR_RETURN(out.position, vector(in["position"], where + ".position"));
  }
  if (in.contains("direction")) {
    LL_ASSIGN_OR_RETURN(const Vec3 d, vector(in["direction"], where + ".direction"));
    out.direction = normalize(d);
    if (!(std::abs(length(out.direction) - 1) < 1e-3f)) return invalid(where + ".direction must have a direction");
  }
  if (in.contains("color")) {
    LL_ASSIGN_OR_RETURN(out.color, color(in["color"], where + ".color"));
  }
  const std::pair<const char*, float*> numbers[] = {{"intensity", &out.intensity},
                                                    {"range", &out.range},
                                                    {"innerConeAngle", &out.inner_cone_angle},
                                                    {"outerConeAngle", &out.outer_cone_angle}};
  for (const auto& [key, value] : numbers) {
    if (!in.contains(key)) continue;
    LL_ASSIGN_OR_RETURN(*value, number(in[key], where + "." + key));
    if (*value < 0) return invalid(where + "." + key + " must not be negative");
  }
  if (out.type == LightType::kSpot &&
      !(out.inner_cone_angle <= out.outer_cone_angle && out.outer_cone_angle > 0 && out.outer_cone_angle <= 1.5708f)) {
    return invalid(where + ": its cone angles must be 0 <= innerConeAngle <= outerConeAngle <= pi/2");
  }
  return out;
}

absl::StatusOr<Rig> read_rig(const Json& in, std::string where) {
  LL_RETURN_IF_ERROR(check_keys(in, {"name", "lights", "emissive", "environment"}, where));
  Rig out;
  if (!in.contains("name") || !in["name"].is_string() || in["name"].get<std::string>().empty()) {
    return invalid(where + ".name must be a string");
  }
  out.name = in["name"].get<std::string>();
  where += " \"" + printable(out.name) + "\"";
  if (in.contains("lights")) {
    const Json& lights = in["lights"];
    if (!lights.is_array()) return invalid(where + ".lights must be an array");
    for (size_t i = 0; i < lights.size(); ++i) {
      LL_ASSIGN_OR_RETURN(Light light, read_light(lights[i], where + ".lights[" + std::to_string(i) + "]"));
      out.lights.push_back(std::move(light));
    }
  }
  if (in.contains("emissive")) {
    if (!in["emissive"].is_object()) return invalid(where + ".emissive must be an object of material: [r, g, b]");
    for (const auto& [material, value] : in["emissive"].items()) {
      LL_ASSIGN_OR_RETURN(out.emission[material], color(value, where + ".emissive." + printable(material)));
    }
  }
  if (in.contains("environment")) {
    LL_ASSIGN_OR_RETURN(out.environment, color(in["environment"], where + ".environment"));
  }
  return out;
}

absl::StatusOr<std::vector<Rig>> read_rigs(const std::vector<uint8_t>& data) {
  Json root;
  try {
    root = Json::parse(data.begin(), data.end());
  } catch (const std::exception& e) {
    return invalid("is not JSON: " + printable(e.what(), 300));
  }
  if (!root.is_object() || !root.contains("rigs") || !root["rigs"].is_array()) {
    return invalid(R"(must be an object with an array "rigs")");
  }
  std::vector<Rig> out;
  std::set<std::string> names;
  size_t lights = 0;
  for (size_t i = 0; i < root["rigs"].size(); ++i) {
    LL_ASSIGN_OR_RETURN(Rig rig, read_rig(root["rigs"][i], "rigs[" + std::to_string(i) + "]"));
    if (!names.insert(rig.name).second)
      return invalid("has two rigs named \"" + printable(rig.name) + "\"; rename one");
    lights += rig.lights.size();
    if (lights > kMaxLights) return invalid("has more than " + std::to_string(kMaxLights) + " lights; split the file");
    out.push_back(std::move(rig));
  }
  return out;
}

}  // namespace

absl::StatusOr<std::vector<Rig>> load_rigs(const std::filesystem::path& path) {
  LL_ASSIGN_OR_RETURN(const std::vector<uint8_t> data, read_file(path));
  if (data.size() > kMaxBytes) return invalid(path.string() + " is larger than 16 MiB; split it");
  auto rigs = read_rigs(data);
  if (!rigs.ok()) return invalid(path.string() + ": " + std::string(rigs.status().message()));
  return rigs;
}

absl::StatusOr<Rig> find_rig(const std::vector<Rig>& rigs, const std::string& name) {
  std::string known;
  for (const Rig& rig : rigs) {
    if (rig.name == name) return rig;
    known += (known.empty() ? "" : ", ") + printable(rig.name);
  }
  return absl::NotFoundError("there is no rig \"" + printable(name) + "\"; the file has " +
                             (known.empty() ? "none" : known));
}

absl::Status apply_rig(const Rig& rig, Scene* scene) {
  // Checked first, so that a failure leaves the scene as it was.
  for (const auto& [name, emission] : rig.emission) {
    bool found = false;
    for (const Material& m : scene->materials) found |= m.name == name;
    if (!found) {
      return absl::NotFoundError("rig \"" + printable(rig.name) + "\" lights the material \"" + printable(name) +
                                 "\", which the level does not have");
    }
  }
  scene->lights = rig.lights;
  for (Material& m : scene->materials) {
    if (const auto it = rig.emission.find(m.name); it != rig.emission.end()) m.emission = it->second;
  }
  if (rig.environment) scene->environment = *rig.environment;
  return absl::OkStatus();
}

}  // namespace lightloom
