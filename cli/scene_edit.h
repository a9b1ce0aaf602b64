// Changes to a loaded level that need no new bake: colours, emission, and lights that move.
#pragma once

#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/scene/scene.h"

namespace lightloom {

/// "x,y,z": three finite numbers.
absl::StatusOr<Vec3> parse_vec3(const std::string& text);

/// `edits`: "OBJECT:r,g,b;OBJECT:r,g,b". Each object gets materials of its own with that albedo, or that emitted
/// radiance, in place of factor and texture. What is geometry (alpha mask, sides) stays.
absl::Status set_albedo(const std::string& edits, Scene* scene);
absl::Status set_emission(const std::string& edits, Scene* scene);

/// The object's materials become its own: whatever changes them changes nothing else.
void own_materials(Object* object, Scene* scene);
/// What set_albedo and set_emission do to a material.
void paint(Vec3 albedo, Material* material);
void shine(Vec3 radiance, Material* material);

/// A light on its way along a path of straight lines, at constant speed.
class LightPath {
 public:
  /// `points`: "x,y,z;x,y,z;…", metres. The light: by name; empty: the only one. Fails if it has no position.
  static absl::StatusOr<LightPath> parse(const std::string& light, const std::string& points, const Scene& scene);

  /// Puts the light where it is at `t` in [0, 1].
  void move(float t, Scene* scene) const;

 private:
  size_t light_ = 0;
  std::vector<Vec3> points_;
};

}  // namespace lightloom
