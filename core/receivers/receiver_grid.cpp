#include "core/receivers/receiver_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lightloom {
namespace {

constexpr float kOwnReach = 1.5f;    // texels: any two points of a texel are nearer
constexpr float kReach = 8;          // texels
constexpr float kSameWay = 0.5f;     // least cosine between normals
constexpr float kPlaneWeight = 4;    // of the squared distance from the hit's plane
constexpr float kObjectPenalty = 4;  // factor on the squared distance for other objects: their colour is theirs
constexpr float kCellTexels = 2;

}  // namespace

ReceiverGrid::ReceiverGrid(const Scene& scene, const AtlasLayout& layout, const Receivers& receivers)
    : scene_(scene), layout_(layout), receivers_(receivers) {
  // Cells follow the median texel.
  std::vector<float> sizes;
  for (const Receiver& r : receivers.all) {
    const Texel& texel = receivers.grids[r.object].texels[r.texel];
    sizes.push_back(texel_size(scene.objects[r.object], layout.uv[r.object], texel.triangle));
  }
  if (sizes.empty()) return;
  std::nth_element(sizes.begin(), sizes.begin() + static_cast<ptrdiff_t>(sizes.size() / 2), sizes.end());
  if (const float median = sizes[sizes.size() / 2]; median > 0) side_ = kCellTexels * median;
  for (uint32_t i = 0; i < receivers.all.size(); ++i) entries_.push_back({cell_of(receivers.all[i].point.position), i});
  std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
    return std::pair(a.cell, a.receiver) < std::pair(b.cell, b.receiver);
  });
}

ReceiverGrid::Cell ReceiverGrid::cell_of(Vec3 p) const {
  Cell c{};
  for (int a = 0; a < 3; ++a) {
    const double limit = std::numeric_limits<int32_t>::max() / 2;
    c[static_cast<size_t>(a)] =
        static_cast<int32_t>(std::clamp(std::floor(static_cast<double>(p[a] / side_)), -limit, limit));
  }
  return c;
}

uint32_t ReceiverGrid::locate(const Hit& hit) const {
  const LightmapUv& uv = layout_.uv[hit.object];
  if (uv.corners.empty()) return Receivers::kNone;
  const Object& object = scene_.objects[hit.object];
  const ShadingPoint y = shading_point(object, hit.triangle, hit.b1, hit.b2, hit.back);
  const float texel = texel_size(object, uv, hit.triangle);
  const auto faces_alike = [&](const Receiver& r) { return dot(r.point.geometric, y.geometric) >= kSameWay; };

  // The texel's own receiver.
  const auto& c = uv.corners[hit.triangle];
  const Vec2 p = c[0] * (1 - hit.b1 - hit.b2) + c[1] * hit.b1 + c[2] * hit.b2;
  const int px = std::clamp(static_cast<int>(std::floor(p.x)), 0, uv.width - 1);
  const int py = std::clamp(static_cast<int>(std::floor(p.y)), 0, uv.height - 1);
  const uint32_t own =
      receivers_.find(hit.object, static_cast<uint32_t>(((hit.back ? uv.height : 0) + py) * uv.width + px));
  if (own != Receivers::kNone) {
    const Receiver& r = receivers_.all[own];
    if (faces_alike(r) && length(r.point.position - y.position) <= kOwnReach * texel) return own;
  }

  // The nearest one, shell by shell of cells.
  const float reach = kReach * texel;
  const Cell home = cell_of(y.position);
  uint32_t best = Receivers::kNone;
  float best_score = reach * reach;
  // Ties are settled by name: the scene's order must not show.
  const auto before = [&](const Receiver& a, const Receiver& b) {
    if (a.object == b.object) return a.key < b.key;
    return scene_.objects[a.object].id < scene_.objects[b.object].id;
  };
  const auto consider = [&](uint32_t i) {
    const Receiver& r = receivers_.all[i];
    if (!faces_alike(r)) return;
    const Vec3 d = r.point.position - y.position;
    const float off_plane = dot(d, y.geometric);
    float score = dot(d, d) + kPlaneWeight * off_plane * off_plane;
    if (r.object != hit.object) score *= kObjectPenalty;
    const bool tie = score == best_score && best != Receivers::kNone && before(r, receivers_.all[best]);
    if (score < best_score || tie) best = i, best_score = score;
  };
  const int shells = static_cast<int>(std::ceil(reach / side_));
  for (int shell = 0; shell <= shells; ++shell) {
    for (int dx = -shell; dx <= shell; ++dx) {
      for (int dy = -shell; dy <= shell; ++dy) {
        // The shell's faces along z, or the whole row where it lies in a face along x or y.
        const bool face = std::max(std::abs(dx), std::abs(dy)) == shell;
        for (int dz = -shell; dz <= shell; dz += face || shell == 0 ? 1 : 2 * shell) {
          const Cell cell{home[0] + dx, home[1] + dy, home[2] + dz};
          auto it = std::lower_bound(entries_.begin(), entries_.end(), cell,
                                     [](const Entry& e, const Cell& key) { return e.cell < key; });
          for (; it != entries_.end() && it->cell == cell; ++it) consider(it->receiver);
        }
      }
    }
    // Farther shells hold nothing nearer than this.
    const float beyond = static_cast<float>(shell) * side_;
    if (best_score <= beyond * beyond) break;
  }
  return best;
}

}  // namespace lightloom
