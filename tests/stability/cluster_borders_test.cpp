// Each cluster is truncated on its own, so neighbours disagree at their border. Seam: the mean jump of E − E_uncompressed
// between adjacent texels of different clusters, over mean E. Truncation also takes noise of the gather rays away, which
// jumps from any texel to the next; the step, between means of up to ten texels on each side, has little of that and is
// what an eye would follow along a border.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "cli/view/overlays.h"
#include "core/scene/builtin.h"
#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"

namespace lightloom::stability {
namespace {

/// Means over pairs of adjacent texels, channels together.
struct Jumps {
  double across = 0, within = 0;
  double step = 0;     ///< across, of means
  uint64_t pairs = 0;  ///< across borders
};

double size(Vec3 jump) { return static_cast<double>(std::abs(jump.x) + std::abs(jump.y) + std::abs(jump.z)) / 3; }

/// Mean error of `i` and those of its cluster beside it: two deep by five wide. `away`: from the border.
Vec3 beside_border(const Receivers& receivers, const std::vector<uint32_t>& cluster, const Field& error, uint32_t i,
                   int away_x, int away_y) {
  const Receiver& r = receivers.all[i];
  const TexelGrid& grid = receivers.grids[r.object];
  const int x = static_cast<int>(r.key) % grid.width, y = static_cast<int>(r.key) / grid.width % grid.height;
  Vec3 sum{};
  int count = 0;
  for (int deep = 0; deep < 2; ++deep) {
    for (int wide = -2; wide <= 2; ++wide) {
      const int tx = x + deep * away_x + wide * away_y, ty = y + deep * away_y + wide * away_x;
      if (tx < 0 || ty < 0 || tx >= grid.width || ty >= grid.height) continue;
      const uint32_t to =
          receivers.find(r.object, static_cast<uint32_t>(static_cast<int>(r.key) + (ty - y) * grid.width + tx - x));
      if (to == Receivers::kNone || cluster[to] != cluster[i]) continue;
      if (dot(receivers.all[to].point.geometric, r.point.geometric) < 0.9f) continue;
      sum = sum + error[to];
      ++count;
    }
  }
  return sum / static_cast<float>(count);
}

Jumps jumps(const BakedLevel& level, const std::vector<uint32_t>& cluster, const Field& error) {
  double sum[2] = {0, 0}, steps = 0;
  uint64_t count[2] = {0, 0};
  const Receivers& receivers = level.elements.receivers;
  for (uint32_t i = 0; i < error.size(); ++i) {
    const Receiver& r = receivers.all[i];
    const uint32_t w = static_cast<uint32_t>(receivers.grids[r.object].width);
    for (const uint32_t next : {1u, w}) {
      if (next == 1 && (r.key + 1) % w == 0) continue;
      const uint32_t j = receivers.find(r.object, r.key + next);
      if (j == Receivers::kNone || receivers.all[j].back != r.back) continue;
      // Charts may meet in the atlas without meeting in the level.
      const Vec3 d = receivers.all[j].point.position - r.point.position;
      if (length(d) > 2 / level.manifest.params.texels_per_metre) continue;
      if (dot(receivers.all[j].point.geometric, r.point.geometric) < 0.9f) continue;
      const int border = cluster[i] != cluster[j];
      sum[border] += size(error[i] - error[j]);
      ++count[border];
      const int x = next == 1, y = 1 - x;
      if (border) {
        steps += size(beside_border(receivers, cluster, error, i, -x, -y) -
                      beside_border(receivers, cluster, error, j, x, y));
      }
    }
  }
  const double pairs = static_cast<double>(count[1]);
  return {sum[1] / pairs, sum[0] / static_cast<double>(count[0]), steps / pairs, count[1]};
}

struct Seam {
  double jump = 0, within = 0, step = 0, compression = 0;
};

Seam seam_of(const BakedLevel& level, const Field& e, const Field& exact) {
  Field error(e.size());
  for (size_t i = 0; i < e.size(); ++i) error[i] = e[i] - exact[i];
  const auto owners = value_or_die(view::find_owners(level.loom(), level.manifest, *level.scene, level.elements));
  const Jumps found = jumps(level, owners.cluster, error);
  EXPECT_GT(found.pairs, 100u);
  const double scale = mean(level, exact);
  return {found.across / scale, found.within / scale, found.step / scale, difference(level, e, exact)};
}

/// By the default compression, and by a finer one.
void check_seams(const std::string& name, const Scene& scene, float texels_per_metre, float spacing, double no_worse) {
  BakeParams params;
  params.texels_per_metre = texels_per_metre;
  params.spacing = spacing;
  // All columns of clusters of fewer than 256 receivers: what is left out is below the rounding of fp16.
  BakeParams whole = params;
  whole.threshold = 0;
  whole.max_rank = 256;
  const auto uncompressed = bake_level(scene, whole);
  for (const ClusterEntry& c : uncompressed->manifest.clusters) ASSERT_LT(c.error, 0.01f) << "not uncompressed";
  const Field exact = relight(*uncompressed, 8);

  const auto level = bake_level(scene, params);
  ASSERT_EQ(exact.size(), level->elements.receivers.all.size());
  const Field e = relight(*level, 8);
  const Seam seam = seam_of(*level, e, exact);
  std::printf("%s: jump across borders %.4f, within %.4f, step across %.4f, ‖E − E_uncompressed‖ %.4f\n", name.c_str(),
              seam.jump, seam.within, seam.step, seam.compression);
  check({Case::kClusterBorders, "seam, " + name, seam.jump, 0.01, no_worse}, [&] { return beside(*level, e, exact); });
  check({Case::kClusterBorders, "step across borders, " + name, seam.step, 0.01});

  BakeParams fine = params;
  fine.max_rank = 96;
  fine.threshold = 0.01f;
  const auto finer = bake_level(scene, fine);
  const Field better = relight(*finer, 8);
  check({Case::kClusterBorders, "seam, --max-rank 96 --threshold 0.01, " + name, seam_of(*finer, better, exact).jump,
         0.01},
        [&] { return beside(*finer, better, exact); });
}

TEST(StabilityClusterBorders, Cornell) {
  check_seams("Cornell box", value_or_die(builtin_scene("cornell")), 4, 2, 0.04);
}

TEST(StabilityClusterBorders, RoomWithACrate) {
  Scene scene = test::room_with_crate();
  test::add_point_light(&scene, {3, 2, 3}, 10);
  check_seams("room with a crate", scene, 6, 1, 0.025);
}

}  // namespace
}  // namespace lightloom::stability
