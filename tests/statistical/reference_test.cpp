// The path tracer against what is known in closed form.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "core/reference/path_tracer.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

struct Traced {
  AtlasLayout layout;
  ReferenceResult result;
};

Traced trace(const Scene& scene, float texels_per_metre, int bounces, int samples, int threads = 0, uint64_t seed = 1) {
  LayoutOptions layout_options;
  layout_options.texels_per_metre = texels_per_metre;
  absl::StatusOr<AtlasLayout> layout = make_layout(scene, layout_options);
  const absl::StatusOr<std::unique_ptr<RayTracer>> tracer = RayTracer::create(scene);
  EXPECT_TRUE(layout.ok()) << layout.status();
  EXPECT_TRUE(tracer.ok()) << tracer.status();
  if (!layout.ok() || !tracer.ok()) return {};
  ReferenceOptions options;
  options.bounces = bounces;
  options.samples = samples;
  options.seed = seed;
  options.parallel.threads = threads;
  absl::StatusOr<ReferenceResult> result = reference_lightmap(**tracer, *layout, options);
  EXPECT_TRUE(result.ok()) << result.status();
  if (!result.ok()) return {};
  return {*std::move(layout), *std::move(result)};
}

/// E of one object's texels, W/m².
struct Irradiance {
  double mean = 0, lowest = INFINITY, highest = 0;
  double area = 0;  // m²
};

Irradiance irradiance(const Traced& traced, uint32_t object) {
  Irradiance out;
  const Image& image = traced.result.image;
  const Placement at = traced.layout.placements[object];
  for (int y = at.y; y < at.y + traced.layout.uv[object].height; ++y) {
    for (int x = at.x; x < at.x + traced.layout.uv[object].width; ++x) {
      if ((*image.channel("A"))[image.index(x, y)] < 0.5f) continue;
      const double area = static_cast<double>((*image.channel("area"))[image.index(x, y)]);
      for (int c = 0; c < 3; ++c) {
        const double e = static_cast<double>(image.rgb(x, y)[c]);
        out.mean += e * area / 3;
        out.lowest = std::min(out.lowest, e);
        out.highest = std::max(out.highest, e);
      }
      out.area += area;
    }
  }
  out.mean /= out.area;
  return out;
}

constexpr double kPiExact = 3.14159265358979323846;

// Every wall emits L and reflects a: the radiance inside is L(1 + a + a² + …), whatever the shape.
void check_furnace(float albedo, int bounces, int samples) {
  const Scene scene = test::furnace(albedo, 2);
  const Traced traced = trace(scene, 4, bounces, samples);
  const double expected = kPiExact * 2 / (1 - static_cast<double>(albedo));
  double mean = 0;
  for (uint32_t wall = 0; wall < 6; ++wall) {
    const Irradiance e = irradiance(traced, wall);
    EXPECT_NEAR(e.area, 4, 1e-3);
    EXPECT_NEAR(e.mean, expected, 0.01 * expected) << scene.objects[wall].name;
    EXPECT_NEAR(e.lowest, expected, 0.1 * expected) << scene.objects[wall].name;
    EXPECT_NEAR(e.highest, expected, 0.1 * expected) << scene.objects[wall].name;
    mean += e.mean / 6;
  }
  std::printf("furnace, albedo %.1f: E / expected = %.5f\n", static_cast<double>(albedo), mean / expected);
  EXPECT_NEAR(mean, expected, 0.003 * expected);
}

TEST(Furnace, HalfReflected) { check_furnace(0.5f, 32, 1024); }
TEST(Furnace, MostlyReflected) { check_furnace(0.8f, 96, 2048); }

TEST(Furnace, EachBounceAddsItsTerm) {
  const Scene scene = test::furnace(0.5f, 1);
  // Paths this short know no roulette: nothing is random but rounding.
  for (int bounces = 0; bounces < 3; ++bounces) {
    const double expected = kPiExact * (2 - std::pow(0.5, bounces));
    const Irradiance e = irradiance(trace(scene, 2, bounces, 32), 0);
    EXPECT_NEAR(e.lowest, expected, 1e-4 * expected) << bounces;
    EXPECT_NEAR(e.highest, expected, 1e-4 * expected) << bounces;
  }
}

// A furnace with a solid block in it, whose edges cut texels of the floor: only what lies in the open counts.
TEST(Furnace, TexelsReachIntoASolid) {
  Scene scene = test::furnace(0.5f, 1);
  const uint32_t material = scene.objects[0].triangles[0].material;
  test::add_solid_box(&scene, "block", {0.6f, 0, 0.7f}, {1.3f, 0.8f, 1.2f}, material);
  for (Material& m : scene.materials) m.double_sided = true;  // dimmer inside the block, not absent
  test::identify(&scene);
  const uint32_t floor = test::object_named(scene, "floor");
  const Traced traced = trace(scene, 4, 1, 64);
  const double expected = kPiExact * 1.5;
  int open = 0;
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      const double e = static_cast<double>(
          traced.result.image.rgb(traced.layout.placements[floor].x + x, traced.layout.placements[floor].y + y).x);
      open += std::abs(e - expected) < 1e-3 * expected;
    }
  }
  // Of 8 × 8 texels of 0.25 m, [3, 5) × [3, 4) lie wholly under the block.
  EXPECT_EQ(open, 62);
}

TEST(OpenPlane, SeesTheWholeSky) {
  const Scene scene = test::open_plane(4, {1, 1, 1});
  const Irradiance e = irradiance(trace(scene, 2, 4, 64), 0);
  EXPECT_NEAR(e.lowest, kPiExact, 1e-4);
  EXPECT_NEAR(e.highest, kPiExact, 1e-4);
}

TEST(OpenPlane, KeepsTheColourOfTheSky) {
  const Scene scene = test::open_plane(1, {0.25f, 1, 3});
  const Traced traced = trace(scene, 4, 1, 32);
  const Vec3 e = traced.result.image.rgb(traced.layout.placements[0].x, traced.layout.placements[0].y);
  EXPECT_NEAR(e.x, 0.25 * kPiExact, 1e-4);
  EXPECT_NEAR(e.y, kPiExact, 1e-4);
  EXPECT_NEAR(e.z, 3 * kPiExact, 1e-3);
}

// View factor between identical, parallel, directly opposed squares of side a at distance c, with X = a/c
// (Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", C-11, for equal sides):
//   F = 2/(πX²) · [ ½ ln((1+X²)² / (1+2X²)) + 2X √(1+X²) atan(X/√(1+X²)) − 2X atan X ]
// The source sends πL·a² and a share F arrives on the target of the same area: mean E = πL·F.
double view_factor(double x) {
  const double s = std::sqrt(1 + x * x);
  return 2 / (kPiExact * x * x) *
         (0.5 * std::log(s * s * s * s / (1 + 2 * x * x)) + 2 * x * s * std::atan(x / s) - 2 * x * std::atan(x));
}

TEST(FacingPlates, ExchangeTheViewFactor) {
  EXPECT_NEAR(view_factor(1), 0.1998, 5e-5);  // the textbook's cube
  for (const float gap : {0.5f, 1.0f, 2.0f}) {
    const Scene scene = test::facing_plates(gap, 3);
    const Irradiance e = irradiance(trace(scene, 8, 4, 4096), test::object_named(scene, "target"));
    const double expected = kPiExact * 3 * view_factor(1 / static_cast<double>(gap));
    std::printf("plates %.1f m apart: E / expected = %.5f\n", static_cast<double>(gap), e.mean / expected);
    EXPECT_NEAR(e.mean, expected, 0.01 * expected) << gap;
  }
}

TEST(FacingPlates, OnlyTheFrontEmits) {
  Scene scene = test::facing_plates(1, 3);
  for (Triangle& t : scene.objects[test::object_named(scene, "source")].triangles) std::swap(t.v[1], t.v[2]);
  test::identify(&scene);
  const Irradiance e = irradiance(trace(scene, 4, 1, 64), test::object_named(scene, "target"));
  EXPECT_EQ(e.highest, 0);
}

TEST(Bounces, NoneCountsEmissionAndSkyOnly) {
  Scene scene = test::closed_box({3, 3, 3});
  test::add_point_light(&scene, {1.5f, 2, 1.5f}, 10);
  EXPECT_EQ(irradiance(trace(scene, 2, 0, 64), 0).highest, 0) << "nothing but the lamp";
  EXPECT_GT(irradiance(trace(scene, 2, 1, 64), 0).lowest, 0);

  scene.materials[1].emission = {1, 1, 1};  // the ceiling
  const Traced emission = trace(scene, 2, 0, 256);
  EXPECT_NEAR(irradiance(emission, 0).mean, kPiExact * view_factor(1), 0.03 * kPiExact * view_factor(1));
  EXPECT_EQ(irradiance(emission, 1).highest, 0) << "the ceiling does not see itself";
}

// A small lamp's light is reflected once: floor and walls together receive what they reflect, less nothing.
TEST(Bounces, OneBounceKeepsTheEnergy) {
  Scene scene = test::closed_box({3, 3, 3});
  test::add_point_light(&scene, {1.5f, 1.5f, 1.5f}, 10);
  const Traced traced = trace(scene, 4, 1, 1024);
  double power = 0;
  for (uint32_t wall = 0; wall < 6; ++wall) {
    const Irradiance e = irradiance(traced, wall);
    power += e.mean * e.area;
  }
  const double expected = 0.5 * 4 * kPiExact * 10;
  std::printf("one bounce in a closed room: power / expected = %.5f\n", power / expected);
  EXPECT_NEAR(power, expected, 0.005 * expected);
}

TEST(SealedDoubleRoom, NoLightLeaks) {
  for (const float thickness : {0.1f, 0.002f}) {
    const Scene scene = test::sealed_double_room(thickness);
    const Traced traced = trace(scene, 4, 8, 64);
    EXPECT_EQ(irradiance(traced, test::object_named(scene, "east")).highest, 0) << thickness;
    EXPECT_GT(irradiance(traced, test::object_named(scene, "west")).lowest, 0) << thickness;
  }
}

TEST(Noise, TellsTheTrueError) {
  Scene scene = test::closed_box({3, 3, 3});
  test::add_point_light(&scene, {1.5f, 1.5f, 1.5f}, 10);
  const Traced coarse = trace(scene, 3, 2, 128), finer = trace(scene, 3, 2, 2048, 0, 2),
               truth = trace(scene, 3, 2, 8192, 0, 3);
  const auto error = [&](const Traced& t) {
    double difference = 0, total = 0;
    for (int y = 0; y < truth.result.image.height; ++y) {
      for (int x = 0; x < truth.result.image.width; ++x) {
        const Vec3 b = truth.result.image.rgb(x, y), d = t.result.image.rgb(x, y) - b;
        difference += static_cast<double>(dot(d, d));
        total += static_cast<double>(dot(b, b));
      }
    }
    return std::sqrt(difference / total);
  };
  std::printf("noise %.5f (true %.5f), with 16 times the samples %.5f (%.5f)\n", coarse.result.noise, error(coarse),
              finer.result.noise, error(finer));
  EXPECT_NEAR(coarse.result.noise, error(coarse), 0.1 * error(coarse));
  EXPECT_NEAR(finer.result.noise, error(finer), 0.1 * error(finer));
  // Independent samples would give 4; stratification more.
  EXPECT_GT(coarse.result.noise / finer.result.noise, 3.8);
  EXPECT_LT(coarse.result.noise / finer.result.noise, 8);
}

TEST(Determinism, ThreadsDoNotMatter) {
  Scene scene = test::closed_box({3, 3, 3});
  test::add_point_light(&scene, {0.5f, 2.5f, 0.5f}, 10);
  const Traced one = trace(scene, 4, 6, 64, 1), two = trace(scene, 4, 6, 64, 2), other = trace(scene, 4, 6, 64, 1, 2);
  EXPECT_EQ(one.result.noise, two.result.noise);
  for (const char* channel : {"R", "G", "B", "A", "area"}) {
    EXPECT_EQ(*one.result.image.channel(channel), *two.result.image.channel(channel)) << channel;
  }
  EXPECT_NE(*one.result.image.channel("R"), *other.result.image.channel("R")) << "the seed matters";
}

}  // namespace
}  // namespace lightloom
