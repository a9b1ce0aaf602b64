#include "core/scene/image.h"

#include <stb/stb_image_write.h>

#include <cmath>

#include "core/base/check.h"
#include "core/base/file.h"
#include "core/scene/srgb.h"

namespace lightloom {
namespace {

/// Linear to sRGB, 8 bits.
uint8_t srgb8(float linear) {
  const float c = linear > 0 ? std::min(linear, 1.0f) : 0.0f;  // NaN becomes 0
  return static_cast<uint8_t>(std::lround(to_srgb(c) * 255));
}

}  // namespace

Image::Image(int w, int h, const std::vector<std::string>& names) : width(w), height(h) {
  for (const std::string& name : names) {
    channels.push_back({name, std::vector<float>(static_cast<size_t>(w) * static_cast<size_t>(h), 0.0f)});
  }
}

const std::vector<float>* Image::channel(const std::string& name) const {
  for (const Channel& c : channels) {
    if (c.name == name) return &c.values;
  }
  return nullptr;
}

std::vector<float>* Image::channel(const std::string& name) {
  return const_cast<std::vector<float>*>(static_cast<const Image*>(this)->channel(name));
}

Vec3 Image::rgb(int x, int y) const {
  const auto *r = channel("R"), *g = channel("G"), *b = channel("B");
  LL_CHECK(r && g && b);
  const size_t i = index(x, y);
  return {(*r)[i], (*g)[i], (*b)[i]};
}

void Image::set_rgb(int x, int y, Vec3 value) {
  auto *r = channel("R"), *g = channel("G"), *b = channel("B");
  LL_CHECK(r && g && b);
  const size_t i = index(x, y);
  (*r)[i] = value.x;
  (*g)[i] = value.y;
  (*b)[i] = value.z;
}

absl::Status write_png(const Image& image, const std::filesystem::path& path) {
  const auto *r = image.channel("R"), *g = image.channel("G"), *b = image.channel("B");
  if (image.width <= 0 || image.height <= 0 || !r || !g || !b) {
    return absl::InvalidArgumentError("cannot write " + path.string() + ": a PNG needs pixels and channels R, G, B");
  }
  std::vector<uint8_t> pixels;
  pixels.reserve(r->size() * 3);
  for (size_t i = 0; i < r->size(); ++i) {
    for (const auto* c : {r, g, b}) pixels.push_back(srgb8((*c)[i]));
  }
  std::vector<uint8_t> png;
  const auto append = [](void* out, void* data, int size) {
    const auto* bytes = static_cast<const uint8_t*>(data);
    static_cast<std::vector<uint8_t>*>(out)->insert(static_cast<std::vector<uint8_t>*>(out)->end(), bytes,
                                                    bytes + size);
  };
  if (!stbi_write_png_to_func(append, &png, image.width, image.height, 3, pixels.data(), image.width * 3)) {
    return absl::ResourceExhaustedError("cannot write " + path.string() + ": not enough memory to encode the PNG");
  }
  return write_file_atomic(path, png);
}

}  // namespace lightloom
