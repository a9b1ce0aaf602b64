// The forward pass against ray casting on the CPU (core/relight/camera_view), with core and synchronization validation:
// not one message is tolerated, those of destruction included. E is a smooth made-up field, so that nothing is baked.
#include "runtime/renderer/renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "core/relight/camera_view.h"
#include "core/scene/builtin.h"
#include "core/scene/shapes.h"
#include "tests/support/test_scenes.h"

namespace lightloom::renderer {
namespace {

/// A level with E, and a renderer of it.
class Drawn {
 public:
  explicit Drawn(Scene scene, uint32_t shadow_size = 1024) : scene_(std::move(scene)) {
    LayoutOptions options;
    options.texels_per_metre = 4;
    tracer_ = std::move(*RayTracer::create(scene_));
    elements_.layout = *make_layout(scene_, options);
    elements_.receivers = *find_receivers(*tracer_, elements_.layout, {});
    for (const Receiver& r : elements_.receivers.all) {
      const Vec3 p = r.point.position, n = r.point.normal;
      e_.push_back({2 + std::sin(p.x) + 0.2f * n.x, 2 + std::sin(p.y) + 0.2f * n.y, 2 + std::cos(p.z) + 0.2f * n.z});
    }
    auto gpu = Gpu::create(true, &messages_);
    EXPECT_TRUE(gpu.ok()) << gpu.status();
    gpu_ = std::move(*gpu);
    auto made = Renderer::create(gpu_.get(), scene_, elements_.layout, shadow_size);
    EXPECT_TRUE(made.ok()) << made.status();
    renderer_ = std::move(*made);
    const absl::Status set =
        renderer_->set_irradiance(lightmap_image(elements_, e_), lightmap_image(elements_, e_, true));
    EXPECT_TRUE(set.ok()) << set;
  }
  ~Drawn() {
    renderer_.reset();
    gpu_.reset();
    EXPECT_TRUE(messages_.empty()) << messages_.front();
  }

  Scene& scene() { return scene_; }
  Renderer& renderer() { return *renderer_; }
  Image vulkan(Layer layer, int width = 160, int samples = 4) {
    auto image = renderer_->render(scene_.cameras.front(), {width, samples, layer});
    EXPECT_TRUE(image.ok()) << image.status();
    return std::move(*image);
  }
  Image cpu(Layer layer, int width = 160, int samples = 4) {
    ViewOptions options;
    options.width = width;
    options.samples = samples;
    options.layer = layer;
    return *render_view(*tracer_, elements_, e_, scene_.cameras.front(), options);
  }

 private:
  std::vector<std::string> messages_;
  Scene scene_;
  std::unique_ptr<RayTracer> tracer_;
  SurfaceElements elements_;
  std::vector<Vec3> e_;
  std::unique_ptr<Gpu> gpu_;
  std::unique_ptr<Renderer> renderer_;
};

/// Of |a − b| over pixels and channels, ÷ the mean of b.
struct Difference {
  double median = 0, p95 = 0, mean = 0;
};
Difference difference(const Image& a, const Image& b) {
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  std::vector<double> d;
  double sum = 0;
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        const float va = a.rgb(x, y)[c], vb = b.rgb(x, y)[c];
        EXPECT_TRUE(std::isfinite(va)) << x << "," << y;
        d.push_back(std::abs(static_cast<double>(va) - vb));
        sum += vb;
      }
    }
  }
  const double mean = sum / static_cast<double>(d.size());
  EXPECT_GT(mean, 0) << "a black picture proves nothing";
  double all = 0;
  for (const double v : d) all += v;
  std::sort(d.begin(), d.end());
  return {d[d.size() / 2] / mean, d[d.size() * 95 / 100] / mean, all / static_cast<double>(d.size()) / mean};
}

Vec3 mean_of(const Image& image) {
  Vec3 sum;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) sum += image.rgb(x, y);
  }
  return sum / static_cast<float>(image.width * image.height);
}

Camera camera_at(Vec3 position, Vec3 target, float yfov) {
  Camera c;
  c.position = position;
  c.forward = normalize(target - position);
  c.right = normalize(cross(c.forward, {0, 1, 0}));
  c.up = cross(c.right, c.forward);
  c.yfov = yfov;
  return c;
}

/// A 6 m floor with a box and a thin wall on it, seen from above, one light to be added.
Scene shadow_level() {
  Scene scene = test::open_plane(6, {});
  const uint32_t grey = test::add_material(&scene, "grey", {0.6f, 0.5f, 0.4f});
  test::add_solid_box(&scene, "box", {-1, 0.001f, -1}, {0, 1, 0.2f}, grey);
  test::add_solid_box(&scene, "thin", {0.8f, 0.001f, -1.5f}, {0.85f, 1.5f, 1.5f}, grey);
  scene.materials[0].base_color = {0.7f, 0.7f, 0.7f};
  test::identify(&scene);
  scene.cameras.push_back(camera_at({-3, 4, 4}, {0, 0, 0}, 0.9f));
  return scene;
}

TEST(Renderer, PicturesEqualRayCasting) {
  for (const char* name : {"cornell", "flat"}) {
    SCOPED_TRACE(name);
    Drawn level(*builtin_scene(name));
    // What has edges of shadows, silhouettes or lightmap charts in it may differ there, by half a pixel or texel.
    for (const Layer layer : {Layer::kFull, Layer::kDirect, Layer::kIndirect, Layer::kE, Layer::kAlbedo}) {
      SCOPED_TRACE(static_cast<int>(layer));
      const Difference d = difference(level.vulkan(layer), level.cpu(layer));
      EXPECT_LT(d.median, 0.002);
      EXPECT_LT(d.p95, 0.08);
      EXPECT_LT(d.mean, 0.02);
    }
  }
}

TEST(Renderer, LayersAddUp) {
  Scene scene = *builtin_scene("flat");
  scene.environment = {0.5f, 0.6f, 0.9f};
  scene.materials[1].emission = {0.3f, 0.2f, 0.1f};
  Drawn level(std::move(scene));
  const Image full = level.vulkan(Layer::kFull), direct = level.vulkan(Layer::kDirect),
              indirect = level.vulkan(Layer::kIndirect);
  for (int y = 0; y < full.height; ++y) {
    for (int x = 0; x < full.width; ++x) {
      const Vec3 sum = direct.rgb(x, y) + indirect.rgb(x, y), f = full.rgb(x, y);
      ASSERT_LT(length(f - sum), 1e-4f * (0.1f + length(f))) << x << "," << y;
    }
  }
}

class ShadowsEqualRays : public ::testing::TestWithParam<LightType> {};

TEST_P(ShadowsEqualRays, OfEachLight) {
  Scene scene = shadow_level();
  Light light;
  light.type = GetParam();
  light.position = {-1.5f, 2.5f, 1.2f};
  light.direction = normalize(Vec3{0.5f, -1, -0.4f});
  light.intensity = light.type == LightType::kDirectional ? 3 : 20;
  light.inner_cone_angle = 0.3f;
  light.outer_cone_angle = 0.7f;
  scene.lights.push_back(light);
  Drawn level(std::move(scene));
  const Image shadow_maps = level.vulkan(Layer::kDirect, 320), rays = level.cpu(Layer::kDirect, 320);
  const Difference d = difference(shadow_maps, rays);
  EXPECT_LT(d.median, 0.002);
  EXPECT_LT(d.p95, 0.05);    // no acne: lit surfaces are lit
  EXPECT_LT(d.mean, 0.008);  // no leaks, no peter-panning: shadows differ at their edges alone
}
INSTANTIATE_TEST_SUITE_P(All, ShadowsEqualRays,
                         ::testing::Values(LightType::kPoint, LightType::kSpot, LightType::kDirectional));

TEST(Renderer, SurfacesAtGrazingLightDoNotShadowThemselves) {
  Scene scene = test::open_plane(6, {});
  scene.materials[0].base_color = {0.7f, 0.7f, 0.7f};
  test::add_point_light(&scene, {-3.2f, 0.15f, 0.3f}, 10);
  scene.cameras.push_back(camera_at({0, 5, 0.1f}, {0, 0, 0}, 1.0f));
  Drawn level(std::move(scene), 256);
  // Every point of the plane sees the lamp.
  const Image maps = level.vulkan(Layer::kDirect), rays = level.cpu(Layer::kDirect);
  int dark = 0, lit = 0;
  for (int y = 0; y < maps.height; ++y) {
    for (int x = 0; x < maps.width; ++x) {
      lit += rays.rgb(x, y).x > 0;
      dark += maps.rgb(x, y).x < 0.9f * rays.rgb(x, y).x;
    }
  }
  EXPECT_GT(lit, 10000);
  EXPECT_LT(dark, lit / 500);
}

TEST(Renderer, MaskedHolesLetLightAndViewThrough) {
  Scene scene = test::open_plane(6, {});
  scene.materials[0].base_color = {0.7f, 0.7f, 0.7f};
  Texture checker;
  checker.width = checker.height = 8;
  for (int i = 0; i < 64; ++i) {
    const bool hole = ((i % 8) / 2 + i / 16) % 2 == 0;
    checker.rgba.insert(checker.rgba.end(), {200, 120, 40, static_cast<uint8_t>(hole ? 0 : 255)});
  }
  scene.textures.push_back(checker);
  const uint32_t mask = test::add_material(&scene, "mask", {1, 1, 1});
  scene.materials[mask].base_color_texture = 0;
  scene.materials[mask].alpha_mode = AlphaMode::kMask;
  scene.materials[mask].double_sided = true;
  Object& screen = test::add_wall_object(&scene, "screen", {-1, 1, 1}, {1, 1, 1}, {1, 1, -1}, {-1, 1, -1}, mask);
  screen.uv0 = screen.uv1;
  test::identify(&scene);
  test::add_point_light(&scene, {0.2f, 2.5f, 0.1f}, 20);
  scene.cameras.push_back(camera_at({-2, 4, 3}, {0, 0, 0}, 0.9f));
  Drawn level(std::move(scene));
  const Difference d = difference(level.vulkan(Layer::kDirect, 320), level.cpu(Layer::kDirect, 320));
  EXPECT_LT(d.median, 0.002);
  EXPECT_LT(d.mean, 0.04);  // 32 holes are mostly edges
}

TEST(Renderer, BacksHaveAnEOfTheirOwn) {
  Scene scene = test::closed_box({4, 3, 4});
  const uint32_t leaf = test::add_material(&scene, "leaf", {0.5f, 0.5f, 0.5f});
  scene.materials[leaf].double_sided = true;
  test::add_wall_object(&scene, "screen", {1, 0.5f, 2}, {3, 0.5f, 2}, {3, 2.5f, 2}, {1, 2.5f, 2}, leaf);
  test::identify(&scene);
  scene.cameras.push_back(camera_at({2, 1.5f, 0.3f}, {2, 1.5f, 2}, 0.6f));  // sees the back alone
  Drawn level(std::move(scene));
  const Difference d = difference(level.vulkan(Layer::kE), level.cpu(Layer::kE));
  EXPECT_LT(d.p95, 0.002);  // backs differ by 0.4·normal from fronts
}

TEST(Renderer, TexturesWrapAndDecodeAsInTheScene) {
  for (const Wrap wrap : {Wrap::kRepeat, Wrap::kClamp, Wrap::kMirror}) {
    SCOPED_TRACE(static_cast<int>(wrap));
    Scene scene = test::open_plane(6, {});
    Texture gradient;
    gradient.width = 4;
    gradient.height = 2;
    gradient.wrap_s = gradient.wrap_t = wrap;
    for (uint8_t i = 0; i < 8; ++i) {
      gradient.rgba.insert(gradient.rgba.end(),
                           {static_cast<uint8_t>(30 * i + 20), static_cast<uint8_t>(250 - 30 * i), 128, 255});
    }
    scene.textures = {gradient, gradient};
    scene.textures[1].srgb = false;
    scene.materials[0].base_color = {0.9f, 0.8f, 0.7f};
    scene.materials[0].base_color_texture = 0;
    scene.materials[0].emission = {0.5f, 1, 2};
    scene.materials[0].emission_texture = 1;
    scene.materials[0].emission_uv = 1;
    scene.objects[0].uv0 = {{-0.7f, -0.4f}, {1.6f, -0.4f}, {1.6f, 1.3f}, {-0.7f, 1.3f}};
    scene.cameras.push_back(camera_at({0, 5, 0.1f}, {0, 0, 0}, 0.9f));
    Drawn level(std::move(scene));
    for (const Layer layer : {Layer::kAlbedo, Layer::kDirect}) {
      const Difference d = difference(level.vulkan(layer), level.cpu(layer));
      EXPECT_LT(d.median, 0.005);  // samplers have 8 bits of fraction
      EXPECT_LT(d.p95, 0.02);
    }
  }
}

TEST(Renderer, ATextureWithoutCoordinatesIsWhite) {
  Scene scene = test::open_plane(6, {});
  Texture dark;
  dark.width = dark.height = 1;
  dark.rgba = {10, 20, 30, 255};
  scene.textures = {dark};
  scene.materials[0].base_color = {0.5f, 0.25f, 0.75f};
  scene.materials[0].base_color_texture = 0;  // the plane has no TEXCOORD_0
  scene.cameras.push_back(camera_at({0, 2, 0.1f}, {0, 0, 0}, 0.9f));
  Drawn level(std::move(scene));
  const Vec3 middle = level.vulkan(Layer::kAlbedo).rgb(80, 80);
  EXPECT_NEAR(middle.x, 0.5f, 1e-5);
  EXPECT_NEAR(middle.y, 0.25f, 1e-5);
  EXPECT_NEAR(middle.z, 0.75f, 1e-5);
}

TEST(Renderer, SkyIsBehindTheLevel) {
  Scene scene = test::open_plane(1, {0.2f, 0.4f, 0.8f});
  scene.cameras.push_back(camera_at({0, 3, 3}, {0, 0, 0}, 1.2f));
  Drawn level(std::move(scene));
  EXPECT_EQ(level.vulkan(Layer::kFull).rgb(0, 0), (Vec3{0.2f, 0.4f, 0.8f}));
  EXPECT_EQ(level.vulkan(Layer::kDirect).rgb(0, 0), (Vec3{0.2f, 0.4f, 0.8f}));
  EXPECT_EQ(level.vulkan(Layer::kIndirect).rgb(0, 0), (Vec3{}));
  EXPECT_EQ(level.vulkan(Layer::kAlbedo).rgb(0, 0), (Vec3{}));
}

TEST(Renderer, SameInputSameBytesAndAMovedLightAnotherPicture) {
  Drawn level(*builtin_scene("cornell"));
  const Image first = level.vulkan(Layer::kFull);
  const Vec3 start = level.scene().lights[0].position;
  level.scene().lights[0].position = start + Vec3{1, -1, 0.5f};
  const Image moved = level.vulkan(Layer::kFull);
  level.scene().lights[0].position = start;
  const Image again = level.vulkan(Layer::kFull);
  EXPECT_GT(difference(moved, first).mean, 0.05);
  for (size_t c = 0; c < 3; ++c) EXPECT_EQ(first.channels[c].values, again.channels[c].values);
  // The moved light's shadows are right too.
  level.scene().lights[0].position = start + Vec3{1, -1, 0.5f};
  EXPECT_LT(difference(moved, level.cpu(Layer::kFull)).mean, 0.02);
}

TEST(Renderer, FactorsOfMaterialsMayChangeBetweenPictures) {
  Drawn level(*builtin_scene("cornell"));
  const Vec3 before = mean_of(level.vulkan(Layer::kFull));
  for (Material& m : level.scene().materials) m.base_color = m.base_color * Vec3{0, 1, 1};
  const Vec3 after = mean_of(level.vulkan(Layer::kFull));
  EXPECT_EQ(after.x, 0);
  EXPECT_FLOAT_EQ(after.y, before.y);
}

TEST(Renderer, NewLightsNeedANewRenderer) {
  Drawn level(*builtin_scene("cornell"));
  level.scene().lights.emplace_back();
  EXPECT_EQ(level.renderer().update_lights().code(), absl::StatusCode::kFailedPrecondition);
}

TEST(Renderer, TooLargeAPictureIsAnError) {
  Drawn level(*builtin_scene("cornell"));
  Camera wide = level.scene().cameras[0];
  wide.aspect = 1000;
  const auto image = level.renderer().render(wide, {1 << 20, 4, Layer::kFull});
  EXPECT_EQ(image.status().code(), absl::StatusCode::kOutOfRange) << image.status();
}

TEST(Renderer, AnErrorWhileRecordingLeavesItUsable) {
  Drawn level(*builtin_scene("cornell"));
  const auto fails = [](VkCommandBuffer) { return absl::AbortedError("no"); };
  EXPECT_EQ(level.renderer().render(level.scene().cameras[0], {32, 1, Layer::kFull}, fails).status().code(),
            absl::StatusCode::kAborted);
  EXPECT_GT(mean_of(level.vulkan(Layer::kFull)).x, 0);
}

TEST(Renderer, ALevelWithoutLightsOrTrianglesIsDark) {
  Scene scene;
  scene.cameras.push_back(camera_at({0, 0, 0}, {0, 0, -1}, 0.8f));
  auto gpu = Gpu::create(true);
  ASSERT_TRUE(gpu.ok()) << gpu.status();
  auto renderer = Renderer::create(gpu->get(), scene, AtlasLayout{});
  ASSERT_TRUE(renderer.ok()) << renderer.status();
  const auto image = (*renderer)->render(scene.cameras[0], {16, 1, Layer::kFull});
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(mean_of(*image), (Vec3{}));
}

}  // namespace
}  // namespace lightloom::renderer
