// What each command of script.h does: Viewer::act and its parts.
#include <algorithm>
#include <filesystem>

#include "cli/view/picking.h"
#include "cli/view/viewer.h"
#include "core/base/text.h"

namespace lightloom::view {
namespace {

namespace fs = std::filesystem;

/// The place of the name in `kNames`. REQUIRES: it is there
template <size_t N>
int index_of(const char* const (&names)[N], const std::string& name) {
  return static_cast<int>(std::find(std::begin(names), std::end(names), name) - std::begin(names));
}

/// The light or camera that is meant; null if there is none.
template <class Items>
auto* chosen(Items& items, const Action& action) {
  for (size_t i = 0; i < items.size(); ++i) {
    if (action.index < 0 ? items[i].name == action.name : i == static_cast<size_t>(action.index)) return &items[i];
  }
  return static_cast<decltype(&items[0])>(nullptr);
}

/// lightloom-0001.png, or the next number that no file has.
std::string free_name() {
  std::error_code ignored;
  for (int i = 1;; ++i) {
    char name[32];
    std::snprintf(name, sizeof name, "lightloom-%04d.png", i);
    if (!fs::exists(name, ignored)) return name;
  }
}

}  // namespace

absl::Status Viewer::act(const Action& action) {
  switch (action.verb) {
    case Verb::kLight:
    case Verb::kLightColour:
    case Verb::kLightPower:
      return act_on_light(action);
    case Verb::kAlbedo:
    case Verb::kEmission:
    case Verb::kMove:
    case Verb::kDuplicate:
    case Verb::kDelete:
      return act_on_object(action);
    case Verb::kPick:
    case Verb::kClick:
      return pick(action);
    case Verb::kSave:
      return save(action.name);
    case Verb::kRebake:
      return rebake();
    case Verb::kCancelBake:
      bake_.cancel();
      return absl::OkStatus();
    case Verb::kReload:
      return bake_.running() ? absl::FailedPreconditionError("a bake is running; cancel it, or wait for it")
                             : reload(baked_);
    case Verb::kWait:
      wait_frames_ = static_cast<int>(action.numbers[0]);
      return absl::OkStatus();
    case Verb::kWaitBake:
      wait_bake_ = true;
      return absl::OkStatus();
    case Verb::kWaitReload:
      wait_reload_ = true;
      return absl::OkStatus();
    case Verb::kWaitArrival:
      wait_arrival_ = true;
      wait_frames_ = 2;  // so that the stream has seen where the camera is
      return absl::OkStatus();
    case Verb::kQuit:
      done_ = true;
      return absl::OkStatus();
    default:
      return show(action);
  }
}

absl::Status Viewer::show(const Action& action) {
  switch (action.verb) {
    case Verb::kCamera:
      state_.camera.stand(action.vec3(), action.numbers[3], action.numbers[4]);
      return absl::OkStatus();
    case Verb::kCameraNamed:
      return go_to(action);
    case Verb::kOverlay:
      marks_are_old_ = true;
      if (action.on) {
        state_.overlays.insert(action.name);
      } else {
        state_.overlays.erase(action.name);
      }
      return absl::OkStatus();
    case Verb::kLayer:
      state_.layer = static_cast<Layer>(index_of(kLayers, action.name));
      return absl::OkStatus();
    case Verb::kExposure:
      options_.exposure = action.numbers[0];
      if (action.numbers[0] > 0) state_.exposure = action.numbers[0];
      exposing_ = action.numbers[0] > 0 ? 0 : 1;
      return absl::OkStatus();
    case Verb::kResize:
      wait_size_ = {static_cast<uint32_t>(action.numbers[0]), static_cast<uint32_t>(action.numbers[1])};
      window_->resize(static_cast<int>(wait_size_.width), static_cast<int>(wait_size_.height));
      return absl::OkStatus();
    case Verb::kScreenshot:
      shot_ = action.name.empty() ? free_name() : action.name;
      return absl::OkStatus();
    default:
      return absl::InternalError("a command that nobody knows");
  }
}

absl::Status Viewer::go_to(const Action& action) {
  const Camera* const camera = chosen(level_->scene().cameras, action);
  if (!camera) return absl::NotFoundError("the level has no camera '" + printable(action.name) + "'");
  state_.camera.stand(*camera);
  return absl::OkStatus();
}

absl::Status Viewer::act_on_light(const Action& action) {
  Light* const light = chosen(level_->lights(), action);
  if (!light) return absl::NotFoundError("the level has no light '" + printable(action.name) + "'");
  if (action.verb == Verb::kLightColour) light->color = action.vec3();
  if (action.verb == Verb::kLightPower) light->intensity = action.numbers[0];
  if (action.verb != Verb::kLight) return absl::OkStatus();
  if (light->type == LightType::kDirectional) {
    return absl::InvalidArgumentError("a directional light has no position to move");
  }
  light->position = action.vec3();
  return absl::OkStatus();
}

absl::Status Viewer::pick(const Action& action) {
  state_.picked.reset();
  if (action.verb == Verb::kClick) {
    LL_ASSIGN_OR_RETURN(const RayTracer* const tracer, level_->tracer());
    const Camera camera = state_.camera.camera(screen_->aspect());
    state_.picked = pick_object(*tracer, camera, {action.numbers[0], action.numbers[1]});
    return absl::OkStatus();
  }
  if (action.name.empty()) return absl::OkStatus();
  const std::vector<Object>& objects = level_->scene().objects;
  for (size_t o = 0; o < objects.size(); ++o) {
    if (objects[o].name == action.name && level_->exists(o)) state_.picked = o;
  }
  if (state_.picked) return absl::OkStatus();
  return absl::NotFoundError("the level has no object '" + printable(action.name) + "'");
}

absl::Status Viewer::act_on_object(const Action& action) {
  if (!state_.picked) return absl::FailedPreconditionError("no object is picked: pick OBJECT");
  const size_t object = *state_.picked;
  if (action.verb == Verb::kAlbedo) return level_->set_albedo(object, action.vec3());
  if (action.verb == Verb::kEmission) return level_->set_emission(object, action.vec3());
  return edit(action);
}

absl::Status Viewer::edit(const Action& action) {
  if (bake_.running()) {
    return absl::FailedPreconditionError("a bake is running, and what is edited now would be lost: cancel it, or wait");
  }
  const size_t object = *state_.picked;
  if (action.verb == Verb::kMove) return level_->move(object, action.vec3());
  if (action.verb == Verb::kDelete) {
    LL_RETURN_IF_ERROR(level_->remove(object));
    state_.picked.reset();
    return absl::OkStatus();
  }
  LL_ASSIGN_OR_RETURN(const size_t copy, level_->duplicate(object));
  state_.picked = copy;
  state_.message = "the copy stands where the first one stands: move it";
  return absl::OkStatus();
}

absl::Status Viewer::save(const std::string& path) {
  LL_RETURN_IF_ERROR(level_->save(path));
  saved_ = path;
  state_.message = "saved " + path;
  return absl::OkStatus();
}

absl::Status Viewer::rebake() {
  if (bake_.running()) return absl::FailedPreconditionError("a bake is running already");
  if (level_->edited()) LL_RETURN_IF_ERROR(save(options_.save_as));
  LL_RETURN_IF_ERROR(bake_.start("/proc/self/exe", saved_, options_.files.loom));
  state_.message = "baking " + saved_;
  return absl::OkStatus();
}

}  // namespace lightloom::view
