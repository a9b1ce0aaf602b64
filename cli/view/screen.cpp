#include "cli/view/screen.h"

#include <array>

#include "core/scene/srgb.h"
#include "runtime/renderer/status.h"

namespace lightloom::view {

using namespace renderer;  // what is drawn with

absl::StatusOr<std::unique_ptr<Screen>> Screen::create(const Window* window, Gpu* gpu) {
  LL_ASSIGN_OR_RETURN(Swapchain swapchain, Swapchain::create(gpu));
  std::unique_ptr<Screen> screen(new Screen(window, gpu, std::move(swapchain)));
  const VkFormat format = screen->swapchain_.picture_format();
  LL_ASSIGN_OR_RETURN(screen->tone_map_, ToneMap::create(*gpu, format));
  LL_ASSIGN_OR_RETURN(screen->overlays_, Lines::create(gpu, format));
  LL_ASSIGN_OR_RETURN(screen->selection_, Lines::create(gpu, format));
  LL_ASSIGN_OR_RETURN(screen->ui_, Ui::create(window->handle(), gpu, format));
  return screen;
}

float Screen::aspect() const {
  return picture_.height > 0 ? static_cast<float>(picture_.width) / static_cast<float>(picture_.height) : 1;
}

absl::Status Screen::make_picture(VkExtent2D size) {
  TextureInfo info;
  info.format = swapchain_.picture_format();
  info.width = size.width;
  info.height = size.height;
  info.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  LL_ASSIGN_OR_RETURN(picture_, gpu_->texture(info));
  LL_ASSIGN_OR_RETURN(kept_,
                      gpu_->host_buffer(uint64_t{4} * size.width * size.height, VK_BUFFER_USAGE_TRANSFER_DST_BIT));
  return ui_->set_picture(picture_);
}

absl::StatusOr<bool> Screen::fit(LiveLevel* level) {
  const VkExtent2D size = window_->size();
  if (size.width == 0 || size.height == 0) return false;
  if (out_of_date_ || size.width != window_size_.width || size.height != window_size_.height) {
    LL_ASSIGN_OR_RETURN(const bool has_area, swapchain_.resize(size.width, size.height));
    if (!has_area) return false;
    window_size_ = size;
    out_of_date_ = false;
    generation_ = -1;
  }
  const VkExtent2D extent = swapchain_.extent();
  if (extent.width != picture_.width || extent.height != picture_.height) LL_RETURN_IF_ERROR(make_picture(extent));
  if (level_ != level || generation_ != level->renderer_generation()) {
    LL_RETURN_IF_ERROR(level->renderer().set_size(extent.width, extent.height));
    tone_map_.set_source(level->renderer().colour());
    level_ = level;
    generation_ = level->renderer_generation();
  }
  return true;
}

absl::Status Screen::draw(LiveLevel* level, const Shot& shot) {
  LL_ASSIGN_OR_RETURN(const std::optional<uint32_t> image, swapchain_.acquire());
  out_of_date_ = !image;
  LL_RETURN_IF_ERROR(level->renderer().set_view(shot.camera, shot.layer));
  const auto semaphores = image ? swapchain_.semaphores(*image) : Semaphores{};
  LL_RETURN_IF_ERROR(gpu_->run(
      [&](VkCommandBuffer commands) -> absl::Status {
        LL_RETURN_IF_ERROR(record(commands, level, shot));
        if (image) {
          swapchain_.record_copy(commands, picture_, *image);
        } else {
          transition(commands, picture_.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kColour, kCopySource);
        }
        if (shot.keep) record_keep(commands);
        return absl::OkStatus();
      },
      semaphores));
  if (image) {
    LL_ASSIGN_OR_RETURN(const bool good, swapchain_.present(*image));
    out_of_date_ = !good;
  }
  return gpu_->validation();
}

absl::Status Screen::record(VkCommandBuffer commands, LiveLevel* level, const Shot& shot) {
  const Renderer& renderer = level->renderer();
  LL_RETURN_IF_ERROR(
      renderer.record(commands, [&](VkCommandBuffer between) { return level->runtime().record(renderer, between); }));
  tone_map_.record(commands, picture_, shot.layer == Layer::kAlbedo ? 0 : shot.exposure);
  overlays_.record(commands, shot.camera, picture_, renderer.depth());
  selection_.record(commands, shot.camera, picture_, renderer.depth());
  return ui_->record(commands);
}

void Screen::record_keep(VkCommandBuffer commands) const {
  VkBufferImageCopy region{};
  region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  region.imageExtent = {picture_.width, picture_.height, 1};
  vkCmdCopyImageToBuffer(commands, picture_.handle.get(), kCopySource.layout, kept_.handle.get(), 1, &region);
  after_copies(commands);
}

Image Screen::picture() const {
  Image image(static_cast<int>(picture_.width), static_cast<int>(picture_.height), {"R", "G", "B"});
  const auto* const texels = static_cast<const std::array<uint8_t, 4>*>(kept_.mapped);
  const bool bgr = picture_.format == VK_FORMAT_B8G8R8A8_UNORM;
  const auto linear = [](uint8_t v) { return static_cast<float>(from_srgb(v / 255.0)); };
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const auto& t = texels[image.index(x, y)];
      image.set_rgb(x, y, {linear(t[bgr ? 2 : 0]), linear(t[1]), linear(t[bgr ? 0 : 2])});
    }
  }
  return image;
}

}  // namespace lightloom::view
