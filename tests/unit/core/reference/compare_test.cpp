#include "core/reference/compare.h"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <limits>

namespace lightloom {
namespace {

/// One row of grey pixels.
Image row(std::initializer_list<float> values, std::vector<std::string> extra = {}) {
  extra.insert(extra.begin(), {"R", "G", "B"});
  Image image(static_cast<int>(values.size()), 1, extra);
  int x = 0;
  for (const float v : values) image.set_rgb(x++, 0, {v, v, v});
  return image;
}

Comparison compared(const Image& a, const Image& b, const CompareOptions& options = {}) {
  const absl::StatusOr<Comparison> result = compare(a, b, options);
  EXPECT_TRUE(result.ok()) << result.status();
  return result.ok() ? *result : Comparison{};
}

TEST(Compare, EqualImagesDoNotDiffer) {
  const Image a = row({1, 2, 3});
  const Comparison c = compared(a, a);
  EXPECT_EQ(c.rel_rmse, 0);
  EXPECT_TRUE(std::isinf(c.psnr));
  EXPECT_EQ(c.bias, 0);
  EXPECT_EQ(c.p99, 0);
  EXPECT_DOUBLE_EQ(c.ratio, 1);
  EXPECT_EQ(c.ratio_error, 0);
  EXPECT_EQ(c.texels, 3u);
}

TEST(Compare, GreyByHand) {
  const Comparison c = compared(row({1, 2, 4, 8}), row({2, 2, 4, 4}));
  // Differences −1, 0, 0, 4; truth 2, 2, 4, 4 with mean 3.
  EXPECT_NEAR(c.rel_rmse, std::sqrt(17.0 / 40), 1e-7);
  EXPECT_NEAR(c.psnr, 20 * std::log10(4 / std::sqrt(17.0 / 4)), 1e-6);
  EXPECT_NEAR(c.bias, 3.0 / 12, 1e-7);
  EXPECT_NEAR(c.p50, 0, 1e-7);  // |d| ÷ 3, sorted: 0, 0, 1/3, 4/3
  EXPECT_NEAR(c.p95, 4.0 / 3, 1e-6);
  EXPECT_NEAR(c.p99, 4.0 / 3, 1e-6);
  EXPECT_NEAR(c.ratio, 15.0 / 12, 1e-7);
  // Residuals a − 1.25 b: −1.5, −0.5, −1, 3.
  EXPECT_NEAR(c.ratio_error, std::sqrt(2.25 + 0.25 + 1 + 9) / 12, 1e-7);
}

TEST(Compare, ChannelsCountAlike) {
  Image a(1, 1, {"R", "G", "B"}), b(1, 1, {"R", "G", "B"});
  a.set_rgb(0, 0, {1, 2, 6});
  b.set_rgb(0, 0, {1, 2, 3});
  const Comparison c = compared(a, b);
  EXPECT_NEAR(c.rel_rmse, std::sqrt(9.0 / 14), 1e-7);
  EXPECT_NEAR(c.bias, 0.5, 1e-7);
  EXPECT_NEAR(c.ratio, 1.5, 1e-7);
  EXPECT_NEAR(c.p50, 0, 1e-7);
  EXPECT_NEAR(c.p99, 1.5, 1e-6);  // 3 ÷ mean 2
}

TEST(Compare, RatioLeavesOutWhatIsDark) {
  // The second pixel is below a tenth of the mean of 5.25: its error of 900 % does not count.
  const Comparison c = compared(row({11, 5}), row({10, 0.5f}));
  EXPECT_NEAR(c.ratio, 1.1, 1e-6);
  EXPECT_NEAR(c.bias, 5.5 / 10.5, 1e-6);
}

TEST(Compare, InvalidInEitherImageIsLeftOut) {
  Image a = row({1, 2, 100, 100}, {"A"}), b = row({1, 4, 3, 3}, {"A"});
  *a.channel("A") = {1, 1, 0, 1};
  *b.channel("A") = {1, 1, 1, 0};
  const Comparison c = compared(a, b);
  EXPECT_EQ(c.texels, 2u);
  EXPECT_NEAR(c.rel_rmse, std::sqrt(4.0 / 17), 1e-7);

  // Not finite where it is not valid: no matter.
  a.set_rgb(2, 0, {std::nanf(""), 0, 0});
  EXPECT_NEAR(compared(a, b).rel_rmse, std::sqrt(4.0 / 17), 1e-7);
}

TEST(Compare, AreaOfEitherWeighs) {
  const Image plain = row({1, 3});
  Image weighted = row({2, 3}, {"area"});
  *weighted.channel("area") = {3, 1};
  // As truth: differences −1, 0; weights 3, 1; truth 2, 3.
  EXPECT_NEAR(compared(plain, weighted).rel_rmse, std::sqrt(3.0 / (12 + 9)), 1e-7);
  // As the image under test: differences 1, 0; truth 1, 3.
  const Comparison c = compared(weighted, plain);
  EXPECT_NEAR(c.rel_rmse, std::sqrt(3.0 / (3 + 9)), 1e-7);
  EXPECT_NEAR(c.bias, 3.0 / 6, 1e-7);
  EXPECT_NEAR(c.p50, 1 / 1.5, 1e-6);  // three quarters of the area have |d| = 1, the mean is 6 ÷ 4
}

TEST(Compare, BlocksAverageFirst) {
  // Noise of opposite sign inside a 2 × 2 block cancels; the block at the ragged right edge holds one column.
  Image a(3, 2, {"R", "G", "B"}), b(3, 2, {"R", "G", "B"});
  const float noise[2][3] = {{0.5f, -0.5f, 1}, {-0.5f, 0.5f, 1}};
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) {
      const float v = 2 + noise[y][x];
      a.set_rgb(x, y, {v, v, v});
      b.set_rgb(x, y, {2, 2, 2});
    }
  }
  EXPECT_NEAR(compared(a, b).rel_rmse, std::sqrt((4 * 0.25 + 2) / (6 * 4)), 1e-7);
  const Comparison c = compared(a, b, {2, 1});
  // Weights 4 and 2, differences 0 and 1.
  EXPECT_NEAR(c.rel_rmse, std::sqrt(2.0 / (6 * 4)), 1e-7);
  EXPECT_NEAR(c.ratio, 14.0 / 12, 1e-7);
  EXPECT_EQ(c.texels, 6u);
}

TEST(Compare, BlocksTakeValidPixelsOnly) {
  Image a = row({1, 9}, {"A"}), b = row({1, 2}, {"A"});
  *a.channel("A") = {1, 0};
  *b.channel("A") = {1, 1};
  EXPECT_EQ(compared(a, b, {4, 1}).rel_rmse, 0);
}

TEST(Compare, ScalesTheSecond) {
  const Comparison c = compared(row({3, 6}), row({1, 2}), {1, 3});
  EXPECT_NEAR(c.rel_rmse, 0, 1e-7);
  EXPECT_NEAR(c.ratio, 1, 1e-7);
  EXPECT_NEAR(compared(row({3, 6}), row({1, 2})).ratio, 3, 1e-7);
}

TEST(Compare, BlackTruth) {
  EXPECT_EQ(compared(row({0, 0}), row({0, 0})).rel_rmse, 0);
  EXPECT_TRUE(std::isinf(compared(row({0, 1}), row({0, 0})).rel_rmse));
}

TEST(Compare, RefusesWhatCannotBeCompared) {
  EXPECT_EQ(compare(row({1, 2}), row({1}), {}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_FALSE(compare(Image(1, 2, {"R", "G", "B"}), Image(2, 1, {"R", "G", "B"}), {}).ok());
  EXPECT_FALSE(compare(Image(1, 1, {"R", "G"}), row({1}), {}).ok());
  EXPECT_FALSE(compare(row({1}), Image(1, 1, {"Y"}), {}).ok());

  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    EXPECT_EQ(compare(row({1, bad}), row({1, 2}), {}).status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_FALSE(compare(row({1, 2}), row({bad, 2}), {}).ok());
  }
  Image masked = row({1}, {"A"});
  EXPECT_FALSE(compare(masked, row({1}), {}).ok()) << "nothing is valid";
}

TEST(DifferenceImage, ShowsErrorsAgainstTwiceTheMean) {
  Image b = row({1, 3, 50}, {"A"});
  *b.channel("A") = {1, 1, 0};
  const Image d = difference_image(row({2, 3, 7}), b, {}, 8);
  EXPECT_NEAR(d.rgb(0, 0).y, 8.0f / 4, 1e-6f);  // error 1, mean 2
  EXPECT_EQ(d.rgb(1, 0), Vec3{});
  EXPECT_EQ(d.rgb(2, 0), Vec3{});
}

TEST(DifferenceImage, BlocksAreAveragedBeforeTheyAreCompared) {
  // Errors +1, −1 cancel in the first block; +2, 0 are 1 in the second.
  const Image d = difference_image(row({2, 0, 3, 1}), row({1, 1, 1, 1}), {.block = 2}, 8);
  EXPECT_NEAR(d.rgb(0, 0).x, 0, 1e-6f);
  EXPECT_NEAR(d.rgb(1, 0).x, 0, 1e-6f);
  EXPECT_NEAR(d.rgb(2, 0).x, 8.0f / 2, 1e-6f);  // mean 1
  EXPECT_NEAR(d.rgb(3, 0).x, 8.0f / 2, 1e-6f);
}

}  // namespace
}  // namespace lightloom
