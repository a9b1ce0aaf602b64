#include "core/scene/mesh_hash.h"

#include <vector>

namespace lightloom {

Digest MeshHasher::hash(const Object& local) {
  Hasher h;
  h.string("mesh").array(local.positions).array(local.normals).array(local.uv1);
  h.value(static_cast<uint64_t>(local.triangles.size()));
  std::map<uint32_t, uint32_t> masks;  // material → order of its first triangle
  bool uses_uv0 = false;
  for (const Triangle& t : local.triangles) {
    const Material& m = scene_.materials[t.material];
    h.bytes(t.v.data(), sizeof t.v).value(m.alpha_mode).value(static_cast<uint8_t>(m.double_sided));
    if (m.alpha_mode != AlphaMode::kMask) continue;
    const auto [mask, is_new] = masks.emplace(t.material, static_cast<uint32_t>(masks.size()));
    h.value(mask->second);
    if (!is_new) continue;
    h.value(m.alpha).value(m.alpha_cutoff).value(m.base_color_uv);
    if (m.base_color_texture < 0) continue;
    h.digest(alpha_of(m.base_color_texture));
    uses_uv0 |= m.base_color_uv == 0;
  }
  if (uses_uv0) h.array(local.uv0);
  return h.finish();
}

Digest MeshHasher::alpha_of(int index) {
  const auto [known, is_new] = alpha_.try_emplace(index);
  if (is_new) {
    const Texture& texture = scene_.textures[static_cast<size_t>(index)];
    std::vector<uint8_t> alpha;
    alpha.reserve(texture.rgba.size() / 4);
    for (size_t i = 3; i < texture.rgba.size(); i += 4) alpha.push_back(texture.rgba[i]);
    Hasher h;
    h.value(texture.width).value(texture.height).value(texture.wrap_s).value(texture.wrap_t).array(alpha);
    known->second = h.finish();
  }
  return known->second;
}

}  // namespace lightloom
