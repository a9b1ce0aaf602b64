#include "core/scene/image.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfTiledOutputFile.h>
#include <gmock/gmock.h>
#include <half.h>
#include <stb/stb_image.h>

#include "tests/unit/scene/gltf_fixture.h"

namespace lightloom {
namespace {

using testing::HasSubstr;

TEST(Exr, RoundTripKeepsEveryBitAndName) {
  Image image(5, 3, {"R", "G", "B", "A", "area"});
  for (size_t c = 0; c < image.channels.size(); ++c) {
    for (size_t i = 0; i < 15; ++i)
      image.channels[c].values[i] = static_cast<float>(i * i) / 7.0f - static_cast<float>(c);
  }
  (*image.channel("area"))[2] = 1e-30f;
  const auto path = test_folder() / "new folder" / "a.exr";
  ASSERT_TRUE(write_exr(image, path).ok());
  const auto again = read_exr(path);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->width, 5);
  EXPECT_EQ(again->height, 3);
  ASSERT_EQ(again->channels.size(), 5u);
  for (const Image::Channel& c : image.channels) {
    ASSERT_NE(again->channel(c.name), nullptr) << c.name;
    EXPECT_EQ(*again->channel(c.name), c.values) << c.name;
  }
  EXPECT_EQ(again->channel("Z"), nullptr);
  EXPECT_EQ(again->rgb(4, 2), image.rgb(4, 2));
}

TEST(Exr, ReadsTiledHalfWithAnOffsetWindow) {
  const auto path = test_folder() / "tiled.exr";
  {
    Imf::Header header(Imath::Box2i({0, 0}, {99, 99}), Imath::Box2i({10, 20}, {12, 21}));
    header.channels().insert("Y", Imf::Channel(Imf::HALF));
    header.setTileDescription(Imf::TileDescription(16, 16));
    std::vector<half> values{half(0.5f), half(1), half(2), half(-1), half(0), half(65504)};
    Imf::FrameBuffer frame;
    frame.insert("Y", Imf::Slice::Make(Imf::HALF, values.data(), header.dataWindow()));
    Imf::TiledOutputFile file(path.c_str(), header);
    file.setFrameBuffer(frame);
    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
  }
  const auto image = read_exr(path);
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->width, 3);
  EXPECT_EQ(image->height, 2);
  EXPECT_THAT(*image->channel("Y"), testing::ElementsAre(0.5f, 1, 2, -1, 0, 65504));
}

TEST(Exr, RefusesWhatItCannotRead) {
  const auto folder = test_folder();
  EXPECT_EQ(read_exr(folder / "none.exr").status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(read_exr(folder).status().message()), HasSubstr("regular file"));
  ASSERT_TRUE(write_file_atomic(folder / "text.exr", std::string_view("not an image at all")).ok());
  EXPECT_THAT(std::string(read_exr(folder / "text.exr").status().message()), HasSubstr("not a readable EXR"));

  const Image image(64, 64, {"R"});
  ASSERT_TRUE(write_exr(image, folder / "a.exr").ok());
  auto bytes = read_file(folder / "a.exr");
  ASSERT_TRUE(bytes.ok());
  bytes->resize(bytes->size() / 2);
  ASSERT_TRUE(write_file_atomic(folder / "half.exr", *bytes).ok());
  EXPECT_FALSE(read_exr(folder / "half.exr").ok());

  // The first attribute claims 2 GiB: refused before anybody makes room for that.
  bytes = read_file(folder / "a.exr");
  ASSERT_TRUE(bytes.ok());
  const std::string_view channels("channels\0chlist\0", 16);
  const auto at = std::search(bytes->begin(), bytes->end(), channels.begin(), channels.end()) + 16;
  ASSERT_LT(at, bytes->end() - 4);
  at[3] = 0x7f;
  ASSERT_TRUE(write_file_atomic(folder / "vast.exr", *bytes).ok());
  EXPECT_THAT(std::string(read_exr(folder / "vast.exr").status().message()), HasSubstr("header ends too early"));

  // So wide that a line would not fit.
  bytes = read_file(folder / "a.exr");
  ASSERT_TRUE(bytes.ok());
  const std::string_view window("dataWindow\0box2i\0", 17);
  const auto box = std::search(bytes->begin(), bytes->end(), window.begin(), window.end()) + 17 + 4;
  ASSERT_LT(box, bytes->end() - 16);
  box[11] = 0x7f;
  ASSERT_TRUE(write_file_atomic(folder / "wide.exr", *bytes).ok());
  EXPECT_THAT(std::string(read_exr(folder / "wide.exr").status().message()), HasSubstr("2^20 in a line"));
  EXPECT_FALSE(write_exr(Image(), folder / "empty.exr").ok());
}

TEST(Png, IsSrgbWithRowZeroAtTheTop) {
  Image image(2, 2, {"R", "G", "B"});
  image.set_rgb(0, 0, {1, 0, 0});
  image.set_rgb(1, 0, {0.21404114f, 0.21404114f, 0.21404114f});  // sRGB 0.5
  image.set_rgb(0, 1, {2, -1, std::numeric_limits<float>::quiet_NaN()});
  image.set_rgb(1, 1, {0.002f, 0, 1});
  const auto path = test_folder() / "a.png";
  ASSERT_TRUE(write_png(image, path).ok());
  int w = 0, h = 0, n = 0;
  uint8_t* pixels = stbi_load(path.c_str(), &w, &h, &n, 3);
  ASSERT_NE(pixels, nullptr);
  EXPECT_EQ(w, 2);
  EXPECT_EQ(h, 2);
  EXPECT_THAT(std::vector<int>(pixels, pixels + 12),
              testing::ElementsAre(255, 0, 0, 128, 128, 128, 255, 0, 0, 7, 0, 255));
  stbi_image_free(pixels);
  EXPECT_FALSE(write_png(Image(2, 2, {"Y"}), path).ok());
}

}  // namespace
}  // namespace lightloom
