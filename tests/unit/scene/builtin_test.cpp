#include "core/scene/builtin.h"

#include <gmock/gmock.h>

#include <map>
#include <set>
#include <tuple>

#include "core/scene/defects.h"
#include "core/scene/shapes.h"
#include "tests/unit/scene/gltf_fixture.h"

namespace lightloom {
namespace {

Scene builtin(const std::string& name) {
  auto scene = builtin_scene(name);
  EXPECT_TRUE(scene.ok()) << scene.status();
  return scene.ok() ? *std::move(scene) : Scene{};
}

/// Six times the volume that an object's triangles enclose.
double volume6(const Object& o) {
  double sum = 0;
  for (const Triangle& t : o.triangles) {
    const Vec3 a = o.positions[t.v[0]], b = o.positions[t.v[1]], c = o.positions[t.v[2]];
    sum += double{a.x} * (double{b.y} * c.z - double{b.z} * c.y) +
           double{a.y} * (double{b.z} * c.x - double{b.x} * c.z) +
           double{a.z} * (double{b.x} * c.y - double{b.y} * c.x);
  }
  return sum;
}

/// Edges that have no partner in the other direction: cracks, T-junctions or flipped faces.
int open_edges(const Object& o) {
  using Point = std::tuple<float, float, float>;
  std::map<std::pair<Point, Point>, int> balance;
  const auto point = [&](uint32_t v) { return Point{o.positions[v].x, o.positions[v].y, o.positions[v].z}; };
  for (const Triangle& t : o.triangles) {
    for (size_t k = 0; k < 3; ++k) {
      const Point a = point(t.v[k]), b = point(t.v[(k + 1) % 3]);
      a < b ? ++balance[{a, b}] : --balance[{b, a}];
    }
  }
  int open = 0;
  for (const auto& [edge, count] : balance) open += count != 0;
  return open;
}

void expect_good_normals(const Object& o) {
  ASSERT_EQ(o.normals.size(), o.positions.size());
  for (const Triangle& t : o.triangles) {
    const Vec3 p = o.positions[t.v[0]];
    const Vec3 n = normalize(cross(o.positions[t.v[1]] - p, o.positions[t.v[2]] - p));
    for (const uint32_t v : t.v) {
      ASSERT_NEAR(length(o.normals[v]), 1, 1e-5f) << o.name;
      ASSERT_GT(dot(n, o.normals[v]), 0.2f) << o.name;
    }
  }
}

TEST(Shapes, BoxIsOutwardAndClosed) {
  Object o;
  add_box(&o, {1, 2, 3}, {2, 4, 6}, 0);
  EXPECT_EQ(o.triangles.size(), 12u);
  EXPECT_EQ(open_edges(o), 0);
  EXPECT_NEAR(volume6(o), 6 * 6, 1e-4);
  expect_good_normals(o);
}

TEST(Shapes, WallWithDoorAndWindow) {
  for (const int thin : {0, 2}) {
    Object o;
    const Vec3 hi = thin == 0 ? Vec3{0.1f, 3, 5} : Vec3{5, 3, 0.1f};
    add_wall(&o, {0, 0, 0}, hi, thin, {{1, 2, 0, 2}, {3, 4, 1, 2}}, 0, 1);
    EXPECT_EQ(open_edges(o), 0);
    EXPECT_NEAR(volume6(o) / 6, (15 - 2 - 1) * 0.1, 1e-5);
    expect_good_normals(o);
  }
}

TEST(Shapes, CurvedSolids) {
  Object sphere, torus;
  add_sphere(&sphere, {1, 2, 3}, 2, 64, 0);
  EXPECT_EQ(open_edges(sphere), 0);
  EXPECT_NEAR(volume6(sphere) / 6, 4.0 / 3 * 3.14159265 * 8, 0.15);
  expect_good_normals(sphere);
  for (const int axis : {0, 1, 2}) {
    Object ring;
    add_torus(&ring, {0, 0, 0}, axis, 1, 0.25f, 64, 0);
    EXPECT_EQ(open_edges(ring), 0);
    EXPECT_NEAR(volume6(ring) / 6, 2 * 3.14159265 * 3.14159265 * 0.0625, 0.02);
    Aabb box;
    for (const Vec3 p : ring.positions) box.extend(p);
    EXPECT_NEAR(box.hi[axis], 0.25f, 1e-6f);
    EXPECT_NEAR(box.hi[(axis + 1) % 3], 1.25f, 1e-6f);
    expect_good_normals(ring);
  }
}

TEST(Shapes, CirclePointsAreEven) {
  const std::vector<Vec2> points = circle(64);
  ASSERT_EQ(points.size(), 64u);
  for (size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR(points[i].x, std::cos(i * 2 * 3.14159265358979 / 64), 1e-6);
    EXPECT_NEAR(points[i].y, std::sin(i * 2 * 3.14159265358979 / 64), 1e-6);
  }
}

class Builtin : public testing::TestWithParam<std::string> {};

TEST_P(Builtin, IsDeterministicAndComplete) {
  const Scene a = builtin(GetParam()), b = builtin(GetParam());
  ASSERT_EQ(a.objects.size(), b.objects.size());
  EXPECT_FALSE(a.lights.empty());
  EXPECT_FALSE(a.cameras.empty());
  std::set<std::string> names;
  std::set<Digest> ids;
  for (size_t i = 0; i < a.objects.size(); ++i) {
    EXPECT_EQ(a.objects[i].id, b.objects[i].id);
    EXPECT_TRUE(names.insert(a.objects[i].name).second) << a.objects[i].name;
    EXPECT_TRUE(ids.insert(a.objects[i].id).second) << a.objects[i].name;
    expect_good_normals(a.objects[i]);
  }
}

TEST_P(Builtin, ObjectsAreClosedSolids) {
  if (GetParam() == "cornell") GTEST_SKIP() << "the Cornell box is made of sheets";
  for (const Object& o : builtin(GetParam()).objects) {
    EXPECT_EQ(open_edges(o), 0) << o.name;
    EXPECT_GT(volume6(o), 0) << o.name;
  }
}

TEST_P(Builtin, SurvivesSavingAndLoading) {
  const Scene scene = builtin(GetParam());
  const auto folder = test_folder();
  ASSERT_TRUE(save_gltf(scene, folder / "a.glb").ok());
  const auto again = load_gltf(folder / "a.glb");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_THAT(again->warnings, testing::IsEmpty());
  ASSERT_EQ(again->objects.size(), scene.objects.size());
  for (size_t i = 0; i < scene.objects.size(); ++i) {
    const Object &a = scene.objects[i], &b = again->objects[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.id, b.id) << a.name;
    EXPECT_EQ(a.positions, b.positions) << a.name;
    EXPECT_EQ(a.normals, b.normals) << a.name;
    ASSERT_EQ(a.triangles.size(), b.triangles.size());
    for (size_t t = 0; t < a.triangles.size(); ++t) {
      ASSERT_EQ(a.triangles[t].v, b.triangles[t].v);
      ASSERT_EQ(a.triangles[t].material, b.triangles[t].material);
    }
  }
  ASSERT_EQ(again->materials.size(), scene.materials.size());
  for (size_t i = 0; i < scene.materials.size(); ++i) {
    EXPECT_EQ(again->materials[i].name, scene.materials[i].name);
    EXPECT_EQ(again->materials[i].base_color, scene.materials[i].base_color);
  }
  ASSERT_EQ(again->lights.size(), scene.lights.size());
  for (size_t i = 0; i < scene.lights.size(); ++i) {
    const Light &a = scene.lights[i], &b = again->lights[i];
    EXPECT_EQ(a.type, b.type);
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.position, b.position);
    if (a.type != LightType::kPoint) {
      EXPECT_EQ(a.direction, b.direction);
    }
    EXPECT_EQ(a.color, b.color);
    EXPECT_EQ(a.intensity, b.intensity);
    if (a.type == LightType::kSpot) {
      EXPECT_EQ(a.outer_cone_angle, b.outer_cone_angle);
    }
  }
  ASSERT_EQ(again->cameras.size(), scene.cameras.size());
  for (size_t i = 0; i < scene.cameras.size(); ++i) {
    const Camera &a = scene.cameras[i], &b = again->cameras[i];
    EXPECT_EQ(a.position, b.position);
    EXPECT_EQ(a.forward, b.forward);
    EXPECT_NEAR(length(a.up - b.up), 0, 1e-6f);
    EXPECT_NEAR(length(a.right - b.right), 0, 1e-6f);
    EXPECT_EQ(a.yfov, b.yfov);
    EXPECT_EQ(a.aspect, b.aspect);
  }
  // The bytes depend on the scene alone.
  ASSERT_TRUE(save_gltf(scene, folder / "b.glb").ok());
  const auto a = read_file(folder / "a.glb"), b = read_file(folder / "b.glb");
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_TRUE(*a == *b);
}

INSTANTIATE_TEST_SUITE_P(All, Builtin, testing::ValuesIn(builtin_scene_names()),
                         [](const auto& info) { return info.param; });

TEST(BuiltinScenes, Sizes) {
  EXPECT_EQ(builtin("cornell").triangle_count(), 30u);
  const Scene gallery = builtin("gallery");
  EXPECT_GE(gallery.triangle_count(), 200000u);
  EXPECT_LE(gallery.triangle_count(), 400000u);
  const Vec3 town = builtin("town").bounds().size(), flat = builtin("flat").bounds().size();
  EXPECT_NEAR(town.x, 104, 1);
  EXPECT_NEAR(town.z, 104, 1);
  EXPECT_NEAR(flat.x, 9.3f, 0.1f);
  EXPECT_NEAR(flat.z, 7.3f, 0.1f);
  EXPECT_EQ(builtin_scene("castle").status().code(), absl::StatusCode::kNotFound);
}

TEST(SaveGltf, TransformsExtrasAndMaterialsSurvive) {
  Scene scene = builtin("cornell");
  Object& box = scene.objects[5];
  // Turned, scaled, mirrored and moved: the geometry is already in the world.
  box.transform = {0, 2, 0, 0, -3, 0, 0, 0, 0, 0, -1, 0, 5, 6, 7, 1};
  box.is_static = false;
  box.texel_scale = 0.5f;
  box.receive = Receive::kNone;
  box.triangles[3].material = 1;  // runs of materials within an object
  scene.materials[1].emission = {30, 7, 0.5f};
  scene.materials[2].alpha_mode = AlphaMode::kMask;
  scene.materials[2].alpha_cutoff = 0.25f;
  scene.materials[2].double_sided = true;
  const auto path = test_folder() / "level.glb";
  ASSERT_TRUE(save_gltf(scene, path).ok());
  const auto again = load_gltf(path);
  ASSERT_TRUE(again.ok()) << again.status();
  const Object& b = again->objects[5];
  EXPECT_EQ(b.transform, box.transform);
  EXPECT_FALSE(b.is_static);
  EXPECT_EQ(b.texel_scale, 0.5f);
  EXPECT_EQ(b.receive, Receive::kNone);
  ASSERT_EQ(b.triangles.size(), box.triangles.size());
  for (size_t t = 0; t < b.triangles.size(); ++t) {
    EXPECT_EQ(b.triangles[t].material, box.triangles[t].material);
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(length(b.positions[b.triangles[t].v[k]] - box.positions[box.triangles[t].v[k]]), 0, 1e-5f);
      EXPECT_NEAR(length(b.normals[b.triangles[t].v[k]] - box.normals[box.triangles[t].v[k]]), 0, 1e-5f);
    }
  }
  EXPECT_EQ(again->materials[1].emission, (Vec3{30, 7, 0.5f}));
  EXPECT_EQ(again->materials[2].alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(again->materials[2].alpha_cutoff, 0.25f);
  EXPECT_TRUE(again->materials[2].double_sided);
}

TEST(Shapes, SubdividingKeepsTheSurface) {
  Object object;
  add_sphere(&object, {1, 2, 3}, 2, 8, 0);
  add_box(&object, {5, 0, 0}, {7, 1, 1}, 1);
  const auto area = [&] {
    double sum = 0;
    for (const Triangle& t : object.triangles) {
      const Vec3 p = object.positions[t.v[0]];
      sum += static_cast<double>(length(cross(object.positions[t.v[1]] - p, object.positions[t.v[2]] - p)));
    }
    return sum;
  };
  const double before = area();
  const size_t triangles = object.triangles.size();
  subdivide(&object);
  EXPECT_EQ(object.triangles.size(), 4 * triangles);
  EXPECT_NEAR(area(), before, 1e-5 * before);
  EXPECT_EQ(object.normals.size(), object.positions.size());
  // Every edge still has its neighbour.
  Scene scene;
  scene.objects.push_back(object);
  EXPECT_EQ(find_defects(scene), Defects{});
}

}  // namespace
}  // namespace lightloom
