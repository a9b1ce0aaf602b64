#include "core/scene/ray_tracer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/rng.h"
#include "core/base/sampling.h"
#include "core/scene/gltf.h"
#include "core/scene/shapes.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

std::unique_ptr<RayTracer> trace(const Scene& scene) {
  absl::StatusOr<std::unique_ptr<RayTracer>> tracer = RayTracer::create(scene);
  EXPECT_TRUE(tracer.ok()) << tracer.status();
  return tracer.ok() ? *std::move(tracer) : nullptr;
}

/// A right triangle with legs of 4 m in the plane z = `z`, its front towards +z.
Object& add_flat_triangle(Scene* scene, float z, uint32_t material) {
  Object& object = scene->objects.emplace_back();
  add_triangle(&object, {0, 0, z}, {4, 0, z}, {0, 4, z}, material);
  return object;
}

Scene single_triangle() {
  Scene scene;
  add_flat_triangle(&scene, 0, test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f}));
  test::identify(&scene);
  return scene;
}

TEST(RayTracer, HitsTheFront) {
  const Scene scene = single_triangle();
  const auto tracer = trace(scene);
  const Hit hit = tracer->closest({1, 2, 5}, {0, 0, -2});
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit.object, 0u);
  EXPECT_EQ(hit.triangle, 0u);
  EXPECT_FLOAT_EQ(hit.t, 2.5f);  // in units of the direction
  EXPECT_FLOAT_EQ(hit.b1, 0.25f);
  EXPECT_FLOAT_EQ(hit.b2, 0.5f);
  EXPECT_FALSE(hit.back);
  EXPECT_NEAR(length(tracer->position(hit) - Vec3{1, 2, 0}), 0, 1e-6f);
  EXPECT_EQ(tracer->geometric_normal(hit), (Vec3{0, 0, 1}));
}

TEST(RayTracer, HitsTheBack) {
  const Scene scene = single_triangle();
  const Hit hit = trace(scene)->closest({1, 2, -3}, {0, 0, 1});
  ASSERT_TRUE(hit);
  EXPECT_FLOAT_EQ(hit.t, 3);
  EXPECT_FLOAT_EQ(hit.b1, 0.25f);
  EXPECT_FLOAT_EQ(hit.b2, 0.5f);
  EXPECT_TRUE(hit.back);
}

TEST(RayTracer, Misses) {
  const Scene scene = single_triangle();
  const auto tracer = trace(scene);
  EXPECT_FALSE(tracer->closest({3, 3, 5}, {0, 0, -1})) << "beside the hypotenuse";
  EXPECT_FALSE(tracer->closest({1, 1, 5}, {0, 0, 1})) << "away from it";
  EXPECT_FALSE(tracer->closest({1, 1, 5}, {1, 0, 0})) << "parallel to it";
  EXPECT_FALSE(tracer->occluded({3, 3, 5}, {0, 0, -1}, 100));

  const Scene nothing;
  EXPECT_FALSE(trace(nothing)->closest({0, 0, 0}, {0, 1, 0}));
}

TEST(RayTracer, LimitsTheDistance) {
  const Scene scene = single_triangle();
  const auto tracer = trace(scene);
  EXPECT_TRUE(tracer->closest({1, 1, 5}, {0, 0, -1}, 5)) << "the end counts";
  EXPECT_TRUE(tracer->occluded({1, 1, 5}, {0, 0, -1}, 5));
  EXPECT_FALSE(tracer->closest({1, 1, 5}, {0, 0, -1}, 4.999f));
  EXPECT_TRUE(tracer->closest({1, 1, 5}, {0, 0, -1}, 5.001f));
  EXPECT_FALSE(tracer->occluded({1, 1, 5}, {0, 0, -1}, 4.999f));
  EXPECT_TRUE(tracer->occluded({1, 1, 5}, {0, 0, -1}, 5.001f));
  EXPECT_TRUE(tracer->occluded({1, 1, 5}, {0, 0, -2}, 2.501f)) << "t is in units of the direction";
  EXPECT_FALSE(tracer->occluded({1, 1, 5}, {0, 0, -2}, 2.499f));
}

TEST(RayTracer, NearestOfSeveral) {
  Scene scene;
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  for (const float z : {-2.0f, 1.0f, 0.0f, -1.0f}) add_flat_triangle(&scene, z, grey);
  test::identify(&scene);
  const auto tracer = trace(scene);
  EXPECT_EQ(tracer->closest({1, 1, 5}, {0, 0, -1}).object, 1u);
  EXPECT_EQ(tracer->closest({1, 1, 0.5f}, {0, 0, -1}).object, 2u);
  EXPECT_EQ(tracer->closest({1, 1, -5}, {0, 0, 1}).object, 0u);
}

TEST(RayTracer, VisibleBetweenPoints) {
  const Scene scene = single_triangle();
  const auto tracer = trace(scene);
  EXPECT_FALSE(tracer->visible({1, 1, 5}, {1, 1, -5}));
  EXPECT_FALSE(tracer->visible({1, 1, -5}, {1, 1, 5}));
  EXPECT_TRUE(tracer->visible({1, 1, 5}, {1, 1, 0.001f})) << "what lies behind the end does not matter";
  EXPECT_TRUE(tracer->visible({1, 1, 0.001f}, {1, 1, 5})) << "nor what lies behind the start";
  EXPECT_TRUE(tracer->visible({3, 3, 5}, {3, 3, -5}));
}

TEST(RayTracer, MaskedHolesLetThrough) {
  Scene scene;
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  const uint32_t masked = test::add_material(&scene, "leaf", {1, 1, 1});
  Texture& texture = scene.textures.emplace_back();
  texture.width = 2;
  texture.height = 1;
  texture.wrap_s = texture.wrap_t = Wrap::kClamp;
  texture.rgba = {255, 255, 255, 0, 255, 255, 255, 255};  // a hole for u < 1/2
  scene.materials[masked].base_color_texture = 0;
  scene.materials[masked].alpha_mode = AlphaMode::kMask;
  test::add_wall_object(&scene, "leaf", {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}, masked).uv0 = {
      {0, 0}, {1, 0}, {1, 1}, {0, 1}};
  test::add_wall_object(&scene, "wall", {0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, grey);
  test::identify(&scene);
  const auto tracer = trace(scene);

  EXPECT_EQ(tracer->closest({0.8f, 0.5f, 2}, {0, 0, -1}).object, 0u);
  const Hit through = tracer->closest({0.2f, 0.5f, 2}, {0, 0, -1});
  EXPECT_EQ(through.object, 1u);
  EXPECT_FLOAT_EQ(through.t, 2);
  EXPECT_TRUE(tracer->occluded({0.8f, 0.5f, 2}, {0, 0, -1}, 1.5f));
  EXPECT_FALSE(tracer->occluded({0.2f, 0.5f, 2}, {0, 0, -1}, 1.5f));
  EXPECT_TRUE(tracer->occluded({0.2f, 0.5f, 2}, {0, 0, -1}, 2.5f));
  EXPECT_TRUE(tracer->visible({0.2f, 0.5f, 2}, {0.2f, 0.5f, 0.5f}));

  // Not a mask: alpha has no say.
  Scene opaque = scene;
  opaque.materials[masked].alpha_mode = AlphaMode::kOpaque;
  EXPECT_EQ(trace(opaque)->closest({0.2f, 0.5f, 2}, {0, 0, -1}).object, 0u);
}

TEST(RayTracer, DynamicObjectsAreNotThere) {
  Scene scene;
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  add_flat_triangle(&scene, 1, grey).is_static = false;
  add_flat_triangle(&scene, 0, grey);
  test::identify(&scene);
  const auto tracer = trace(scene);
  EXPECT_EQ(tracer->closest({1, 1, 5}, {0, 0, -1}).object, 1u);
  EXPECT_FALSE(tracer->occluded({1, 1, 5}, {0, 0, -1}, 4.5f));
}

TEST(RayTracer, MirroredObjectsKeepTheirFront) {
  Scene scene;
  test::add_solid_box(&scene, "box", {-3, 0, 0}, {-1, 1, 1}, test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f}));
  scene.objects[0].transform[0] = -1;  // its mesh lies at x in [1, 3] and is turned over
  test::identify(&scene);
  const auto file = std::filesystem::path(testing::TempDir()) / "ray_tracer_test_mirrored.glb";
  ASSERT_TRUE(save_gltf(scene, file).ok());
  const absl::StatusOr<Scene> loaded = load_gltf(file);
  std::filesystem::remove(file);
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  ASSERT_EQ(loaded->objects[0].transform[0], -1);
  const auto tracer = trace(*loaded);
  const Hit outside = tracer->closest({-5, 0.4f, 0.7f}, {1, 0, 0});
  ASSERT_TRUE(outside);
  EXPECT_FLOAT_EQ(outside.t, 2);
  EXPECT_FALSE(outside.back);
  EXPECT_NEAR(length(tracer->geometric_normal(outside) - Vec3{-1, 0, 0}), 0, 1e-6f);
  EXPECT_TRUE(tracer->closest({-2, 0.4f, 0.7f}, {1, 0, 0}).back) << "from inside";
}

/// `scene` with its objects in a random order.
Scene shuffled(const Scene& scene, Rng* rng) {
  Scene out = scene;
  for (size_t i = out.objects.size(); i > 1; --i) {
    std::swap(out.objects[i - 1], out.objects[rng->next_below(static_cast<uint32_t>(i))]);
  }
  return out;
}

TEST(RayTracer, ContentSettlesTies) {
  // More coincident triangles than a BVH leaf holds, two in each object.
  Scene scene;
  for (uint32_t i = 0; i < 11; ++i) {
    Object& object = add_flat_triangle(&scene, 0, test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f}));
    add_triangle(&object, {0, 0, 0}, {4, 0, 0}, {0, 4, 0}, i);
    // Away from the rays, so that meshes differ.
    add_triangle(&object, {10, 0, static_cast<float>(i)}, {11, 0, 0}, {10, 1, 0}, i);
  }
  test::identify(&scene);
  const Digest first =
      std::min_element(scene.objects.begin(), scene.objects.end(), [](const Object& a, const Object& b) {
        return a.id < b.id;
      })->id;
  Rng rng(1);
  for (int i = 0; i < 20; ++i) {
    const Scene other = shuffled(scene, &rng);
    const auto tracer = trace(other);
    for (const float z : {5.0f, -5.0f}) {
      const Hit hit = tracer->closest({1, 1, z}, {0.01f, 0.02f, -z});
      ASSERT_TRUE(hit);
      EXPECT_EQ(other.objects[hit.object].id, first);
      EXPECT_EQ(hit.triangle, 0u);
    }
  }
}

/// Distance of a triangle's plane along a ray, rounded once.
float distance(Vec3 o, Vec3 d, const std::array<Vec3, 3>& p) {
  using V = std::array<double, 3>;
  const auto minus = [](Vec3 a, Vec3 b) {
    return V{static_cast<double>(a.x) - static_cast<double>(b.x), static_cast<double>(a.y) - static_cast<double>(b.y),
             static_cast<double>(a.z) - static_cast<double>(b.z)};
  };
  const auto cross = [](V a, V b) {
    return V{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  const auto dot = [](V a, V b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
  const V e1 = minus(p[1], p[0]), e2 = minus(p[2], p[0]), direction = minus(d, {});
  return static_cast<float>(dot(e2, cross(minus(o, p[0]), e1)) / dot(e1, cross(direction, e2)));
}

TEST(RayTracer, NoEstimateSettlesTies) {
  // The same triangle by each of its corners first, from either side: to the last bit Embree's distances differ, and how
  // depends on the maker of the CPU.
  Rng rng(11);
  const auto random = [&](float scale) {
    return Vec3{rng.next_float() - 0.5f, rng.next_float() - 0.5f, rng.next_float() - 0.5f} * scale;
  };
  for (int i = 0; i < 200; ++i) {
    const Vec3 place = random(40);
    const std::array<Vec3, 3> corners{place + random(3), place + random(3), place + random(3)};
    std::vector<std::array<Vec3, 3>> turns;
    Scene scene;
    const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
    for (size_t first = 0; first < 3; ++first) {
      for (const size_t step : {1u, 2u}) {
        const std::array<Vec3, 3> p{corners[first], corners[(first + step) % 3], corners[(first + 2 * step) % 3]};
        add_triangle(&scene.objects.emplace_back(), p[0], p[1], p[2], grey);
        turns.push_back(p);
      }
    }
    test::identify(&scene);
    const auto tracer = trace(scene);
    for (int j = 0; j < 50; ++j) {
      const float u = 0.1f + 0.4f * rng.next_float(), v = 0.1f + 0.4f * rng.next_float();
      const Vec3 target = corners[0] * (1 - u - v) + corners[1] * u + corners[2] * v;
      const Vec3 from = place + random(30), direction = (target - from) * 0.7f;
      const Vec3 normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
      if (std::abs(dot(normal, direction)) < 0.01f * length(direction)) continue;  // Embree may miss some of them
      std::vector<std::pair<float, Digest>> order;
      for (size_t o = 0; o < turns.size(); ++o) {
        order.emplace_back(distance(from, direction, turns[o]), scene.objects[o].id);
      }
      const auto nearest = *std::min_element(order.begin(), order.end());
      const Hit hit = tracer->closest(from, direction);
      ASSERT_TRUE(hit);
      EXPECT_EQ(scene.objects[hit.object].id, nearest.second);
      EXPECT_EQ(hit.t, nearest.first);
    }
  }
}

/// Objects of random triangles within 10 m.
Scene soup() {
  Scene scene;
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  Rng rng(7);
  const auto random = [&](float scale) {
    return Vec3{rng.next_float() - 0.5f, rng.next_float() - 0.5f, rng.next_float() - 0.5f} * scale;
  };
  for (int o = 0; o < 40; ++o) {
    Object& object = scene.objects.emplace_back();
    for (int t = 0; t < 25; ++t) {
      const Vec3 p = random(20);
      add_triangle(&object, p, p + random(4), p + random(4), grey);
    }
  }
  test::identify(&scene);
  return scene;
}

struct Answer {
  Digest id;
  uint32_t triangle, t, b1, b2;
  bool hit, back, occluded;
  bool operator==(const Answer&) const = default;
};

std::vector<Answer> answers(const Scene& scene) {
  const auto tracer = trace(scene);
  Rng rng(11);
  std::vector<Answer> out;
  for (int i = 0; i < 4000; ++i) {
    const Vec3 origin = Vec3{rng.next_float() - 0.5f, rng.next_float() - 0.5f, rng.next_float() - 0.5f} * 20;
    const Vec3 direction = square_to_sphere(rng.next_float(), rng.next_float());
    const Hit hit = tracer->closest(origin, direction, 50);
    out.push_back({hit ? scene.objects[hit.object].id : Digest{}, hit.triangle, std::bit_cast<uint32_t>(hit.t),
                   std::bit_cast<uint32_t>(hit.b1), std::bit_cast<uint32_t>(hit.b2), static_cast<bool>(hit), hit.back,
                   tracer->occluded(origin, direction, 5)});
  }
  return out;
}

TEST(RayTracer, HitsDoNotDependOnObjectOrder) {
  const Scene scene = soup();
  const std::vector<Answer> expected = answers(scene);
  EXPECT_GT(std::count_if(expected.begin(), expected.end(), [](const Answer& a) { return a.hit; }), 1000);
  Rng rng(3);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(answers(shuffled(scene, &rng)), expected);
}

TEST(RayTracer, HitsDoNotDependOnWhatLiesFarAway) {
  const Scene scene = soup();
  Scene larger = scene;
  Rng rng(5);
  for (int o = 0; o < 30; ++o) {
    Object object;
    for (int t = 0; t < 200; ++t) {
      const Vec3 p{500 + 900 * rng.next_float(), 900 * rng.next_float(), -300 * rng.next_float()};
      add_triangle(&object, p, p + Vec3{3, 0, rng.next_float()}, p + Vec3{0, 3, 0}, 0);
    }
    larger.objects.insert(larger.objects.begin() + o, std::move(object));
  }
  test::identify(&larger);
  EXPECT_EQ(answers(larger), answers(scene));
}

// Points anywhere on triangles, pushed off: rays out of the surface leave it, rays into it meet it at once.
TEST(RayTracer, OffsetClearsRounding) {
  Rng rng(13);
  for (const float scale : {0.0f, 1.0f, 30.0f, 1000.0f, 30000.0f}) {
    Scene scene;
    const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
    Object& object = scene.objects.emplace_back();
    const auto random = [&](float s) {
      return Vec3{rng.next_float() - 0.5f, rng.next_float() - 0.5f, rng.next_float() - 0.5f} * s;
    };
    const Vec3 place{scale, -0.3f * scale, 0.7f * scale};
    add_triangle(&object, place + random(8), place + random(8), place + random(8), grey);
    test::identify(&scene);
    const auto tracer = trace(scene);
    const Vec3 n = tracer->geometric_normal({0, 0, 0, 0.3f, 0.3f, false});
    for (int i = 0; i < 500; ++i) {
      float b1 = rng.next_float(), b2 = rng.next_float();
      if (b1 + b2 > 1) b1 = 1 - b1, b2 = 1 - b2;
      const Vec3 p = interpolate(object.positions, object.triangles[0], b1, b2);
      const float offset = RayTracer::offset(p);
      EXPECT_LT(offset, 1e-4f * (1 + scale));
      const float largest = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
      EXPECT_GT(offset, 100 * (std::nextafter(largest, INFINITY) - largest));
      for (const float side : {1.0f, -1.0f}) {
        const Vec3 q = p + n * (side * offset);
        const Vec3 d = to_world(square_to_cosine_hemisphere(rng.next_float(), rng.next_float()), n * side);
        EXPECT_FALSE(tracer->closest(q, d)) << scale;
        if (std::min({b1, b2, 1 - b1 - b2}) > 0.05f) {
          const Hit back = tracer->closest(q, n * -side);
          ASSERT_TRUE(back) << scale;
          EXPECT_LT(back.t, 2 * offset);
        }
      }
    }
  }
}

}  // namespace
}  // namespace lightloom
