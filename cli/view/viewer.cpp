#include "cli/view/viewer.h"

#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "cli/interrupt.h"
#include "cli/view/panel.h"
#include "core/base/text.h"

namespace lightloom::view {
namespace {

/// Light of a lamp needs some bounces to be there; only then is a picture's brightness worth measuring.
constexpr int kSettle = 26, kExposeEvery = 5;  // so the first frame and the last are among those measured
static_assert((kSettle - 1) % kExposeEvery == 0);
/// Seconds between two looks whether the asset was baked anew by someone else.
constexpr double kWatch = 0.5;
/// Frames without news, after which the viewer sleeps until some come.
constexpr int kQuiet = 90;
/// Frames to draw then, for the panel to follow the mouse.
constexpr int kAfterNews = 3;

std::filesystem::file_time_type time_of_manifest(const std::string& loom) {
  std::error_code ignored;
  return std::filesystem::last_write_time(std::filesystem::path(loom) / "manifest", ignored);
}

double smoothed(double old, double now) { return old > 0 ? old + 0.1 * (now - old) : now; }

}  // namespace

absl::Status run_viewer(const ViewOptions& options) {
  std::vector<std::string> messages;
  {
    LL_ASSIGN_OR_RETURN(const auto viewer, Viewer::create(options, &messages));
    LL_RETURN_IF_ERROR(viewer->run());
  }
  return messages.empty() ? absl::OkStatus() : absl::InternalError("Vulkan validation: " + messages.front());
}

absl::StatusOr<std::unique_ptr<Viewer>> Viewer::create(ViewOptions options, std::vector<std::string>* messages) {
  std::unique_ptr<Viewer> viewer(new Viewer(std::move(options), messages));
  LL_RETURN_IF_ERROR(viewer->start());
  return viewer;
}

absl::Status Viewer::start() {
  const std::string title = "lightloom: " + printable(std::filesystem::path(options_.files.scene).filename().string());
  LL_ASSIGN_OR_RETURN(window_, Window::create(title, options_.width, options_.height));
  const renderer::WindowSystem system = window_->system();
  LL_ASSIGN_OR_RETURN(gpu_, renderer::Gpu::create(options_.validation, messages_, &system));
  saved_ = baked_ = options_.files.scene;
  manifest_time_ = time_of_manifest(options_.files.loom);
  LL_ASSIGN_OR_RETURN(level_, LiveLevel::load(gpu_.get(), options_.files, static_cast<uint32_t>(options_.shadow_size),
                                              static_cast<uint64_t>(1e6 * static_cast<double>(options_.budget))));
  LL_ASSIGN_OR_RETURN(screen_, Screen::create(window_.get(), gpu_.get()));
  if (!options_.panel) state_.overlays.clear();
  state_.exposure = options_.exposure > 0 ? options_.exposure : 1;
  exposing_ = kSettle;  // as many frames in any case: a script begins when the light has settled
  state_.speed = std::clamp(length(level_->manifest().bounds.size()) / 8, 0.5f, 20.0f);
  return begin_at_camera();
}

absl::Status Viewer::begin_at_camera() {
  const Scene& scene = level_->scene();
  if (!options_.camera.empty() || !scene.cameras.empty()) {
    LL_ASSIGN_OR_RETURN(const Camera camera, find_camera(scene, options_.camera, options_.files.scene, options_.width));
    state_.camera.stand(camera);
    return absl::OkStatus();
  }
  const Aabb box = level_->manifest().bounds;
  state_.camera.stand(box.center() + Vec3{0, 0, 0.4f * box.size().z}, 0, 0);
  return absl::OkStatus();
}

absl::Status Viewer::reload(const std::string& scene) {
  manifest_time_ = time_of_manifest(options_.files.loom);  // before it is read: a later one is news
  auto fresh = LiveLevel::load_again(level_.get(), scene);
  if (!fresh.ok() && !level_->works()) fatal_ = fresh.status();
  LL_RETURN_IF_ERROR(fresh.status());
  level_ = *std::move(fresh);
  saved_ = baked_ = scene;
  state_.picked.reset();
  owners_ = {};
  marks_are_old_ = true;
  wait_reload_ = false;
  quiet_ = 0;
  return absl::OkStatus();
}

absl::Status Viewer::run() {
  while (!done_ && !window_->closed()) {
    LL_RETURN_IF_ERROR(not_interrupted());
    const bool idle = quiet_ > kQuiet || (wait_bake_ && bake_.running());
    const bool news = window_->poll(idle);
    if (news && idle) quiet_ = std::min(quiet_, kQuiet - kAfterNews);
    LL_RETURN_IF_ERROR(look_after_bake());
    watch_asset();
    LL_RETURN_IF_ERROR(fatal_);
    LL_RETURN_IF_ERROR(step_script());
    LL_RETURN_IF_ERROR(fatal_);
    const bool asleep = quiet_ > kQuiet && !bake_.running();  // a bake has progress to show, now and then
    if (!done_ && !asleep) LL_RETURN_IF_ERROR(frame());
  }
  return gpu_->validation();
}

absl::Status Viewer::look_after_bake() {
  const bool ended = bake_.poll();
  state_.baking = bake_.running();
  state_.progress = bake_.progress();
  if (!ended) return absl::OkStatus();
  quiet_ = 0;
  absl::Status result = bake_.result();
  if (result.ok()) result = reload(saved_);
  state_.message = result.ok() ? "baked" : std::string(result.message());
  return wait_bake_ && !absl::IsCancelled(result) ? result : absl::OkStatus();
}

void Viewer::watch_asset() {
  if (bake_.running() || since_look_.seconds() < kWatch) return;
  since_look_ = Stopwatch();
  const std::filesystem::file_time_type now = time_of_manifest(options_.files.loom);
  if (now == manifest_time_ || now == std::filesystem::file_time_type::min()) return;
  const bool edited = level_->edited();
  const absl::Status status = reload(baked_);
  manifest_time_ = now;  // what cannot be shown is not tried again and again
  state_.message = status.ok() ? edited ? "baked anew by someone else: loaded again, edits are lost"
                                        : "baked anew by someone else: loaded again"
                               : std::string(status.message());
}

absl::Status Viewer::look_from_camera() {
  const Vec3 position = state_.camera.camera(screen_->aspect()).position;
  const float seconds = static_cast<float>(std::max(1e-3, since_frame_.seconds()));
  // A jump is no motion.
  Vec3 velocity = (position - last_position_.value_or(position)) * (1 / seconds);
  if (length(velocity) > 10 * state_.speed) velocity = {};
  last_position_ = position;
  if (state_.overlays.count("residency") > 0) {
    std::vector<uint8_t> levels = level_->runtime().cell_levels();
    marks_are_old_ |= levels != cell_levels_;
    cell_levels_ = std::move(levels);
  }
  return level_->runtime().look_from(position, velocity);
}

bool Viewer::script_waits() {
  if (exposing_ > 0 || !shot_.empty() || wait_reload_) return true;
  if (wait_frames_ > 0) {
    --wait_frames_;
    return true;
  }
  if (wait_size_.width > 0) {
    const VkExtent2D now = screen_->size();
    if (now.width == wait_size_.width && now.height == wait_size_.height) wait_size_ = {};
  }
  wait_bake_ = wait_bake_ && bake_.running();
  wait_arrival_ = wait_arrival_ && level_->runtime().arriving();
  return wait_bake_ || wait_arrival_ || wait_size_.width > 0;
}

absl::Status Viewer::step_script() {
  while (!done_) {
    if (script_waits()) return absl::OkStatus();
    if (next_ == options_.script.size()) return finish_script();
    quiet_ = 0;
    const Action& action = options_.script[next_++];
    if (const absl::Status status = act(action); !status.ok()) {
      return absl::Status(status.code(), options_.script_name + " line " + std::to_string(action.line) + ": " +
                                             std::string(status.message()));
    }
  }
  return absl::OkStatus();
}

absl::Status Viewer::finish_script() {
  if (options_.screenshot.empty()) return absl::OkStatus();
  shot_ = options_.screenshot;
  options_.screenshot.clear();
  options_.script.push_back({Verb::kQuit});
  return absl::OkStatus();
}

void Viewer::act_by_hand(const Action& action) {
  quiet_ = 0;
  if (const absl::Status status = act(action); !status.ok()) state_.message = std::string(status.message());
}

absl::Status Viewer::frame() {
  LL_ASSIGN_OR_RETURN(const bool has_area, screen_->fit(level_.get()));
  if (!has_area) {
    quiet_ = kQuiet + 1;  // minimised: nothing to draw until it comes back
    return absl::OkStatus();
  }
  screen_->ui().begin();
  std::vector<Action> actions;
  if (state_.overlays.count("panel") > 0) actions = draw_panel(*level_, state_, options_.save_as);
  if (state_.overlays.count("lights") > 0) draw_lights(*level_, state_.camera.camera(screen_->aspect()));
  LL_ASSIGN_OR_RETURN(const std::vector<Action> by_hand,
                      input_.read(window_->events(), level_.get(), &state_, screen_->aspect()));
  screen_->ui().end();
  actions.insert(actions.end(), by_hand.begin(), by_hand.end());
  quiet_ = input_.busy() ? 0 : quiet_ + 1;
  for (const Action& action : actions) {
    act_by_hand(action);
    LL_RETURN_IF_ERROR(fatal_);
  }
  return draw();
}

absl::Status Viewer::draw() {
  LL_ASSIGN_OR_RETURN(const bool has_area, screen_->fit(level_.get()));  // actions may have changed the level
  if (!has_area) return absl::OkStatus();
  LL_RETURN_IF_ERROR(look_from_camera());
  LL_RETURN_IF_ERROR(show_marks());
  if (level_->runtime().arriving()) quiet_ = 0;
  LL_ASSIGN_OR_RETURN(const PlayTimes before, level_->runtime().times());
  const Shot shot{state_.camera.camera(screen_->aspect()), state_.layer, state_.exposure, !shot_.empty()};
  LL_RETURN_IF_ERROR(screen_->draw(level_.get(), shot));
  LL_ASSIGN_OR_RETURN(const PlayTimes after, level_->runtime().times());
  const auto sum = [](const PlayTimes& t) { return t.radiosity + t.relight + t.project + t.receive; };
  state_.runtime_ms = smoothed(state_.runtime_ms, sum(after) - sum(before));
  state_.frame_ms = smoothed(state_.frame_ms, 1000 * since_frame_.seconds());
  since_frame_ = Stopwatch();
  if (!shot_.empty()) {
    LL_RETURN_IF_ERROR(write_png(screen_->picture(), shot_));
    state_.message = "wrote " + shot_;
    shot_.clear();
  }
  return exposing_ > 0 && !level_->runtime().arriving() ? expose_anew() : absl::OkStatus();
}

absl::Status Viewer::expose_anew() {
  --exposing_;
  // Reading the picture back takes its time: not in every frame.
  if (options_.exposure > 0 || exposing_ % kExposeEvery != 0) return absl::OkStatus();
  LL_ASSIGN_OR_RETURN(Image image, level_->renderer().read());
  state_.exposure = expose(&image);
  return absl::OkStatus();
}

absl::Status Viewer::show_marks() {
  if (marks_are_old_) {
    const auto on = [&](const char* name) { return state_.overlays.count(name) > 0; };
    if (owners_.half.empty() && (on("cells") || on("ranks") || on("stale") || on("residency"))) {
      LL_ASSIGN_OR_RETURN(owners_,
                          find_owners(level_->files().loom, level_->manifest(), level_->scene(), level_->elements()));
    }
    LL_RETURN_IF_ERROR(screen_->set_overlays(
        overlay_marks(state_.overlays, level_->manifest(), level_->elements(), owners_, cell_levels_)));
    marks_are_old_ = false;
  }
  renderer::Marks selection;
  if (state_.picked && state_.overlays.count("panel") > 0) {
    selection.box(level_->bounds(*state_.picked), {255, 220, 60, 255});
  }
  return screen_->set_selection(selection);
}

}  // namespace lightloom::view
