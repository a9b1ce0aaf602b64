#include "cli/view/live_level.h"

#include <algorithm>

#include "cli/progress.h"
#include "cli/scene_edit.h"
#include "core/base/file.h"
#include "core/base/text.h"

namespace lightloom::view {
namespace {

constexpr int kMaterialSamples =
    16;  // points of a texel that its colour is the mean of, as StageOptions::direct_samples

bool same_kinds(const std::vector<Light>& a, const std::vector<Light>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const Light& x, const Light& y) { return x.type == y.type && x.name == y.name; });
}

std::string name_of_copy(const Scene& scene, const std::string& name) {
  const auto taken = [&](const std::string& wanted) {
    return std::any_of(scene.objects.begin(), scene.objects.end(), [&](const Object& o) { return o.name == wanted; });
  };
  std::string copy = name + " copy";
  for (int i = 2; taken(copy); ++i) copy = name + " copy " + std::to_string(i);
  return copy;
}

}  // namespace

absl::StatusOr<std::unique_ptr<LiveLevel>> LiveLevel::load(renderer::Gpu* gpu, const LevelFiles& files,
                                                           uint32_t shadow_size, uint64_t byte_budget) {
  std::unique_ptr<LiveLevel> level(new LiveLevel(gpu, files, shadow_size, byte_budget));
  LL_RETURN_IF_ERROR(level->start(nullptr));
  return level;
}

absl::StatusOr<std::unique_ptr<LiveLevel>> LiveLevel::load_again(LiveLevel* before, const std::string& scene) {
  LevelFiles files = before->files_;
  files.scene = scene;
  std::unique_ptr<LiveLevel> level(new LiveLevel(before->gpu_, files, before->shadow_size_, before->byte_budget_));
  LL_RETURN_IF_ERROR(level->start(before));
  for (size_t o = 0; o < level->scene().objects.size(); ++o) {
    const auto paint = before->paints_.find(level->scene().objects[o].name);
    if (paint == before->paints_.end()) continue;
    if (paint->second.albedo) LL_RETURN_IF_ERROR(level->set_albedo(o, *paint->second.albedo));
    if (paint->second.emission) LL_RETURN_IF_ERROR(level->set_emission(o, *paint->second.emission));
  }
  return level;
}

absl::Status LiveLevel::start(LiveLevel* before) {
  // Read once: an asset may be baked anew at any time.
  LL_ASSIGN_OR_RETURN(const std::vector<uint8_t> manifest, read_file(std::filesystem::path(files_.loom) / "manifest"));
  LL_ASSIGN_OR_RETURN(manifest_, decode_manifest(manifest));
  bool keep = before != nullptr;
  LL_ASSIGN_OR_RETURN(level_, load_level(files_.scene, files_.lights, files_.rig, [&](Scene* scene) {
                        keep = keep && same_kinds(before->scene().lights, scene->lights);
                        if (keep) scene->lights = before->scene().lights;
                        return absl::OkStatus();
                      }));
  ProgressBar bar;
  LL_ASSIGN_OR_RETURN(elements_, load_surface_elements(files_.loom, manifest_, scene()));
  LL_ASSIGN_OR_RETURN(const SurfaceInputs inputs,
                      surface_materials(*level_.tracer, elements_, kMaterialSamples, bar.parallel("materials", 0)));
  bar.finish();
  if (keep) {
    // From here on `before` is of no use; with other lights it keeps its runtime, which has room for those only.
    runtime_ = std::move(before->runtime_);
    LL_RETURN_IF_ERROR(runtime_->reload(scene(), files_.loom, manifest));
  } else {
    LL_ASSIGN_OR_RETURN(runtime_, LiveRuntime::create(*gpu_, scene(), files_.loom, {true, byte_budget_}));
  }
  LL_RETURN_IF_ERROR(runtime_->set_materials(inputs));
  return make_renderer();
}

absl::Status LiveLevel::make_renderer() {
  LL_ASSIGN_OR_RETURN(auto fresh, renderer::Renderer::create(gpu_, scene(), elements_.layout, shadow_size_));
  renderer_ = std::move(fresh);  // after a failure there is still the old one
  renderer_->use_irradiance(runtime_->outputs().image_view, VK_IMAGE_LAYOUT_GENERAL);
  ++generation_;
  return absl::OkStatus();
}

Aabb LiveLevel::bounds(size_t object) const {
  Aabb box;
  for (const Vec3 p : scene().objects[object].positions) box.extend(p);
  return box;
}

const Material& LiveLevel::material(size_t object) const {
  return scene().materials[scene().objects[object].triangles.front().material];
}

absl::StatusOr<const RayTracer*> LiveLevel::tracer() {
  if (tracer_is_old_) {
    level_.tracer.reset();
    LL_ASSIGN_OR_RETURN(level_.tracer, RayTracer::create(scene()));
    tracer_is_old_ = false;
  }
  return level_.tracer.get();
}

absl::Status LiveLevel::set_albedo(size_t object, Vec3 albedo) {
  paints_[scene().objects[object].name].albedo = albedo;
  return change_materials(object, paint, albedo);
}

absl::Status LiveLevel::set_emission(size_t object, Vec3 radiance) {
  paints_[scene().objects[object].name].emission = radiance;
  return change_materials(object, shine, radiance);
}

absl::Status LiveLevel::change_materials(size_t object, void (*change)(Vec3, Material*), Vec3 value) {
  Scene& scene = *level_.scene;
  Object& o = scene.objects[object];
  const bool first = painted_.insert(object).second;
  if (first) own_materials(&o, &scene);
  bool textures = first;
  for (const Triangle& t : o.triangles) {
    Material& material = scene.materials[t.material];
    const Material before = material;
    change(value, &material);
    textures |= material.base_color_texture != before.base_color_texture ||
                material.emission_texture != before.emission_texture;
  }
  // Factors are read every frame; which materials and textures there are is not.
  if (textures) LL_RETURN_IF_ERROR(make_renderer());
  return push_materials(object);
}

absl::Status LiveLevel::push_materials(size_t object) {
  if (object >= elements_.receivers.ranges.size()) return absl::OkStatus();  // a copy: not in the asset
  const Object& o = scene().objects[object];
  const Receivers::Range range = elements_.receivers.ranges[object];
  SurfaceInputs inputs;
  for (uint32_t i = range.begin; i < range.end; ++i) {
    const Receiver& r = elements_.receivers.all[i];
    const Texel& texel = elements_.receivers.grids[object].texels[r.texel];
    const Triangle& t = o.triangles[texel.triangle];
    inputs.albedo.push_back(albedo_at(scene(), o, t, texel.b1, texel.b2));
    inputs.emission.push_back(r.back ? Vec3{} : emission_at(scene(), o, t, texel.b1, texel.b2));
  }
  return inputs.albedo.empty() ? absl::OkStatus() : runtime_->set_materials(inputs, range.begin);
}

absl::StatusOr<GltfEdit*> LiveLevel::file_edit() {
  if (!file_edit_) {
    LL_ASSIGN_OR_RETURN(GltfEdit opened, GltfEdit::open(files_.scene));
    file_edit_.emplace(std::move(opened));
  }
  return &*file_edit_;
}

absl::Status LiveLevel::move(size_t object, Vec3 offset) {
  LL_ASSIGN_OR_RETURN(GltfEdit* const edit, file_edit());
  const int node = scene().objects[object].node;
  LL_RETURN_IF_ERROR(edit->move(node, offset));
  const std::vector<int> moved = edit->subtree(node);
  for (size_t o = 0; o < scene().objects.size(); ++o) {
    Object& other = level_.scene->objects[o];
    if (!exists(o) || std::find(moved.begin(), moved.end(), other.node) == moved.end()) continue;
    for (Vec3& p : other.positions) p += offset;
    other.transform[12] += static_cast<double>(offset.x);
    other.transform[13] += static_cast<double>(offset.y);
    other.transform[14] += static_cast<double>(offset.z);
    LL_RETURN_IF_ERROR(renderer_->update_object(o));
  }
  edited_ = tracer_is_old_ = true;
  return absl::OkStatus();
}

absl::Status LiveLevel::remove(size_t object) {
  LL_ASSIGN_OR_RETURN(GltfEdit* const edit, file_edit());
  Object& o = level_.scene->objects[object];
  const auto others = std::count_if(scene().objects.begin(), scene().objects.end(),
                                    [](const Object& other) { return !other.triangles.empty(); });
  if (others == 1) return absl::FailedPreconditionError("a level needs an object: the last one stays");
  LL_RETURN_IF_ERROR(edit->remove(o.node));
  o.triangles.clear();
  o.positions.clear();
  edited_ = tracer_is_old_ = true;
  return make_renderer();
}

absl::StatusOr<size_t> LiveLevel::duplicate(size_t object) {
  LL_ASSIGN_OR_RETURN(GltfEdit* const edit, file_edit());
  Object copy = scene().objects[object];
  copy.name = name_of_copy(scene(), copy.name);
  LL_ASSIGN_OR_RETURN(copy.node, edit->duplicate(copy.node, copy.name));
  if (const auto paint = paints_.find(scene().objects[object].name); paint != paints_.end()) {
    paints_[copy.name] = paint->second;
  }
  painted_.erase(object);  // its materials are the copy's too now
  level_.scene->objects.push_back(std::move(copy));
  elements_.layout.uv.push_back(elements_.layout.uv[object]);
  elements_.layout.placements.push_back(elements_.layout.placements[object]);
  edited_ = tracer_is_old_ = true;
  LL_RETURN_IF_ERROR(make_renderer());
  return scene().objects.size() - 1;
}

absl::Status LiveLevel::save(const std::string& path) {
  LL_ASSIGN_OR_RETURN(const GltfEdit* const edit, file_edit());
  LL_RETURN_IF_ERROR(edit->save(path));
  edited_ = false;
  return absl::OkStatus();
}

}  // namespace lightloom::view
