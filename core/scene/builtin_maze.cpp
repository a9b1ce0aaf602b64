// A maze of 9 × 9 cells with a ceiling: long corridors, many bounces. Each wall is an object of its own, so
// that doors can be cut and closed; its ends are hidden in pillars a little thicker than it.
#include <array>
#include <string>
#include <vector>

#include "core/base/rng.h"
#include "core/scene/builtin_builder.h"
#include "core/scene/shapes.h"

namespace lightloom {
namespace {

constexpr int kCells = 9;
constexpr float kPitch = 2.4f, kHeight = 2.4f, kHalfWall = 0.1f, kHalfPillar = 0.12f;

/// Which walls stand: east[x][z] between cells (x, z) and (x + 1, z), south[x][z] between (x, z) and (x, z +
/// 1).
struct Maze {
  std::array<std::array<bool, kCells>, kCells> east, south;
};

/// Depth-first search with random turns (the "recursive backtracker"), then a few walls less, for loops.
Maze carve() {
  Maze maze;
  for (auto* walls : {&maze.east, &maze.south}) {
    for (auto& row : *walls) row.fill(true);
  }
  Rng rng(9);
  std::array<std::array<bool, kCells>, kCells> visited{};
  const auto cell = [](auto& grid, int x, int z) -> auto& {
    return grid[static_cast<size_t>(x)][static_cast<size_t>(z)];
  };
  std::vector<std::array<int, 2>> path{{0, 0}};
  cell(visited, 0, 0) = true;
  while (!path.empty()) {
    const auto [x, z] = path.back();
    std::vector<std::array<int, 2>> next;
    for (const auto& [dx, dz] : {std::array{1, 0}, std::array{-1, 0}, std::array{0, 1}, std::array{0, -1}}) {
      const int nx = x + dx, nz = z + dz;
      if (nx >= 0 && nz >= 0 && nx < kCells && nz < kCells && !cell(visited, nx, nz)) next.push_back({nx, nz});
    }
    if (next.empty()) {
      path.pop_back();
      continue;
    }
    const auto [nx, nz] = next[rng.next_below(static_cast<uint32_t>(next.size()))];
    if (nx != x) cell(maze.east, std::min(x, nx), z) = false;
    if (nz != z) cell(maze.south, x, std::min(z, nz)) = false;
    cell(visited, nx, nz) = true;
    path.push_back({nx, nz});
  }
  for (int i = 0; i < 8; ++i) {
    const int a = static_cast<int>(rng.next_below(kCells - 1)), b = static_cast<int>(rng.next_below(kCells));
    (i % 2 ? cell(maze.east, a, b) : cell(maze.south, b, a)) = false;
  }
  return maze;
}

float line(int i) { return static_cast<float>(i) * kPitch; }

}  // namespace

Scene make_maze() {
  SceneBuilder s;
  const uint32_t floor = s.material("floor", {0.5f, 0.48f, 0.45f});
  const uint32_t ceiling = s.material("ceiling", {0.7f, 0.7f, 0.7f});
  const std::array<uint32_t, 3> walls{s.material("wall orange", {0.7f, 0.5f, 0.3f}),
                                      s.material("wall blue", {0.3f, 0.5f, 0.7f}),
                                      s.material("wall grey", {0.6f, 0.6f, 0.6f})};
  const uint32_t stone = s.material("pillar", {0.55f, 0.53f, 0.5f});
  const float edge = line(kCells);
  add_box(s.object("floor"), {-0.2f, -0.2f, -0.2f}, {edge + 0.2f, 0, edge + 0.2f}, floor);
  add_box(s.object("ceiling"), {-0.2f, kHeight, -0.2f}, {edge + 0.2f, kHeight + 0.2f, edge + 0.2f}, ceiling);

  Object* pillars = s.object("pillars");
  for (int x = 0; x <= kCells; ++x) {
    for (int z = 0; z <= kCells; ++z) {
      add_box(pillars, {line(x) - kHalfPillar, -0.1f, line(z) - kHalfPillar},
              {line(x) + kHalfPillar, kHeight + 0.1f, line(z) + kHalfPillar}, stone);
    }
  }
  const auto wall = [&](bool along_x, int x, int z) {
    const uint32_t m = walls[static_cast<size_t>(x / 3 + z / 3) % 3];
    Object* o =
        s.object(std::string("wall ") + (along_x ? "x" : "z") + " " + std::to_string(x) + "," + std::to_string(z));
    const Vec3 lo{line(x), -0.05f, line(z)}, hi{line(x), kHeight + 0.05f, line(z)};
    if (along_x) {
      add_box(o, {lo.x, lo.y, lo.z - kHalfWall}, {hi.x + kPitch, hi.y, hi.z + kHalfWall}, m);
    } else {
      add_box(o, {lo.x - kHalfWall, lo.y, lo.z}, {hi.x + kHalfWall, hi.y, hi.z + kPitch}, m);
    }
  };
  const Maze maze = carve();
  for (int x = 0; x <= kCells; ++x) {
    for (int z = 0; z <= kCells; ++z) {
      const auto ux = static_cast<size_t>(x), uz = static_cast<size_t>(z);
      if (x < kCells && (z == 0 || z == kCells || maze.south[ux][uz - 1])) wall(true, x, z);
      if (z < kCells && (x == 0 || x == kCells || maze.east[ux - 1][uz])) wall(false, x, z);
    }
  }

  const auto center = [](int i) { return (static_cast<float>(i) + 0.5f) * kPitch; };
  s.point_light("red", {center(0), 1.9f, center(0)}, {1, 0.45f, 0.3f}, 15);
  s.point_light("green", {center(4), 1.9f, center(4)}, {0.45f, 1, 0.5f}, 15);
  s.point_light("blue", {center(8), 1.9f, center(6)}, {0.4f, 0.55f, 1}, 15);
  s.camera("middle", {center(4) - 0.8f, 1.6f, center(4) - 0.8f}, {center(4) + 1, 1.2f, center(4) + 1}, 1.1f, 16.0f / 9);
  return s.finish();
}

}  // namespace lightloom
