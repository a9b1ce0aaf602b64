#include "core/transport/visibility_cache.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/octahedral.h"
#include "core/base/rng.h"

namespace lightloom {
namespace {

constexpr float kSameWay = 0.9f;  // least cosine between the hit's normal and the receiver's

}  // namespace

VisibilityCache::VisibilityCache(const RayTracer& tracer, const AtlasLayout& layout, std::span<const TexelGrid> grids,
                                 std::span<const Vec3> probes, uint64_t byte_budget)
    : tracer_(tracer),
      layout_(layout),
      grids_(grids),
      probes_(probes),
      budget_(byte_budget),
      groups_((probes.size() + kGroup - 1) / kGroup),
      rows_(grids.size()),
      skies_(probes.size()) {
  for (size_t o = 0; o < grids.size(); ++o) {
    const std::vector<Texel>& texels = grids[o].texels;
    Rows& rows = rows_[o];
    rows.first = patches_;
    patches_ += 2 * static_cast<uint32_t>(texels.size());
    if (texels.empty()) continue;
    rows.first_row = texels.front().y;
    for (uint32_t t = 0; t < texels.size(); ++t) {
      rows.begin.resize(texels[t].y - rows.first_row + 1, t);
      rows.x.push_back(texels[t].x);
    }
    rows.begin.push_back(static_cast<uint32_t>(texels.size()));
  }
  surfaces_ = std::vector<std::atomic<Surfaces*>>((patches_ + kPagePatches - 1) / kPagePatches);
  verdicts_ = std::vector<std::atomic<Verdicts*>>(surfaces_.size() * groups_);
  bytes_ = sizeof(void*) * (surfaces_.size() + verdicts_.size() + skies_.size());
}

VisibilityCache::~VisibilityCache() {
  for (auto& page : surfaces_) delete page.load(std::memory_order_relaxed);
  for (auto& page : verdicts_) delete page.load(std::memory_order_relaxed);
  for (auto& page : skies_) delete page.load(std::memory_order_relaxed);
}

VisibilityCache::Patch VisibilityCache::patch_of(const Hit& hit, const ShadingPoint& point, float* reach) {
  if (reach != nullptr) *reach = 0;
  const Rows& rows = rows_[hit.object];
  if (rows.x.empty()) return kNoPatch;
  const auto& corner = layout_.uv[hit.object].corners[hit.triangle];
  const float b0 = 1 - hit.b1 - hit.b2;
  const float u = b0 * corner[0].x + hit.b1 * corner[1].x + hit.b2 * corner[2].x;
  const float v = b0 * corner[0].y + hit.b1 * corner[1].y + hit.b2 * corner[2].y;
  if (!(u >= 0) || !(v >= static_cast<float>(rows.first_row))) return kNoPatch;
  const uint32_t x = static_cast<uint32_t>(u), row = static_cast<uint32_t>(v) - rows.first_row;
  if (row + 1 >= rows.begin.size()) return kNoPatch;
  const auto end = rows.x.begin() + rows.begin[row + 1];
  const auto it = std::lower_bound(rows.x.begin() + rows.begin[row], end, x);
  if (it == end || *it != x) return kNoPatch;
  const Patch patch = rows.first + 2 * static_cast<uint32_t>(it - rows.x.begin()) + (hit.back ? 1 : 0);
  // Another chart may share the texel.
  Surface spare;
  const Surface& s = surface(patch, &spare);
  const Vec3 d = point.position - s.centre;
  if (dot(point.geometric, s.normal) < kSameWay || !(dot(d, d) <= s.reach2)) return kNoPatch;
  if (reach != nullptr) *reach = 2 * std::sqrt(s.reach2);
  return patch;
}

VisibilityCache::Verdict VisibilityCache::find(Patch patch, uint32_t probe, uint64_t* rays) {
  std::atomic<Verdicts*>& slot = verdicts_[patch / kPagePatches * groups_ + probe / kGroup];
  Verdicts* page = slot.load(std::memory_order_acquire);
  if (page == nullptr && bytes() + sizeof(Verdicts) <= budget_) page = publish(&slot, new Verdicts{});
  if (page == nullptr) return trace(patch, probe, rays);

  return remember(
      &(*page)[patch % kPagePatches], probe % kGroup, [&](uint64_t* traced) { return trace(patch, probe, traced); },
      rays);
}

VisibilityCache::Verdict VisibilityCache::find_sky(Vec3 d, uint32_t probe, uint64_t* rays) {
  const Vec2 at = octahedral(d);
  const auto place = [](float x) {
    return std::min(kSkySide - 1, static_cast<uint32_t>(std::max(0.0f, (0.5f + 0.5f * x) * kSkySide)));
  };
  const uint32_t cell = place(at.y) * kSkySide + place(at.x);
  std::atomic<Sky*>& slot = skies_[probe];
  Sky* page = slot.load(std::memory_order_acquire);
  if (page == nullptr && bytes() + sizeof(Sky) <= budget_) page = publish(&slot, new Sky{});
  if (page == nullptr) return trace_sky(cell, probe, rays);
  return remember(
      &(*page)[cell / kGroup], cell % kGroup, [&](uint64_t* traced) { return trace_sky(cell, probe, traced); }, rays);
}

/// The verdict in two bits of the word, or `trace` and put it there.
template <class Trace>
VisibilityCache::Verdict VisibilityCache::remember(std::atomic<uint32_t>* word, uint32_t place, const Trace& trace,
                                                   uint64_t* rays) {
  const uint32_t shift = 2 * place;
  if (const uint32_t known = word->load(std::memory_order_relaxed) >> shift & 3; known != kUnknown) {
    return static_cast<Verdict>(known);
  }
  uint64_t traced = 0;
  const Verdict verdict = trace(&traced);
  // Whoever finds it at the same time finds the same.
  const uint32_t before = word->fetch_or(static_cast<uint32_t>(verdict) << shift, std::memory_order_relaxed);
  if ((before >> shift & 3) == kUnknown) *rays += traced;
  return verdict;
}

/// Puts the page where others find it, unless another thread was first.
template <class Page>
Page* VisibilityCache::publish(std::atomic<Page*>* slot, Page* page) {
  Page* other = nullptr;
  if (slot->compare_exchange_strong(other, page, std::memory_order_acq_rel)) {
    bytes_.fetch_add(sizeof(Page), std::memory_order_relaxed);
    return page;
  }
  delete page;
  return other;
}

VisibilityCache::Surface VisibilityCache::make_surface(Patch patch) const {
  // Of the objects without patches that begin here too, the last has them.
  const auto after =
      std::upper_bound(rows_.begin(), rows_.end(), patch, [](Patch p, const Rows& r) { return p < r.first; });
  const size_t o = static_cast<size_t>(after - rows_.begin()) - 1;
  const Object& object = tracer_.scene().objects[o];
  const Texel& texel = grids_[o].texels[(patch - rows_[o].first) / 2];
  const bool back = (patch - rows_[o].first) % 2 == 1;
  const ShadingPoint centre = shading_point(object, texel.triangle, texel.b1, texel.b2, back);
  Surface out;
  out.centre = centre.position;
  out.normal = centre.geometric;
  Rng rng(hash_combine(object.id.low64(), patch - rows_[o].first));
  for (uint32_t i = 0; i < kSamples; ++i) {
    // At the corners, nearly: what passes between two samples is rarer than what passes beside them.
    const Sample2 at = stratified(i, 2, &rng);
    const auto outwards = [](float x) { return x < 0.5f ? 0.02f * x : 1 - 0.02f * (1 - x); };
    const SurfacePoint s = sample_texel(object, layout_.uv[o], grids_[o], texel, {outwards(at.u), outwards(at.v)});
    out.samples[i] = shading_point(object, s.triangle, s.b1, s.b2, back).position;
    // Samples are just short of the corners, or where the surface ends. What is farther is traced.
    const Vec3 d = out.samples[i] - out.centre;
    out.reach2 = std::max(out.reach2, 1.6f * dot(d, d));
  }
  return out;
}

const VisibilityCache::Surface& VisibilityCache::surface(Patch patch, Surface* spare) {
  std::atomic<Surfaces*>& slot = surfaces_[patch / kPagePatches];
  Surfaces* page = slot.load(std::memory_order_acquire);
  if (page == nullptr && bytes() + sizeof(Surfaces) <= budget_) {
    page = new Surfaces;
    const Patch first = patch / kPagePatches * kPagePatches;
    const uint32_t count = std::min(kPagePatches, patches_ - first);
    for (uint32_t i = 0; i < count; ++i) (*page)[i] = make_surface(first + i);
    page = publish(&slot, page);
  }
  if (page != nullptr) return (*page)[patch % kPagePatches];
  *spare = make_surface(patch);
  return *spare;
}

VisibilityCache::Verdict VisibilityCache::trace(Patch patch, uint32_t probe, uint64_t* rays) {
  Surface spare;
  const Surface& s = surface(patch, &spare);
  const auto sees = [&](Vec3 from) {
    ++*rays;
    return tracer_.visible(from, probes_[probe]);
  };
  const bool first = sees(s.samples[0]);
  for (uint32_t i = 1; i < kSamples; ++i) {
    if (sees(s.samples[i]) != first) return kSplit;
  }
  return first ? kSeen : kHidden;
}

VisibilityCache::Verdict VisibilityCache::trace_sky(uint32_t cell, uint32_t probe, uint64_t* rays) const {
  // The same directions from every probe.
  Rng rng(hash_combine(cell, 0x5c1));
  int seen = 0;
  for (uint32_t i = 0; i < kSamples; ++i) {
    const Sample2 at = stratified(i, 2, &rng);
    const float u = 2 * (static_cast<float>(cell % kSkySide) + at.u) / kSkySide - 1;
    const float v = 2 * (static_cast<float>(cell / kSkySide) + at.v) / kSkySide - 1;
    ++*rays;
    seen += !tracer_.occluded(probes_[probe], from_octahedral({u, v}), std::numeric_limits<float>::infinity());
    if (seen != 0 && seen != static_cast<int>(i) + 1) return kSplit;
  }
  return seen > 0 ? kSeen : kHidden;
}

}  // namespace lightloom
