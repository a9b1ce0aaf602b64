// The viewer: a window, a level in it, and what is done to both, by hand or by a script.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/view/input.h"
#include "cli/view/live_level.h"
#include "cli/view/overlays.h"
#include "cli/view/screen.h"
#include "cli/view/script.h"
#include "cli/view/state.h"
#include "cli/view/window.h"
#include "core/base/stopwatch.h"

namespace lightloom::view {

struct ViewOptions {
  LevelFiles files;
  std::string camera;      ///< to begin at; empty: the level's first, or one before the level
  std::string save_as;     ///< where an edited level goes
  std::string screenshot;  ///< taken when the script is done; then the viewer ends. Empty: none
  std::string script_name;
  std::vector<Action> script;
  int width = 1280, height = 720, shadow_size = 0;
  float exposure = 0;  ///< 0: from the first pictures
  float budget = 0;    ///< MB of cells and relight sets in memory; 0: no limit
  bool panel = true, validation = false;
};

/// Until the window is closed, the script says so, or the process is interrupted.
absl::Status run_viewer(const ViewOptions& options);

class Viewer {
 public:
  /// `messages` takes what the validation layers say, also while this is destroyed; it must outlive this.
  static absl::StatusOr<std::unique_ptr<Viewer>> create(ViewOptions options, std::vector<std::string>* messages);
  absl::Status run();

 private:
  Viewer(ViewOptions options, std::vector<std::string>* messages) : options_(std::move(options)), messages_(messages) {}
  absl::Status start();
  absl::Status begin_at_camera();
  /// Scene and asset from their files; lights and colours stay as they are.
  absl::Status reload(const std::string& scene);

  absl::Status frame();
  absl::Status draw();
  absl::Status show_marks();
  absl::Status look_after_bake();
  /// Reloads when someone else has baked the asset anew.
  void watch_asset();
  absl::Status look_from_camera();
  absl::Status step_script();
  absl::Status finish_script();
  bool script_waits();
  /// By hand: an error becomes a message.
  void act_by_hand(const Action& action);

  absl::Status act(const Action& action);
  absl::Status act_on_light(const Action& action);
  absl::Status act_on_object(const Action& action);
  absl::Status edit(const Action& action);
  absl::Status show(const Action& action);
  absl::Status go_to(const Action& action);
  absl::Status pick(const Action& action);
  absl::Status save(const std::string& path);
  absl::Status rebake();
  absl::Status expose_anew();

  // Destroyed from the last to the first.
  ViewOptions options_;
  std::vector<std::string>* messages_;
  std::unique_ptr<Window> window_;
  std::unique_ptr<renderer::Gpu> gpu_;
  std::unique_ptr<LiveLevel> level_;
  std::unique_ptr<Screen> screen_;
  Input input_;
  State state_;
  ChildBake bake_;
  absl::Status fatal_;                               ///< there is nothing left to show
  std::string saved_;                                ///< the file that holds the level as it was loaded or saved last
  std::string baked_;                                ///< the file of which the asset was baked last
  std::filesystem::file_time_type manifest_time_{};  ///< of the asset that is shown
  ElementOwners owners_;
  bool marks_are_old_ = true;

  int exposing_ = 0;  ///< frames to come of which the exposure is taken anew
  int quiet_ = 0;     ///< frames in which nothing happened
  bool done_ = false;
  size_t next_ = 0;  ///< of the script
  int wait_frames_ = 0;
  bool wait_bake_ = false, wait_reload_ = false, wait_arrival_ = false;
  VkExtent2D wait_size_{};  ///< of the window, asked for; 0: no wait
  std::string shot_;        ///< screenshot of the next frame; empty: none
  Stopwatch since_frame_, since_look_;
  std::optional<Vec3> last_position_;  ///< of the camera, a frame ago
  std::vector<uint8_t> cell_levels_;   ///< that the residency overlay shows
};

}  // namespace lightloom::view
