#include "core/receivers/receivers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "core/receivers/receiver_search.h"
#include "core/receivers/texel_opening.h"
#include "core/scene/shapes.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

/// A scene with all that find_receivers() needs; not to be moved.
struct World {
  Scene scene;
  std::unique_ptr<RayTracer> tracer;
  AtlasLayout layout;
  Receivers receivers;

  explicit World(Scene s, float texels_per_metre = 4, int threads = 0) : scene(std::move(s)) {
    auto made = RayTracer::create(scene);
    EXPECT_TRUE(made.ok()) << made.status();
    if (!made.ok()) return;
    tracer = *std::move(made);
    LayoutOptions options;
    options.texels_per_metre = texels_per_metre;
    auto laid = make_layout(scene, options);
    EXPECT_TRUE(laid.ok()) << laid.status();
    if (!laid.ok()) return;
    layout = *std::move(laid);
    Parallel parallel;
    parallel.threads = threads;
    auto found = find_receivers(*tracer, layout, parallel);
    EXPECT_TRUE(found.ok()) << found.status();
    if (found.ok()) receivers = *std::move(found);
  }
  World(const World&) = delete;

  uint32_t locate(const Hit& hit) const { return ReceiverSearch(*tracer, layout, receivers).locate(hit); }
  uint32_t object(const std::string& name) const { return test::object_named(scene, name); }
  int count(const std::string& name, bool back) const {
    const uint32_t o = object(name);
    int n = 0;
    for (uint32_t i = receivers.ranges[o].begin; i < receivers.ranges[o].end; ++i) n += receivers.all[i].back == back;
    return n;
  }
  size_t texels(const std::string& name) const { return receivers.grids[object(name)].texels.size(); }
};

TEST(FindReceivers, ClosedBoxIsOpenInside) {
  const World w(test::closed_box({3, 2, 4}));
  EXPECT_EQ(w.receivers.solid_texels, 0u);
  size_t texels = 0;
  for (uint32_t o = 0; o < w.scene.objects.size(); ++o) {
    texels += w.receivers.grids[o].texels.size();
    EXPECT_EQ(w.receivers.ranges[o].end - w.receivers.ranges[o].begin, w.receivers.grids[o].texels.size());
  }
  EXPECT_EQ(w.receivers.all.size(), texels);
  EXPECT_EQ(texels, 16u * 2 * (3 * 2 + 3 * 4 + 2 * 4));
}

TEST(FindReceivers, AreOrderedAndKeyed) {
  const World w(test::room_with_crate());
  for (size_t i = 0; i < w.receivers.all.size(); ++i) {
    const Receiver& r = w.receivers.all[i];
    const LightmapUv& uv = w.layout.uv[r.object];
    const Texel& texel = w.receivers.grids[r.object].texels[r.texel];
    const auto width = static_cast<uint32_t>(uv.width), height = static_cast<uint32_t>(uv.height);
    EXPECT_EQ(r.key, (r.back ? width * height : 0) + texel.y * width + texel.x);
    EXPECT_EQ(w.receivers.find(r.object, r.key), i);
    EXPECT_NEAR(length(r.point.normal), 1, 1e-5f);
    EXPECT_GT(dot(r.point.normal, r.point.geometric), 0);
    if (i == 0) continue;
    const Receiver& before = w.receivers.all[i - 1];
    EXPECT_TRUE(before.object < r.object || (before.object == r.object && before.key < r.key));
  }
  std::set<uint64_t> seeds;
  for (const Receiver& r : w.receivers.all) seeds.insert(r.seed);
  EXPECT_EQ(seeds.size(), w.receivers.all.size());
}

TEST(FindReceivers, ThreadsAndObjectOrderDoNotMatter) {
  const World one(test::room_with_crate(), 4, 1), two(test::room_with_crate(), 4, 2);
  ASSERT_EQ(one.receivers.all.size(), two.receivers.all.size());
  Scene turned = test::room_with_crate();
  std::reverse(turned.objects.begin(), turned.objects.end());
  const World other(std::move(turned));
  ASSERT_EQ(one.receivers.all.size(), other.receivers.all.size());
  for (size_t i = 0; i < one.receivers.all.size(); ++i) {
    const Receiver &a = one.receivers.all[i], &b = two.receivers.all[i];
    EXPECT_EQ(a.object, b.object);
    EXPECT_EQ(a.key, b.key);
    EXPECT_EQ(a.seed, b.seed);
    EXPECT_EQ(a.point.position, b.point.position);
    const uint32_t k = other.receivers.find(other.object(one.scene.objects[a.object].name), a.key);
    ASSERT_NE(k, Receivers::kNone);
    EXPECT_EQ(other.receivers.all[k].seed, a.seed);
  }
}

TEST(FindReceivers, NothingInsideASolid) {
  const World w(test::room_with_crate());
  EXPECT_GT(w.count("crate", false), 0);
  EXPECT_EQ(w.count("crate", true), 0) << "its material is double-sided, its inside is not seen";
}

TEST(FindReceivers, FloorUnderACrateIsSolid) {
  const World w(test::room_with_crate(), 8);
  const uint32_t floor = w.object("floor");
  const Object& object = w.scene.objects[floor];
  int under = 0;
  for (const Texel& texel : w.receivers.grids[floor].texels) {
    const Vec3 p = interpolate(object.positions, object.triangles[texel.triangle], texel.b1, texel.b2);
    const bool covered = p.x > 1 && p.x < 2.5f && p.z > 1 && p.z < 2.5f;
    under += covered;
    const uint32_t key = texel.y * static_cast<uint32_t>(w.layout.uv[floor].width) + texel.x;
    EXPECT_EQ(w.receivers.find(floor, key) == Receivers::kNone, covered) << p.x << ' ' << p.z;
  }
  EXPECT_EQ(under, 12 * 12);
  EXPECT_GE(w.receivers.solid_texels, 144u);
}

TEST(FindReceivers, DividerSharesItsRoomsAndHidesTheirEdges) {
  const World w(test::sealed_double_room(0.5f), 8);
  EXPECT_EQ(w.receivers.solid_texels, 4u * 4 * 24)
      << "floor, ceiling and two walls, four texels wide inside the divider";
}

Scene room_with_curtain(bool double_sided) {
  Scene scene = test::closed_box({4, 3, 4});
  const uint32_t cloth = test::add_material(&scene, "cloth", {0.5f, 0.5f, 0.5f});
  scene.materials[cloth].double_sided = double_sided;
  test::add_wall_object(&scene, "curtain", {1, 0.5f, 2}, {3, 0.5f, 2}, {3, 2.5f, 2}, {1, 2.5f, 2}, cloth);
  test::identify(&scene);
  return scene;
}

TEST(FindReceivers, CurtainHasTwoSides) {
  const World w(room_with_curtain(true));
  const int texels = static_cast<int>(w.texels("curtain"));
  EXPECT_EQ(texels, 64);
  EXPECT_EQ(w.count("curtain", false), texels);
  EXPECT_EQ(w.count("curtain", true), texels);
  for (const Receiver& r : w.receivers.all) {
    if (r.object != w.object("curtain")) continue;
    EXPECT_EQ(r.point.geometric, (Vec3{0, 0, r.back ? -1.0f : 1.0f}));
    EXPECT_GT((r.point.position.z - 2) * r.point.geometric.z, 0);
  }
  EXPECT_EQ(World(room_with_curtain(false)).count("curtain", true), 0) << "single-sided";
}

TEST(FindReceivers, ShellHasNoOutside) {
  Scene scene = test::closed_box({4, 3, 4});
  for (Material& m : scene.materials) m.double_sided = true;
  test::identify(&scene);
  const World w(std::move(scene));
  for (const Receiver& r : w.receivers.all) EXPECT_FALSE(r.back);
  EXPECT_EQ(w.receivers.solid_texels, 0u);
}

TEST(FindReceivers, OpenPlaneKeepsItsFront) {
  Scene scene = test::open_plane(2, {1, 1, 1});
  scene.materials[0].double_sided = true;
  test::identify(&scene);
  const World w(std::move(scene));
  EXPECT_EQ(w.count("plane", false), static_cast<int>(w.texels("plane")));
  EXPECT_EQ(w.count("plane", true), 0);
}

TEST(FindReceivers, GroundUnderAOneSidedCanopyIsOpen) {
  Scene scene = test::open_plane(10, {1, 1, 1});
  test::add_wall_object(&scene, "canopy", {-1, 2, 1}, {1, 2, 1}, {1, 2, -1}, {-1, 2, -1}, 0);  // looks up
  test::identify(&scene);
  const World w(std::move(scene), 2);
  EXPECT_EQ(w.count("plane", false), 20 * 20);
  EXPECT_EQ(w.receivers.solid_texels, 0u);
}

TEST(FindReceivers, ObjectsWithoutLightmapHaveNone) {
  Scene scene = test::room_with_crate();
  scene.objects[test::object_named(scene, "crate")].receive = Receive::kVolume;
  const World w(std::move(scene));
  EXPECT_EQ(w.texels("crate"), 0u);
  EXPECT_EQ(w.count("crate", false), 0);
  Hit hit;
  hit.object = w.object("crate");
  EXPECT_EQ(w.locate(hit), Receivers::kNone);
  EXPECT_EQ(w.receivers.find(hit.object, 0), Receivers::kNone);
}

TEST(FindReceivers, CanBeCancelled) {
  const Scene scene = test::closed_box({3, 2, 4});
  const auto tracer = RayTracer::create(scene);
  ASSERT_TRUE(tracer.ok());
  const auto layout = make_layout(scene, {});
  ASSERT_TRUE(layout.ok());
  CancelFlag cancel;
  cancel.cancel();
  Parallel parallel;
  parallel.cancel = &cancel;
  EXPECT_EQ(find_receivers(**tracer, *layout, parallel).status().code(), absl::StatusCode::kCancelled);
}

TEST(Locate, ExactWhereTheTexelIsAReceiver) {
  const World w(room_with_curtain(true));
  for (uint32_t i = 0; i < w.receivers.all.size(); ++i) {
    const Receiver& r = w.receivers.all[i];
    const Hit hit = w.tracer->closest(r.point.position + r.point.geometric * 0.01f, -r.point.geometric);
    ASSERT_TRUE(hit);
    EXPECT_EQ(w.locate(hit), i);
  }
}

/// Of the floor's receivers, only those that `keep` says true of stay.
void cut_holes(World* w, const std::function<bool(const Receiver&)>& keep) {
  std::vector<bool> kept;
  for (const Receiver& r : w->receivers.all) kept.push_back(r.object != w->object("floor") || keep(r));
  w->receivers.retain(kept);
}

TEST(Locate, NearestElse) {
  World w(test::closed_box({4, 3, 4}), 10);
  cut_holes(&w, [](const Receiver& r) { return mix64(r.seed) % 4 == 0; });
  const uint32_t floor = w.object("floor");
  const LightmapUv& uv = w.layout.uv[floor];
  ASSERT_EQ(uv.width, 40);
  const ReceiverSearch search(*w.tracer, w.layout, w.receivers);
  int fallbacks = 0;
  for (uint32_t t = 0; t < 2; ++t) {
    for (float b1 = 0.01f; b1 < 1; b1 += 0.023f) {
      for (float b2 = 0.01f; b1 + b2 < 1; b2 += 0.023f) {
        Hit hit;
        hit.object = floor;
        hit.triangle = t;
        hit.b1 = b1;
        hit.b2 = b2;
        const auto& c = uv.corners[t];
        const Vec2 p = c[0] * (1 - b1 - b2) + c[1] * b1 + c[2] * b2;
        const int x = static_cast<int>(p.x), y = static_cast<int>(p.y);
        const Vec3 at = w.tracer->position(hit);
        const auto distance = [&](uint32_t r) { return length(w.receivers.all[r].point.position - at); };
        float best = INFINITY;
        for (uint32_t r = w.receivers.ranges[floor].begin; r < w.receivers.ranges[floor].end; ++r) {
          best = std::min(best, distance(r));
        }
        const uint32_t located = search.locate(hit);
        ASSERT_NE(located, Receivers::kNone);
        // Its own texel's, or the nearest.
        const bool own = w.receivers.all[located].key == static_cast<uint32_t>(y * 40 + x);
        EXPECT_TRUE(own || std::abs(distance(located) - best) < 1e-4f);
        fallbacks += !own;
      }
    }
  }
  EXPECT_GT(fallbacks, 50);
}

TEST(Locate, NothingFartherThanEightTexels) {
  World w(test::closed_box({4, 3, 4}), 20);
  cut_holes(&w, [](const Receiver& r) {  // texels 20 to 49 in x and z
    const Vec3 p = r.point.position;
    return !(p.x > 1 && p.x < 2.5f && p.z > 1 && p.z < 2.5f);
  });
  const auto locate_at = [&](float x, float z) {
    // The floor's u runs along z and v along x; its triangles are (0, 1, 2) and (0, 2, 3).
    const float u = z / 4, v = x / 4;
    Hit hit;
    hit.object = w.object("floor");
    hit.triangle = v <= u ? 0 : 1;
    hit.b1 = v <= u ? u - v : u;
    hit.b2 = v <= u ? v : v - u;
    return w.locate(hit);
  };
  EXPECT_EQ(locate_at(1.77f, 1.77f), Receivers::kNone);
  EXPECT_EQ(locate_at(1.48f, 1.77f), Receivers::kNone) << "texel 29: ten from the edge";
  EXPECT_NE(locate_at(1.37f, 1.77f), Receivers::kNone) << "texel 27: eight from texel 19";
  EXPECT_NE(locate_at(0.52f, 1.77f), Receivers::kNone);
}

/// A box of 4 m that a curtain cuts in two: at x = 2.03, within texels if there are 10 a metre.
Scene box_with_curtain() {
  Scene scene = test::closed_box({4, 3, 4});
  const uint32_t cloth = test::add_material(&scene, "cloth", {0.5f, 0.5f, 0.5f});
  scene.materials[cloth].double_sided = true;
  test::add_wall_object(&scene, "curtain", {2.03f, 0, 0}, {2.03f, 0, 4}, {2.03f, 3, 4}, {2.03f, 3, 0}, cloth);
  test::identify(&scene);
  return scene;
}

TEST(Locate, NeverBehindAWall) {
  const World w(box_with_curtain(), 10);
  const ReceiverSearch search(*w.tracer, w.layout, w.receivers);
  int own_is_behind = 0;
  for (float x = 1.601f; x < 2.5f; x += 0.01f) {
    for (float z = 0.05f; z < 4; z += 0.1f) {
      const Hit hit = w.tracer->closest({x, 1, z}, {0, -1, 0});
      ASSERT_EQ(hit.object, w.object("floor"));
      const uint32_t located = search.locate(hit);
      ASSERT_NE(located, Receivers::kNone) << x << ' ' << z;
      const float at = w.receivers.all[located].point.position.x;
      EXPECT_EQ(at > 2.03f, x > 2.03f) << x << ' ' << z << ": found at " << at;
      own_is_behind += x > 2.03f && x < 2.1f;
    }
  }
  EXPECT_GT(own_is_behind, 100);
}

TEST(FindReceivers, ATexelThatACurtainCutsStandsForOneSide) {
  const World w(box_with_curtain(), 10);
  int cut = 0;
  for (const Receiver& r : w.receivers.all) {
    if (r.object != w.object("floor") || !(r.point.position.x > 2) || !(r.point.position.x < 2.1f)) continue;
    ++cut;
    EXPECT_NE(r.parts, 0);
    const TexelGrid& grid = w.receivers.grids[r.object];
    const Texel& texel = grid.texels[r.texel];
    const auto from = texel_points(w.scene.objects[r.object], w.layout.uv[r.object], grid, texel, r.back, r.parts);
    for (const ShadingPoint& p : from) EXPECT_EQ(p.position.x > 2.03f, r.point.position.x > 2.03f);
    EXPECT_GE(from.size(), 4u);
  }
  EXPECT_GE(cut, 30) << "of 40; a few see more of the curtain's back than of anything else, and count as solid";
}

/// A room with a box in it.
Scene room_with_box(Vec3 lo, Vec3 hi) {
  Scene scene = test::closed_box({4, 3, 4});
  Object& box = scene.objects.emplace_back();
  box.name = "box";
  add_box(&box, lo, hi, test::add_material(&scene, "paint", {0.5f, 0.5f, 0.5f}));
  test::identify(&scene);
  return scene;
}

TEST(FindReceivers, StripsOfTexelsNarrowerThanTheirPartsAreFound) {
  int found = 0;
  for (float gap = 0.02f; gap < 0.2f; gap += 0.02f) {
    const World w(room_with_box({gap, -0.1f, 0.5f}, {3.5f, 1, 3.5f}), 1);
    for (const Receiver& r : w.receivers.all) {
      if (r.object != w.object("floor") || r.parts >> 16 == 0) continue;
      ++found;
      const TexelGrid& grid = w.receivers.grids[r.object];
      const auto from =
          texel_points(w.scene.objects[r.object], w.layout.uv[r.object], grid, grid.texels[r.texel], r.back, r.parts);
      EXPECT_EQ(from.size(), static_cast<size_t>(std::popcount(r.parts & 0xffff)));
      bool has_middle = false;
      for (const ShadingPoint& p : from) {
        const Vec3 at = p.position;
        EXPECT_FALSE(at.x > gap && at.x < 3.5f && at.z > 0.5f && at.z < 3.5f) << at.x << ' ' << at.z;
        has_middle |= at == r.point.position;
      }
      EXPECT_TRUE(has_middle);
    }
  }
  EXPECT_GE(found, 4);
}

TEST(FindReceivers, NoTexelWithAStripInTheRoomStandsForTheVoid) {
  int astride = 0;
  for (float density = 1.5f; density < 4; density += 0.25f) {
    const World w(room_with_box({-0.22f, 0.5f, 1}, {0.22f, 2, 1.44f}), density);
    for (const Receiver& r : w.receivers.all) {
      if (r.object != w.object("box") || r.parts == 0) continue;
      const TexelGrid& grid = w.receivers.grids[r.object];
      const auto all =
          texel_points(w.scene.objects[r.object], w.layout.uv[r.object], grid, grid.texels[r.texel], r.back, 0);
      if (std::none_of(all.begin(), all.end(), [](const ShadingPoint& p) { return p.position.x > 0; })) continue;
      astride += std::abs(r.point.geometric.z) > 0.5f;
      EXPECT_GT(r.point.position.x, 0) << density;
    }
  }
  EXPECT_GE(astride, 8);
}

TEST(Locate, NeverAnotherChartThatSharesTheTexel) {
  // Two walls of a room, all their charts in one texel of a scene atlas: one receiver for both.
  Scene scene = test::closed_box({2, 2, 2});
  Object& both = scene.objects[0];
  const Object& other = scene.objects[2];
  const uint32_t first = static_cast<uint32_t>(both.positions.size());
  both.positions.insert(both.positions.end(), other.positions.begin(), other.positions.end());
  both.normals.insert(both.normals.end(), other.normals.begin(), other.normals.end());
  both.uv0.insert(both.uv0.end(), other.uv0.begin(), other.uv0.end());
  both.uv1.insert(both.uv1.end(), other.uv1.begin(), other.uv1.end());
  for (Triangle t : other.triangles) {
    for (uint32_t& v : t.v) v += first;
    both.triangles.push_back(t);
  }
  scene.objects.erase(scene.objects.begin() + 2);
  test::identify(&scene);
  const World w(std::move(scene), 0.5f);
  for (const Vec3 d : {Vec3{0, -1, 0}, Vec3{-1, 0.1f, 0.1f}, Vec3{1, 0.1f, 0}}) {
    const Hit hit = w.tracer->closest({1.1f, 1.05f, 0.9f}, d);
    ASSERT_TRUE(hit);
    const uint32_t located = w.locate(hit);
    if (located == Receivers::kNone) continue;
    EXPECT_GT(dot(w.receivers.all[located].point.geometric, w.tracer->geometric_normal(hit)), 0.5f);
  }
}

TEST(Locate, KeepsToTheSide) {
  const World w(room_with_curtain(false));
  Hit hit = w.tracer->closest({2.1f, 1.6f, 3}, {0, 0, -1});
  ASSERT_EQ(hit.object, w.object("curtain"));
  EXPECT_NE(w.locate(hit), Receivers::kNone);
  hit.back = true;
  EXPECT_EQ(w.locate(hit), Receivers::kNone);
}

}  // namespace
}  // namespace lightloom
