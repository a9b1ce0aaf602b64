#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>

#include <algorithm>
#include <exception>
#include <fstream>
#include <string>
#include <system_error>

#include "core/base/file.h"
#include "core/base/text.h"
#include "core/scene/exr_header.h"
#include "core/scene/image.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

absl::Status check_header(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::error_code code;
  const uint64_t bytes = fs::file_size(path, code);
  if (code || !file) return absl::InvalidArgumentError("it cannot be opened");
  std::vector<uint8_t> head(std::min(bytes, kMaxExrHeader));
  file.read(reinterpret_cast<char*>(head.data()), static_cast<std::streamsize>(head.size()));
  if (!file) return absl::InvalidArgumentError("it cannot be read");
  return check_exr_header(head, bytes);
}

absl::Status cannot_write(const fs::path& path, const std::string& why) {
  return absl::InvalidArgumentError("cannot write " + path.string() + ": " + why);
}

}  // namespace

absl::Status write_exr(const Image& image, const fs::path& path) {
  const auto pixels = static_cast<size_t>(image.width) * static_cast<size_t>(image.height);
  if (image.width <= 0 || image.height <= 0 || image.channels.empty()) return cannot_write(path, "the image is empty");
  std::error_code code;
  if (path.has_parent_path()) fs::create_directories(path.parent_path(), code);
  if (code) return cannot_write(path, code.message());

  const fs::path temporary = temporary_beside(path);
  try {
    Imf::Header header(image.width, image.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::FrameBuffer frame;
    for (const Image::Channel& c : image.channels) {
      if (c.values.size() != pixels) return cannot_write(path, "channel " + printable(c.name) + " has the wrong size");
      header.channels().insert(c.name, Imf::Channel(Imf::FLOAT));
      // OpenEXR's slices are not const, but writing only reads them.
      auto* base = reinterpret_cast<char*>(const_cast<float*>(c.values.data()));
      frame.insert(c.name,
                   Imf::Slice(Imf::FLOAT, base, sizeof(float), sizeof(float) * static_cast<size_t>(image.width)));
    }
    Imf::OutputFile file(temporary.c_str(), header);
    file.setFrameBuffer(frame);
    file.writePixels(image.height);
  } catch (const std::exception& e) {
    fs::remove(temporary, code);
    return cannot_write(path, e.what());
  }
  return commit_file(temporary, path);
}

absl::StatusOr<Image> read_exr(const fs::path& path) {
  const auto broken = [&](const std::string& why) {
    return absl::InvalidArgumentError(path.string() + " is not a readable EXR: " + why);
  };
  std::error_code code;
  if (!fs::exists(path, code)) return absl::NotFoundError("cannot open " + path.string() + ": no such file");
  if (!fs::is_regular_file(path, code)) return broken("it is not a regular file");
  if (const absl::Status header = check_header(path); !header.ok()) return broken(std::string(header.message()));
  try {
    Imf::InputFile file(path.c_str());
    const Imath::Box2i window = file.header().dataWindow();
    const int64_t width = int64_t{window.max.x} - window.min.x + 1, height = int64_t{window.max.y} - window.min.y + 1;
    int64_t count = 0;
    for (auto c = file.header().channels().begin(); c != file.header().channels().end(); ++c) {
      if (c.channel().xSampling != 1 || c.channel().ySampling != 1) {
        return broken("channel " + printable(c.name()) + " is subsampled; save it at full resolution");
      }
      ++count;
    }
    if (width <= 0 || height <= 0 || count == 0) return broken("it has no pixels");

    Image image;
    image.width = static_cast<int>(width);
    image.height = static_cast<int>(height);
    const auto pixels = static_cast<size_t>(width * height);
    for (auto c = file.header().channels().begin(); c != file.header().channels().end(); ++c) {
      image.channels.push_back({c.name(), std::vector<float>(pixels)});
    }
    Imf::FrameBuffer frame;
    for (Image::Channel& c : image.channels) {
      frame.insert(c.name, Imf::Slice::Make(Imf::FLOAT, c.values.data(), window, sizeof(float),
                                            sizeof(float) * static_cast<size_t>(width)));
    }
    file.setFrameBuffer(frame);
    file.readPixels(window.min.y, window.max.y);
    return image;
  } catch (const std::exception& e) {
    return broken(printable(e.what(), 300));
  }
}

}  // namespace lightloom
