#include "cli/view/input.h"

#include <imgui.h>
// Its numbers of keys are those of ImGui's GLFW backend.
#include <GLFW/glfw3.h>

#include <algorithm>
#include <cmath>

#include "cli/view/picking.h"

namespace lightloom::view {
namespace {

constexpr float kTurn = 0.004f;       // radians a pixel
constexpr float kNearLight = 12;      // pixels
constexpr float kClickMoves = 4;      // pixels that a click may move
constexpr float kFaster = 4;          // with shift
constexpr float kLongestStep = 0.1f;  // seconds: a frame that hung does not throw the camera away

Vec2 place(ImVec2 mouse) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  return {mouse.x / std::max(size.x, 1.0f), mouse.y / std::max(size.y, 1.0f)};
}

float pixels_between(Vec2 a, Vec2 b) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  return std::hypot((a.x - b.x) * size.x, (a.y - b.y) * size.y);
}

std::optional<size_t> light_at(const Scene& scene, const Camera& camera, Vec2 at) {
  std::optional<size_t> nearest;
  float least = kNearLight;
  for (size_t i = 0; i < scene.lights.size(); ++i) {
    if (scene.lights[i].type == LightType::kDirectional) continue;
    const auto there = on_screen(camera, scene.lights[i].position);
    if (!there || pixels_between(*there, at) > least) continue;
    least = pixels_between(*there, at);
    nearest = i;
  }
  return nearest;
}

std::vector<float> values(Vec3 v) { return {v.x, v.y, v.z}; }

void keys(const Events& events, const State& state, std::vector<Action>* actions) {
  const bool typing = ImGui::GetIO().WantCaptureKeyboard;
  for (const int key : events.keys) {
    if (key == GLFW_KEY_F2) actions->push_back({Verb::kScreenshot, ""});
    if (typing) continue;
    if (key == GLFW_KEY_H) actions->push_back({Verb::kOverlay, "panel", {}, state.overlays.count("panel") == 0});
    if (key == GLFW_KEY_DELETE && state.picked) actions->push_back({Verb::kDelete});
    if (key == GLFW_KEY_ESCAPE) actions->push_back({Verb::kPick, ""});
  }
}

}  // namespace

void Input::fly(State* state) {
  const ImGuiIO& io = ImGui::GetIO();
  if (!io.WantCaptureMouse && io.MouseWheel != 0) {
    state->speed = std::clamp(state->speed * std::pow(1.2f, io.MouseWheel), 0.05f, 200.0f);
    busy_ = true;
  }
  if (!io.WantCaptureMouse && ImGui::IsMouseDragging(ImGuiMouseButton_Right, 0)) {
    state->camera.turn(-io.MouseDelta.x * kTurn, -io.MouseDelta.y * kTurn);
  }
  if (io.WantCaptureKeyboard) return;
  const auto axis = [](int plus, int minus) {
    return (ImGui::IsKeyDown(plus) ? 1.0f : 0.0f) - (ImGui::IsKeyDown(minus) ? 1.0f : 0.0f);
  };
  const Vec3 way{axis(GLFW_KEY_D, GLFW_KEY_A), axis(GLFW_KEY_E, GLFW_KEY_Q), axis(GLFW_KEY_W, GLFW_KEY_S)};
  if (way == Vec3{}) return;
  busy_ = true;
  const float speed = state->speed * (io.KeyShift ? kFaster : 1);
  state->camera.fly(normalize(way) * (speed * std::min(io.DeltaTime, kLongestStep)));
}

absl::Status Input::press(LiveLevel* level, const State& state, const Camera& camera, Vec2 at) {
  moved_ = false;
  grip_ = Grip::kView;
  if (state.overlays.count("lights") > 0) {
    if (const auto light = light_at(level->scene(), camera, at)) {
      grip_ = Grip::kLight;
      light_ = *light;
      return absl::OkStatus();
    }
  }
  if (!state.picked) return absl::OkStatus();
  LL_ASSIGN_OR_RETURN(const RayTracer* const tracer, level->tracer());
  if (pick_object(*tracer, camera, at) == state.picked) {
    grip_ = Grip::kObject;
    object_ = *state.picked;
  }
  return absl::OkStatus();
}

void Input::drag(const LiveLevel& level, const Camera& camera, Vec2 from, Vec2 to, State* state,
                 std::vector<Action>* actions) {
  switch (grip_) {
    case Grip::kLight: {
      const Light& light = level.scene().lights[light_];
      const Vec3 there = light.position + drag_in_view(camera, light.position, from, to);
      actions->push_back({Verb::kLight, light.name, values(there), false, static_cast<int>(light_)});
      break;
    }
    case Grip::kObject:
      if (state->picked == object_ && level.exists(object_)) {
        actions->push_back({Verb::kMove, "", values(drag_in_view(camera, level.bounds(object_).center(), from, to))});
      }
      break;
    case Grip::kView: {
      const ImVec2 size = ImGui::GetIO().DisplaySize;
      state->camera.turn((from.x - to.x) * size.x * kTurn, (from.y - to.y) * size.y * kTurn);
      break;
    }
    case Grip::kNothing:
      break;
  }
}

absl::StatusOr<std::vector<Action>> Input::read(const Events& events, LiveLevel* level, State* state, float aspect) {
  const ImGuiIO& io = ImGui::GetIO();
  std::vector<Action> actions;
  busy_ = !events.keys.empty() || ImGui::IsAnyMouseDown() || io.MouseDelta.x != 0 || io.MouseDelta.y != 0;
  keys(events, *state, &actions);
  fly(state);
  const Camera camera = state->camera.camera(aspect);
  const Vec2 at = place(io.MousePos);
  if (ImGui::IsMouseClicked(ImGuiMouseButton_Left) && !io.WantCaptureMouse) {
    // In a slow frame the mouse may be elsewhere already.
    pressed_ = last_ = events.left_press ? place({events.left_press->x, events.left_press->y}) : at;
    LL_RETURN_IF_ERROR(press(level, *state, camera, pressed_));
  }
  if (grip_ == Grip::kNothing) return actions;
  moved_ |= pixels_between(pressed_, at) > kClickMoves;
  if (moved_ && at != last_) {
    drag(*level, camera, last_, at, state, &actions);
    last_ = at;
  }
  if (ImGui::IsMouseReleased(ImGuiMouseButton_Left)) {
    if (!moved_ && grip_ != Grip::kLight) actions.push_back({Verb::kClick, "", {pressed_.x, pressed_.y}});
    grip_ = Grip::kNothing;
  }
  return actions;
}

}  // namespace lightloom::view
