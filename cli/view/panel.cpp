#include "cli/view/panel.h"

#include <imgui.h>

#include <algorithm>
#include <array>
#include <cstdio>

#include "cli/view/picking.h"

namespace lightloom::view {
namespace {

constexpr float kWidth = 300;

using Actions = std::vector<Action>;

void show_text(const std::string& text) { ImGui::TextWrapped("%s", text.c_str()); }

/// What has no name goes by its number.
std::string label(const std::string& name, const char* kind, int index) {
  return name.empty() ? kind + std::string(" ") + std::to_string(index + 1) : name;
}

void cameras(const LiveLevel& level, const State& state, Actions* actions) {
  if (!ImGui::CollapsingHeader("Camera", ImGuiTreeNodeFlags_DefaultOpen)) return;
  const Vec3 p = state.camera.position();
  ImGui::Text("%.2f %.2f %.2f  yaw %.0f pitch %.0f", static_cast<double>(p.x), static_cast<double>(p.y),
              static_cast<double>(p.z), static_cast<double>(state.camera.yaw_degrees()),
              static_cast<double>(state.camera.pitch_degrees()));
  ImGui::Text("%.1f m/s (wheel; shift: faster)", static_cast<double>(state.speed));
  const std::vector<Camera>& all = level.scene().cameras;
  for (int i = 0; i < static_cast<int>(all.size()); ++i) {
    ImGui::PushID(i);
    const std::string name = label(all[static_cast<size_t>(i)].name, "camera", i);
    if (ImGui::Selectable(name.c_str())) actions->push_back({Verb::kCameraNamed, name, {}, false, i});
    ImGui::PopID();
  }
}

void picture(const State& state, Actions* actions) {
  if (!ImGui::CollapsingHeader("Picture", ImGuiTreeNodeFlags_DefaultOpen)) return;
  const int now = static_cast<int>(state.layer);
  if (ImGui::BeginCombo("layer", kLayers[now])) {
    for (const char* name : kLayers) {
      if (ImGui::Selectable(name, name == kLayers[now])) actions->push_back({Verb::kLayer, name});
    }
    ImGui::EndCombo();
  }
  float exposure = state.exposure;
  if (ImGui::DragFloat("exposure", &exposure, exposure * 0.01f, 1e-4f, 1e4f, "%.4g", ImGuiSliderFlags_Logarithmic)) {
    actions->push_back({Verb::kExposure, "", {std::max(exposure, 1e-4f)}});
  }
  if (ImGui::Button("expose anew")) actions->push_back({Verb::kExposure, "", {0}});
  ImGui::SameLine();
  if (ImGui::Button("screenshot (F2)")) actions->push_back({Verb::kScreenshot, ""});
}

void overlays(const State& state, Actions* actions) {
  if (!ImGui::CollapsingHeader("Overlays", ImGuiTreeNodeFlags_DefaultOpen)) return;
  int column = 0;
  for (const char* name : kOverlays) {
    bool on = state.overlays.count(name) > 0;
    if (column++ % 3 != 0) ImGui::SameLine(static_cast<float>((column - 1) % 3) * 95 + 8);
    if (ImGui::Checkbox(name, &on)) actions->push_back({Verb::kOverlay, name, {}, on});
  }
}

void light(const Light& light, int index, Actions* actions) {
  std::array<float, 3> p{light.position.x, light.position.y, light.position.z};
  if (light.type != LightType::kDirectional && ImGui::DragFloat3("position", p.data(), 0.02f, 0, 0, "%.2f")) {
    actions->push_back({Verb::kLight, light.name, {p[0], p[1], p[2]}, false, index});
  }
  std::array<float, 3> c{light.color.x, light.color.y, light.color.z};
  if (ImGui::ColorEdit3("colour", c.data(), ImGuiColorEditFlags_Float | ImGuiColorEditFlags_HDR)) {
    for (float& v : c) v = std::max(v, 0.0f);
    actions->push_back({Verb::kLightColour, light.name, {c[0], c[1], c[2]}, false, index});
  }
  float power = light.intensity;
  const char* unit = light.type == LightType::kDirectional ? "%.3g W/m2" : "%.3g W/sr";
  if (ImGui::DragFloat("power", &power, std::max(0.01f, power * 0.01f), 0, 1e6f, unit)) {
    actions->push_back({Verb::kLightPower, light.name, {std::max(power, 0.0f)}, false, index});
  }
}

void lights(const LiveLevel& level, Actions* actions) {
  if (!ImGui::CollapsingHeader("Lights", ImGuiTreeNodeFlags_DefaultOpen)) return;
  const std::vector<Light>& all = level.scene().lights;
  for (int i = 0; i < static_cast<int>(all.size()); ++i) {
    const Light& l = all[static_cast<size_t>(i)];
    ImGui::PushID(i);
    if (ImGui::TreeNode("light", "%s", label(l.name, "light", i).c_str())) {
      light(l, i, actions);
      ImGui::TreePop();
    }
    ImGui::PopID();
  }
}

void object(const LiveLevel& level, const State& state, Actions* actions) {
  if (!ImGui::CollapsingHeader("Object", ImGuiTreeNodeFlags_DefaultOpen)) return;
  if (!state.picked) {
    ImGui::TextDisabled("click one");
    return;
  }
  const size_t o = *state.picked;
  show_text(level.scene().objects[o].name);
  const Material& m = level.material(o);
  std::array<float, 3> albedo{m.base_color.x, m.base_color.y, m.base_color.z};
  if (ImGui::ColorEdit3("albedo", albedo.data(), ImGuiColorEditFlags_Float)) {
    for (float& v : albedo) v = std::clamp(v, 0.0f, 1.0f);
    actions->push_back({Verb::kAlbedo, "", {albedo[0], albedo[1], albedo[2]}});
  }
  std::array<float, 3> shine{m.emission.x, m.emission.y, m.emission.z};
  if (ImGui::ColorEdit3("emission", shine.data(), ImGuiColorEditFlags_Float | ImGuiColorEditFlags_HDR)) {
    for (float& v : shine) v = std::max(v, 0.0f);
    actions->push_back({Verb::kEmission, "", {shine[0], shine[1], shine[2]}});
  }
  const Vec3 centre = level.bounds(o).center();
  std::array<float, 3> at{centre.x, centre.y, centre.z};
  if (ImGui::DragFloat3("centre", at.data(), 0.01f, 0, 0, "%.2f")) {
    actions->push_back({Verb::kMove, "", {at[0] - centre.x, at[1] - centre.y, at[2] - centre.z}});
  }
  if (ImGui::Button("duplicate")) actions->push_back({Verb::kDuplicate});
  ImGui::SameLine();
  if (ImGui::Button("delete")) actions->push_back({Verb::kDelete});
}

void bake(const LiveLevel& level, const State& state, const std::string& save_as, Actions* actions) {
  if (!ImGui::CollapsingHeader("Level", ImGuiTreeNodeFlags_DefaultOpen)) return;
  if (level.edited()) ImGui::TextColored({1, 0.8f, 0.3f, 1}, "edited");
  if (ImGui::Button("save")) actions->push_back({Verb::kSave, save_as});
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", save_as.c_str());
  ImGui::SameLine();
  if (!state.baking) {
    if (ImGui::Button("rebake")) actions->push_back({Verb::kRebake});
    ImGui::SameLine();
    if (ImGui::Button("reload")) actions->push_back({Verb::kReload});
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("as it was loaded, or baked last");
    return;
  }
  if (ImGui::Button("cancel")) actions->push_back({Verb::kCancelBake});
  const BakeProgress& p = state.progress;
  const float share = p.total > 0 ? static_cast<float>(p.done) / static_cast<float>(p.total) : 0;
  ImGui::ProgressBar(share, {-1, 0}, p.stage.c_str());
}

}  // namespace

std::vector<Action> draw_panel(const LiveLevel& level, const State& state, const std::string& save_as) {
  Actions actions;
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize({kWidth, ImGui::GetIO().DisplaySize.y});
  if (ImGui::Begin("lightloom", nullptr,
                   ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoCollapse)) {
    ImGui::PushItemWidth(-85);
    ImGui::Text("%.1f ms a frame, runtime %.1f", state.frame_ms, state.runtime_ms);
    if (!state.message.empty()) show_text(state.message);
    cameras(level, state, &actions);
    picture(state, &actions);
    overlays(state, &actions);
    lights(level, &actions);
    object(level, state, &actions);
    bake(level, state, save_as, &actions);
    ImGui::PopItemWidth();
  }
  ImGui::End();
  return actions;
}

void draw_lights(const LiveLevel& level, const Camera& camera) {
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  ImDrawList* const list = ImGui::GetBackgroundDrawList();
  for (const Light& light : level.scene().lights) {
    if (light.type == LightType::kDirectional) continue;
    const auto at = on_screen(camera, light.position);
    if (!at) continue;
    const ImVec2 p{at->x * size.x, at->y * size.y};
    const float top = std::max({light.color.x, light.color.y, light.color.z, 1e-6f});
    list->AddCircleFilled(p, 5, ImGui::GetColorU32({light.color.x / top, light.color.y / top, light.color.z / top, 1}));
    list->AddCircle(p, 7, IM_COL32(0, 0, 0, 200), 0, 1.5f);
    list->AddText({p.x + 10, p.y - 7}, IM_COL32(0, 0, 0, 220), light.name.c_str());
    list->AddText({p.x + 9, p.y - 8}, IM_COL32(255, 255, 255, 230), light.name.c_str());
  }
}

}  // namespace lightloom::view
