// What the window shows: the lit level, exposed and tone mapped, overlays and the user interface over it.
#pragma once

#include <memory>
#include <optional>

#include "cli/view/live_level.h"
#include "cli/view/ui.h"
#include "cli/view/window.h"
#include "core/scene/picture.h"
#include "runtime/renderer/lines.h"
#include "runtime/renderer/swapchain.h"
#include "runtime/renderer/tone_map.h"

namespace lightloom::view {

struct Shot {
  Camera camera;
  Layer layer = Layer::kFull;
  float exposure = 1;
  bool keep = false;  ///< for picture()
};

class Screen {
 public:
  /// Both must outlive this.
  static absl::StatusOr<std::unique_ptr<Screen>> create(const Window* window, renderer::Gpu* gpu);

  Ui& ui() { return *ui_; }
  /// Of the frames that are drawn; 0 × 0 before the first.
  VkExtent2D size() const { return {picture_.width, picture_.height}; }
  float aspect() const;

  absl::Status set_overlays(const renderer::Marks& marks) { return overlays_.set(marks); }
  absl::Status set_selection(const renderer::Marks& marks) { return selection_.set(marks); }

  /// Fits everything to the window and the level's renderer. False: the window has no area now; there is nothing to draw.
  absl::StatusOr<bool> fit(LiveLevel* level);
  /// After fit(), and between ui().end() and the next begin(): a frame of the runtime, drawn and presented.
  absl::Status draw(LiveLevel* level, const Shot& shot);
  /// What the last frame with `keep` showed; linear, as write_png() wants it.
  Image picture() const;

 private:
  Screen(const Window* window, renderer::Gpu* gpu, renderer::Swapchain swapchain)
      : window_(window), gpu_(gpu), swapchain_(std::move(swapchain)) {}
  absl::Status make_picture(VkExtent2D size);
  absl::Status record(VkCommandBuffer commands, LiveLevel* level, const Shot& shot);
  void record_keep(VkCommandBuffer commands) const;

  const Window* window_;
  renderer::Gpu* gpu_;
  renderer::Swapchain swapchain_;
  VkExtent2D window_size_{};
  bool out_of_date_ = true;
  int generation_ = -1;               ///< of the renderer that was fitted
  const LiveLevel* level_ = nullptr;  ///< that was fitted
  renderer::Texture2D picture_;
  renderer::Buffer kept_;
  renderer::ToneMap tone_map_;
  renderer::Lines overlays_, selection_;
  std::unique_ptr<Ui> ui_;
};

}  // namespace lightloom::view
