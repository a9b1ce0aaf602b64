// A baked level as it is looked at: its scene, which may be edited, its asset in the runtime, and what draws both.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "cli/level.h"
#include "cli/live_runtime.h"
#include "core/asset/asset.h"
#include "core/scene/gltf_edit.h"

namespace lightloom::view {

struct LevelFiles {
  std::string loom, scene;
  std::string lights, rig;  ///< empty: the lights of the glTF
};

/// Colours that an object was given, by name: they are in no file.
struct Paint {
  std::optional<Vec3> albedo, emission;
};
using Paints = std::map<std::string, Paint>;

class LiveLevel {
 public:
  /// Reads the level; the asset streams in, of which cells and relight sets get `byte_budget` (0: no limit). Keeps `gpu`.
  static absl::StatusOr<std::unique_ptr<LiveLevel>> load(renderer::Gpu* gpu, const LevelFiles& files,
                                                         uint32_t shadow_size, uint64_t byte_budget = 0);
  /// The level from `scene`, baked anew, in place of `before`, whose lights (if they are of the same kinds), colours and
  /// runtime it takes over: what has stayed goes on as it was lit. If the level cannot be read, `before` stays as it is; if
  /// what is read cannot be shown, `before` is gone too: !before->works().
  static absl::StatusOr<std::unique_ptr<LiveLevel>> load_again(LiveLevel* before, const std::string& scene);

  bool works() const { return runtime_ != nullptr; }
  const LevelFiles& files() const { return files_; }
  const Scene& scene() const { return *level_.scene; }
  const Manifest& manifest() const { return manifest_; }
  const SurfaceElements& elements() const { return elements_; }
  renderer::Renderer& renderer() { return *renderer_; }
  LiveRuntime& runtime() { return *runtime_; }
  const Paints& paints() const { return paints_; }
  bool edited() const { return edited_; }  ///< since it was loaded or saved

  /// Lights go on from where they are; only their place, direction, colour and intensity may change.
  std::vector<Light>& lights() { return level_.scene->lights; }

  /// Objects are named by their place in scene().objects, which edits do not change.
  bool exists(size_t object) const { return !scene().objects[object].triangles.empty(); }
  Aabb bounds(size_t object) const;
  const Material& material(size_t object) const;
  /// Of the edited geometry.
  absl::StatusOr<const RayTracer*> tracer();

  absl::Status set_albedo(size_t object, Vec3 albedo);
  absl::Status set_emission(size_t object, Vec3 radiance);
  /// With all that hangs on its node. What was baked stays where it is until the level is baked again.
  absl::Status move(size_t object, Vec3 offset);
  absl::Status remove(size_t object);
  /// In the same place, lit as the first. Its number.
  absl::StatusOr<size_t> duplicate(size_t object);
  /// Of the level as edited.
  absl::Status save(const std::string& path);

  /// After a change of what an image or buffer of the renderer holds, it is made anew: sizes must be set again when this
  /// has grown.
  int renderer_generation() const { return generation_; }

 private:
  LiveLevel(renderer::Gpu* gpu, LevelFiles files, uint32_t shadow_size, uint64_t byte_budget)
      : gpu_(gpu), files_(std::move(files)), shadow_size_(shadow_size), byte_budget_(byte_budget) {}
  absl::Status start(LiveLevel* before);
  absl::Status make_renderer();
  absl::Status push_materials(size_t object);
  absl::Status change_materials(size_t object, void (*change)(Vec3, Material*), Vec3 value);
  absl::StatusOr<GltfEdit*> file_edit();

  renderer::Gpu* gpu_;
  LevelFiles files_;
  uint32_t shadow_size_;
  uint64_t byte_budget_;
  Level level_;
  bool tracer_is_old_ = false;
  Manifest manifest_;
  SurfaceElements elements_;
  std::unique_ptr<renderer::Renderer> renderer_;
  std::unique_ptr<LiveRuntime> runtime_;
  int generation_ = 0;
  std::optional<GltfEdit> file_edit_;
  bool edited_ = false;
  Paints paints_;
  std::set<size_t> painted_;  ///< objects with materials of their own
};

}  // namespace lightloom::view
