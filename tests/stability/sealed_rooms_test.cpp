// Light must not pass walls, however thin: the rooms share cells, probes and clusters, so only visibility keeps them apart.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"

namespace lightloom::stability {
namespace {

enum class Divider { kSolid, kFacesTheLight, kFacesTheDark, kBothSides };

struct Wall {
  const char* name;
  Divider divider;
  float thickness;  // m
};
void PrintTo(const Wall& wall, std::ostream* out) { *out << wall.name; }

Scene rooms(const Wall& wall) {
  if (wall.divider == Divider::kSolid) return test::sealed_double_room(wall.thickness);
  Scene scene = test::closed_box({6, 3, 3});
  const uint32_t material = test::add_material(&scene, "divider", {0.5f, 0.5f, 0.5f});
  scene.materials[material].double_sided = wall.divider == Divider::kBothSides;
  const Vec3 a{3, 0, 0}, b{3, 3, 0}, c{3, 3, 3}, d{3, 0, 3};
  if (wall.divider == Divider::kFacesTheDark) {
    test::add_wall_object(&scene, "divider", a, b, c, d, material);
  } else {
    test::add_wall_object(&scene, "divider", a, d, c, b, material);
  }
  test::add_point_light(&scene, {1.5f, 2, 1.5f}, 10);
  test::identify(&scene);
  return scene;
}

class StabilitySealedRooms : public ::testing::TestWithParam<Wall> {};

TEST_P(StabilitySealedRooms, NoLightLeaks) {
  const Wall& wall = GetParam();
  const auto level = bake_at(rooms(wall), 1, 6);
  const Field e = relight(*level, 8);
  const float h = wall.thickness / 2, edge = std::min(1e-3f, h / 2);
  const auto inside = [](const Receiver& r) {
    const Vec3 p = r.point.position;
    return p.y > -0.001f && p.y < 3.001f && p.z > -0.001f && p.z < 3.001f;
  };
  const double lit = mean(*level, e, [&](const Receiver& r) { return inside(r) && r.point.position.x < 3 - h + edge; });
  const double dark =
      mean(*level, e, [&](const Receiver& r) { return inside(r) && r.point.position.x > 3 + h - edge; });
  ASSERT_GT(lit, 0.1);
  float worst = 0;
  for (size_t i = 0; i < e.size(); ++i) {
    const Receiver& r = level->elements.receivers.all[i];
    if (inside(r) && r.point.position.x > 3 + h - edge) worst = std::max(worst, std::abs(e[i].x));
  }
  check({Case::kSealedRooms, "largest |E| in the dark room ÷ mean E of the lit one, " + std::string(wall.name),
         static_cast<double>(worst) / lit, 0.1});
  check({Case::kSealedRooms, "leak, " + std::string(wall.name), dark / lit, 1e-3}, [&] {
    Field truth = e;  // the dark room's is 0
    for (size_t i = 0; i < e.size(); ++i) {
      if (level->elements.receivers.all[i].point.position.x > 3 + h - edge) truth[i] = {};
    }
    return beside(*level, e, truth);
  });
}
INSTANTIATE_TEST_SUITE_P(Walls, StabilitySealedRooms,
                         ::testing::Values(Wall{"wall of 5 cm", Divider::kSolid, 0.05f},
                                           Wall{"wall of 1 cm", Divider::kSolid, 0.01f},
                                           Wall{"plane that faces the lamp", Divider::kFacesTheLight, 0},
                                           Wall{"plane that faces the dark room", Divider::kFacesTheDark, 0},
                                           Wall{"double-sided plane", Divider::kBothSides, 0}),
                         [](const auto& info) { return "Wall" + std::to_string(info.index); });

}  // namespace
}  // namespace lightloom::stability
