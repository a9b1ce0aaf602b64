#include "core/scene/exr_header.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/text.h"

namespace lightloom {
namespace {

/// Of attributes whose readers trust their type and not the size that the file gives
/// (https://openexr.com/en/latest/OpenEXRFileLayout.html).
const std::map<std::string_view, uint32_t> kSizes{{"box2i", 16},
                                                  {"box2f", 16},
                                                  {"chromaticities", 32},
                                                  {"compression", 1},
                                                  {"deepImageState", 1},
                                                  {"double", 8},
                                                  {"envmap", 1},
                                                  {"float", 4},
                                                  {"int", 4},
                                                  {"keycode", 28},
                                                  {"lineOrder", 1},
                                                  {"m33d", 72},
                                                  {"m33f", 36},
                                                  {"m44d", 128},
                                                  {"m44f", 64},
                                                  {"rational", 8},
                                                  {"tiledesc", 9},
                                                  {"timecode", 8},
                                                  {"v2d", 16},
                                                  {"v2f", 8},
                                                  {"v2i", 8},
                                                  {"v3d", 24},
                                                  {"v3f", 12},
                                                  {"v3i", 12}};

/// Reads on; nothing more once something was missing.
class Cursor {
 public:
  explicit Cursor(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  std::optional<std::span<const uint8_t>> take(uint64_t count) {
    if (count > bytes_.size()) return std::nullopt;
    const auto part = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return part;
  }
  std::optional<uint32_t> u32() {
    const auto b = take(4);
    if (!b) return std::nullopt;
    return (*b)[0] | (*b)[1] << 8 | (*b)[2] << 16 | static_cast<uint32_t>((*b)[3]) << 24;
  }
  std::optional<std::string_view> text() {
    const auto end = std::find(bytes_.begin(), bytes_.end(), 0);
    if (end == bytes_.end()) return std::nullopt;
    const std::string_view out(reinterpret_cast<const char*>(bytes_.data()), static_cast<size_t>(end - bytes_.begin()));
    bytes_ = bytes_.subspan(out.size() + 1);
    return out;
  }
  bool at_end() const { return bytes_.empty(); }

 private:
  std::span<const uint8_t> bytes_;
};

/// How many: names and 16 bytes each, then an empty name.
std::optional<uint32_t> count_channels(std::span<const uint8_t> bytes) {
  Cursor c(bytes);
  for (uint32_t count = 0;; ++count) {
    const auto name = c.text();
    if (!name || (name->empty() && !c.at_end())) return std::nullopt;
    if (name->empty()) return count;
    if (!c.take(16)) return std::nullopt;
  }
}

/// What OpenEXR makes room for when it opens a file: up to 256 lines, and a tile, of all channels.
struct Extent {
  int64_t width = 1, height = 1, channels = 1, tile_width = 1, tile_height = 1;

  /// One attribute; false if it cannot be one.
  bool add(std::string_view name, std::string_view type, std::span<const uint8_t> value) {
    Cursor c(value);
    if (type == "chlist") {
      const auto count = count_channels(value);
      if (count) channels = std::max<int64_t>(channels, *count);
      return count.has_value();
    }
    if (type == "tiledesc") {
      tile_width = *c.u32();
      tile_height = *c.u32();
    } else if (name == "dataWindow" && type == "box2i") {
      std::array<int64_t, 4> box;
      for (int64_t& x : box) x = static_cast<int32_t>(*c.u32());
      width = box[2] - box[0] + 1;
      height = box[3] - box[1] + 1;
    }
    return true;
  }
  bool readable() const {
    constexpr int64_t kMaxLine = 1 << 20, kMaxTile = 1 << 24, kMaxValues = 1 << 28;
    return width <= kMaxLine / channels && tile_width <= kMaxTile &&
           tile_height <= kMaxTile / channels / std::max<int64_t>(1, tile_width) &&
           height <= kMaxValues / channels / std::max<int64_t>(1, width);
  }
};

/// Width, height, and four bytes a pixel.
bool is_preview(std::span<const uint8_t> bytes) {
  Cursor c(bytes);
  const auto width = c.u32(), height = c.u32();
  return width && height && static_cast<uint64_t>(*width) * *height == (bytes.size() - 8) / 4 && bytes.size() % 4 == 0;
}

}  // namespace

absl::Status check_exr_header(std::span<const uint8_t> head, uint64_t file_bytes) {
  const auto bad = [](const std::string& why) { return absl::InvalidArgumentError(why); };
  constexpr uint32_t kMagic = 20000630, kDeepOrParts = 0x1800;
  Cursor c(head);
  const auto magic = c.u32(), version = c.u32();
  if (!version || *magic != kMagic) return bad("it does not start as an EXR does");
  if (*version & kDeepOrParts) return bad("it has several parts or deep pixels; save it as one flat part");
  for (Extent extent;;) {
    const auto name = c.text();
    if (name && name->empty()) {
      if (extent.readable()) return absl::OkStatus();
      return bad("it has more than 2^28 values, 2^20 in a line or 2^24 in a tile; scale it down");
    }
    const auto type = c.text();
    const auto size = c.u32();
    const auto value = size ? c.take(*size) : std::nullopt;
    if (!value) {
      return bad(head.size() < file_bytes ? "its header is damaged or longer than 1 MiB" : "its header ends too early");
    }
    const auto fixed = kSizes.find(*type);
    const bool sized = fixed != kSizes.end() ? fixed->second == *size : *type != "preview" || is_preview(*value);
    if (!sized || !extent.add(*name, *type, *value))
      return bad("the size of its attribute '" + printable(*name) + "' is wrong");
  }
}

}  // namespace lightloom
