#include "cli/level.h"

#include <cstdio>

#include "cli/files.h"
#include "cli/interrupt.h"
#include "core/base/text.h"
#include "core/receivers/reversed.h"
#include "core/scene/defects.h"
#include "core/scene/gltf.h"
#include "core/scene/picture.h"
#include "core/scene/rig.h"

namespace lightloom {
namespace {

absl::Status in_file(const std::string& path, const absl::Status& status) {
  return status.ok() ? status : absl::Status(status.code(), path + ": " + std::string(status.message()));
}

/// A few names, for messages.
template <class T>
std::string names(const std::vector<T>& items) {
  constexpr size_t kShown = 20;
  std::string all;
  for (size_t i = 0; i < items.size() && i < kShown; ++i) all += (i == 0 ? "" : ", ") + printable(items[i].name);
  if (items.size() > kShown) all += " and " + std::to_string(items.size() - kShown) + " others";
  return all.empty() ? "none" : all;
}

absl::StatusOr<Rig> choose_rig(const std::string& path, const std::string& name) {
  LL_ASSIGN_OR_RETURN(const auto rigs, load_rigs(path));
  if (rigs.empty()) return absl::InvalidArgumentError(path + " has no rigs; add one, or leave --lights out");
  if (name.empty() && rigs.size() == 1) return rigs.front();
  if (name.empty()) {
    return absl::InvalidArgumentError(path + " has several rigs; choose one with --rig NAME: " + names(rigs));
  }
  auto rig = find_rig(rigs, name);
  if (!rig.ok()) return in_file(path, rig.status());
  return rig;
}

}  // namespace

absl::Status check_level(const std::string& path, const std::string& lights, const std::string& rig) {
  if (lights.empty() && !rig.empty()) {
    return absl::InvalidArgumentError("--rig names a rig of --lights; give --lights FILE.json too");
  }
  LL_RETURN_IF_ERROR(check_input(path));
  return lights.empty() ? absl::OkStatus() : check_input(lights);
}

absl::StatusOr<Level> load_level(const std::string& path, const std::string& lights, const std::string& rig,
                                 const std::function<absl::Status(Scene*)>& edit) {
  LL_ASSIGN_OR_RETURN(Scene scene, load_gltf(path));
  std::string warning;
  for (const std::string& line : scene.warnings) warning += (warning.empty() ? "" : "; ") + line;
  if (const std::string defects = describe(find_defects(scene)); !defects.empty()) {
    warning += (warning.empty() ? "" : "; ") + defects;
  }
  LL_RETURN_IF_ERROR(not_interrupted());
  if (!lights.empty()) {
    LL_ASSIGN_OR_RETURN(const Rig chosen, choose_rig(lights, rig));
    LL_RETURN_IF_ERROR(in_file(lights, apply_rig(chosen, &scene)));
  }
  if (edit) LL_RETURN_IF_ERROR(edit(&scene));
  Level level;
  level.scene = std::make_unique<Scene>(std::move(scene));
  LL_ASSIGN_OR_RETURN(level.tracer, RayTracer::create(*level.scene));
  std::vector<Object> reversed;
  for (const uint32_t o : reversed_objects(*level.tracer, {}))
    reversed.emplace_back().name = level.scene->objects[o].name;
  if (!reversed.empty()) {
    warning += (warning.empty() ? "" : "; ") + std::string("modelled inside out, by what is seen from behind: ") +
               names(reversed) + " (turn the faces, or make the materials double-sided)";
  }
  if (!warning.empty()) std::fprintf(stderr, "warning: %s: %s\n", path.c_str(), escape_controls(warning).c_str());
  LL_RETURN_IF_ERROR(not_interrupted());
  return level;
}

absl::StatusOr<Camera> find_camera(const Scene& scene, const std::string& name, const std::string& path, int width) {
  for (const Camera& camera : scene.cameras) {
    if (!name.empty() && camera.name != name) continue;
    LL_RETURN_IF_ERROR(in_file(path, image_height(camera, width).status()));
    return camera;
  }
  if (name.empty()) return absl::NotFoundError(path + " has no camera; add one to the level");
  return absl::NotFoundError(path + " has no camera '" + printable(name) + "'; it has: " + names(scene.cameras));
}

}  // namespace lightloom
