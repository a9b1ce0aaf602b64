// Float images in and out: OpenEXR for data, PNG for eyes.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/base/vec.h"

namespace lightloom {

/// Planar channels of width × height floats, row 0 at the top (v = 0 for lightmaps).
struct Image {
  int width = 0, height = 0;
  struct Channel {
    std::string name;
    std::vector<float> values;
  };
  std::vector<Channel> channels;

  Image() = default;
  /// All values 0.
  Image(int width, int height, const std::vector<std::string>& names);

  size_t index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
  }
  /// nullptr if there is no such channel.
  const std::vector<float>* channel(const std::string& name) const;
  std::vector<float>* channel(const std::string& name);

  Vec3 rgb(int x, int y) const;  ///< channels R, G, B. REQUIRES: present
  void set_rgb(int x, int y, Vec3 value);
};

/// float32 scanline EXR, ZIP. Written atomically.
absl::Status write_exr(const Image& image, const std::filesystem::path& path);
/// Scanline or tiled EXR of any pixel type, converted to float. Size bounded by 2^28 values.
absl::StatusOr<Image> read_exr(const std::filesystem::path& path);
/// 8-bit sRGB PNG of R, G, B, already exposed to [0,1] linear. Written atomically.
absl::Status write_png(const Image& image, const std::filesystem::path& path);

}  // namespace lightloom
