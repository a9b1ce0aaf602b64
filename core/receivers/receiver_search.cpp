#include "core/receivers/receiver_search.h"

#include <nanoflann.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/receivers/open_space.h"

namespace lightloom {
namespace {

constexpr float kOwnReach = 1.5f;    // texels: any two points of a texel are nearer
constexpr float kReach = 8;          // texels
constexpr float kSameWay = 0.5f;     // least cosine between normals
constexpr float kPlaneWeight = 4;    // of the squared distance from the hit's plane
constexpr float kObjectPenalty = 4;  // factor on the squared distance for other objects: their colour is theirs
constexpr size_t kTries = 8;         // receivers, before all are taken to be behind walls
constexpr float kTexelSpread = 4;    // texels of an object that are larger or smaller than this are bad charts

/// Receivers as nanoflann reads them.
struct Points {
  const std::vector<Receiver>& all;
  size_t kdtree_get_point_count() const { return all.size(); }
  float kdtree_get_pt(size_t i, size_t axis) const { return all[i].point.position[static_cast<int>(axis)]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

/// What a search keeps: the kTries candidates of least score, best first, where score(candidate) is no less than its
/// squared distance.
template <class Score, class Before>
struct Best {
  Score score;
  Before before;
  float bound;  ///< that no score exceeds
  struct Candidate {
    float score;
    uint32_t receiver;
  };
  std::array<Candidate, kTries> all{};
  size_t count = 0;

  size_t size() const { return count; }
  bool full() const { return true; }
  float worst() const { return count == kTries ? all[count - 1].score : bound; }
  // Ties are looked at too.
  float worstDist() const { return std::nextafter(worst(), std::numeric_limits<float>::infinity()); }
  bool addPoint(float, uint32_t i) {
    const Candidate added{score(i), i};
    const auto better = [&](const Candidate& a, const Candidate& b) {
      return a.score < b.score || (a.score == b.score && before(a.receiver, b.receiver));
    };
    if (!(added.score < bound) || (count == kTries && !better(added, all[count - 1]))) return true;
    if (count < kTries) ++count;
    size_t at = count - 1;
    for (; at > 0 && better(added, all[at - 1]); --at) all[at] = all[at - 1];
    all[at] = added;
    return true;
  }
};

}  // namespace

struct ReceiverSearch::Tree {
  explicit Tree(const Receivers& receivers) : points{receivers.all}, index(3, points) {}
  Points points;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Points>, Points, 3, uint32_t> index;
};

ReceiverSearch::ReceiverSearch(const RayTracer& tracer, const AtlasLayout& layout, const Receivers& receivers)
    : tracer_(tracer),
      scene_(tracer.scene()),
      layout_(layout),
      receivers_(receivers),
      tree_(std::make_unique<Tree>(receivers)) {
  const Scene& scene = scene_;
  for (size_t o = 0; o < scene.objects.size(); ++o) {
    double area = 0, texels = 0;
    for (uint32_t t = 0; t < layout.uv[o].corners.size(); ++t) {
      const auto& c = layout.uv[o].corners[t];
      const auto& v = scene.objects[o].triangles[t].v;
      const auto& p = scene.objects[o].positions;
      area += 0.5 * static_cast<double>(length(cross(p[v[1]] - p[v[0]], p[v[2]] - p[v[0]])));
      const Vec2 d1 = c[1] - c[0], d2 = c[2] - c[0];
      texels += 0.5 * static_cast<double>(std::abs(d1.x * d2.y - d1.y * d2.x));
    }
    texels_.push_back(texels > 0 ? static_cast<float>(std::sqrt(area / texels)) : 0);
  }
}

ReceiverSearch::~ReceiverSearch() = default;

/// Metres. A chart squeezed to nothing, or blown up, has no say.
float ReceiverSearch::texel_of(uint32_t object, uint32_t triangle) const {
  const float mean = texels_[object], own = texel_size(scene_.objects[object], layout_.uv[object], triangle);
  return std::clamp(own, mean / kTexelSpread, mean * kTexelSpread);
}

uint32_t ReceiverSearch::locate(const Hit& hit, float* reach) const {
  const auto looked_at = [&](float metres) {
    if (reach != nullptr) *reach = metres;
  };
  looked_at(0);
  const LightmapUv& uv = layout_.uv[hit.object];
  if (uv.corners.empty()) return Receivers::kNone;
  const ShadingPoint y = shading_point(scene_.objects[hit.object], hit.triangle, hit.b1, hit.b2, hit.back);
  const float texel = texel_of(hit.object, hit.triangle);
  const auto faces_alike = [&](const Receiver& r) { return dot(r.point.geometric, y.geometric) >= kSameWay; };

  // The texel's own receiver.
  const auto& c = uv.corners[hit.triangle];
  const Vec2 p = c[0] * (1 - hit.b1 - hit.b2) + c[1] * hit.b1 + c[2] * hit.b2;
  const int px = std::clamp(static_cast<int>(std::floor(p.x)), 0, uv.width - 1);
  const int py = std::clamp(static_cast<int>(std::floor(p.y)), 0, uv.height - 1);
  uint32_t own = receivers_.find(hit.object, static_cast<uint32_t>(((hit.back ? uv.height : 0) + py) * uv.width + px));
  if (own != Receivers::kNone) {
    const Receiver& r = receivers_.all[own];
    const float distance = length(r.point.position - y.position);
    const bool near = faces_alike(r) && distance <= kOwnReach * texel;
    if (near && joined(tracer_, y, r.point)) {
      looked_at((1 + kDetour) * distance);
      return own;
    }
    if (!near) own = Receivers::kNone;
  }

  // The nearest one.
  const float reach2 = kReach * texel * kReach * texel;
  const auto score = [&](uint32_t i) {
    const Receiver& r = receivers_.all[i];
    if (!faces_alike(r)) return std::numeric_limits<float>::infinity();
    const Vec3 d = r.point.position - y.position;
    const float off_plane = dot(d, y.geometric);
    return (dot(d, d) + kPlaneWeight * off_plane * off_plane) * (r.object == hit.object ? 1 : kObjectPenalty);
  };
  // Ties are settled by name: the scene's order must not show.
  const auto before = [&](uint32_t i, uint32_t j) {
    const Receiver &a = receivers_.all[i], &b = receivers_.all[j];
    if (a.object == b.object) return a.key < b.key;
    return scene_.objects[a.object].id < scene_.objects[b.object].id;
  };
  Best<decltype(score), decltype(before)> best{score, before, reach2};
  const float at[3] = {y.position.x, y.position.y, y.position.z};
  tree_->index.findNeighbors(best, at, nanoflann::SearchParams());
  // A score is no less than the squared distance, and ways between rise above both ends by kDetour. Its own receiver, were
  // it there, would be nearer than this.
  looked_at((1 + kDetour) * std::max(std::sqrt(best.worst()), kOwnReach * texel));
  for (size_t i = 0; i < best.count; ++i) {
    const uint32_t receiver = best.all[i].receiver;
    if (joined(tracer_, y, receivers_.all[receiver].point)) return receiver;
  }
  // Where a surface is too crumpled for its texels, all is behind walls: better its own texel's than none.
  return own;
}

}  // namespace lightloom
