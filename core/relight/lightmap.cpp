#include "core/relight/lightmap.h"

#include <cmath>
#include <vector>

namespace lightloom {
namespace {

constexpr int kDilation = 4;  // texels

}  // namespace

void dilate(Image* image) {
  std::vector<float>& r = *image->channel("R");
  std::vector<float>& g = *image->channel("G");
  std::vector<float>& b = *image->channel("B");
  std::vector<bool> filled(r.size());
  for (size_t i = 0; i < filled.size(); ++i) filled[i] = (*image->channel("A"))[i] > 0;
  for (int pass = 0; pass < kDilation; ++pass) {
    std::vector<std::pair<size_t, Vec3>> added;
    for (int y = 0; y < image->height; ++y) {
      for (int x = 0; x < image->width; ++x) {
        if (filled[image->index(x, y)]) continue;
        Vec3 sum;
        float count = 0;
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            const int xx = x + dx, yy = y + dy;
            if (xx < 0 || yy < 0 || xx >= image->width || yy >= image->height) continue;
            const size_t i = image->index(xx, yy);
            if (!filled[i]) continue;
            sum += {r[i], g[i], b[i]};
            count += 1;
          }
        }
        if (count > 0) added.emplace_back(image->index(x, y), sum / count);
      }
    }
    for (const auto& [i, value] : added) {
      r[i] = value.x, g[i] = value.y, b[i] = value.z;
      filled[i] = true;
    }
  }
}

std::array<int, 2> pixel_of(const SurfaceElements& elements, const Receiver& receiver) {
  const Texel& texel = elements.receivers.grids[receiver.object].texels[receiver.texel];
  const auto& at = elements.layout.placements[receiver.object];
  return {at.x + static_cast<int>(texel.x), at.y + static_cast<int>(texel.y)};
}

Image lightmap_image(const SurfaceElements& elements, std::span<const Vec3> irradiance, bool back) {
  Image image(elements.layout.width, elements.layout.height, {"R", "G", "B", "A", "area"});
  for (size_t i = 0; i < elements.receivers.all.size(); ++i) {
    const Receiver& r = elements.receivers.all[i];
    if (r.back != back) continue;
    const Texel& texel = elements.receivers.grids[r.object].texels[r.texel];
    const auto [x, y] = pixel_of(elements, r);
    // Objects of a scene atlas may meet in a border texel: it belongs to the one that covers its centre.
    float& alpha = (*image.channel("A"))[image.index(x, y)];
    if (alpha > 0 && !texel.centre_covered) continue;
    alpha = 1;
    image.set_rgb(x, y, irradiance[i]);
    (*image.channel("area"))[image.index(x, y)] = texel.area;
  }
  dilate(&image);
  return image;
}

Vec3 sample_irradiance(const SurfaceElements& elements, const ReceiverSearch& search, std::span<const Vec3> irradiance,
                       const Hit& hit) {
  const LightmapUv& uv = elements.layout.uv[hit.object];
  if (uv.corners.empty()) return {};
  const auto& c = uv.corners[hit.triangle];
  const Vec2 p = c[0] * (1 - hit.b1 - hit.b2) + c[1] * hit.b1 + c[2] * hit.b2;
  const float fx = std::floor(p.x - 0.5f), fy = std::floor(p.y - 0.5f);
  const float ax = p.x - 0.5f - fx, ay = p.y - 0.5f - fy;
  Vec3 sum;
  float weight = 0;
  for (int k = 0; k < 4; ++k) {
    const int x = static_cast<int>(fx) + (k & 1), y = static_cast<int>(fy) + (k >> 1);
    if (x < 0 || y < 0 || x >= uv.width || y >= uv.height) continue;
    const int side = hit.back ? uv.height : 0;
    const uint32_t i = elements.receivers.find(hit.object, static_cast<uint32_t>((side + y) * uv.width + x));
    if (i == Receivers::kNone) continue;
    const float w = (k & 1 ? ax : 1 - ax) * (k >> 1 ? ay : 1 - ay);
    sum += irradiance[i] * w;
    weight += w;
  }
  if (weight > 1e-4f) return sum / weight;
  const uint32_t nearest = search.locate(hit);
  return nearest == Receivers::kNone ? Vec3{} : irradiance[nearest];
}

}  // namespace lightloom
