#include "tests/unit/runtime/synthetic_asset.h"

#include <algorithm>
#include <cstring>

#include "core/base/check.h"
#include "core/base/rng.h"
#include "core/base/sh.h"

namespace lightloom::testing {
namespace {

float between(Rng* rng, float lo, float hi) { return lo + (hi - lo) * rng->next_float(); }
/// In [lo, hi].
uint32_t count(Rng* rng, uint32_t lo, uint32_t hi) { return lo + rng->next_below(hi - lo + 1); }

Digest numbered(uint64_t n) { return Hasher().value(n).finish(); }

struct Texel {
  uint32_t object, key;
};

/// `all` in random order.
void shuffle(std::vector<Texel>* all, Rng* rng) {
  for (size_t i = all->size(); i > 1; --i) {
    std::swap((*all)[i - 1], (*all)[rng->next_below(static_cast<uint32_t>(i))]);
  }
}

std::vector<ChunkObject> chunk_objects(const SyntheticAsset& asset) {
  std::vector<ChunkObject> objects;
  for (const ObjectEntry& o : asset.manifest.objects) {
    objects.push_back({o.id, static_cast<uint32_t>(o.width), static_cast<uint32_t>(o.height)});
  }
  return objects;
}

/// Where each of the objects' texels begin in the numbering of rays and near texels.
std::vector<uint32_t> bases_of(const std::vector<ChunkObject>& objects) {
  std::vector<uint32_t> base(objects.size());
  for (size_t i = 1; i < base.size(); ++i) base[i] = base[i - 1] + 2 * objects[i - 1].width * objects[i - 1].height;
  return base;
}

RelightChunk random_relight(const SyntheticAsset& asset, const std::vector<Texel>& texels,
                            const RandomAssetOptions& options, Rng* rng) {
  RelightChunk chunk;
  chunk.position = {rng->next_float(), rng->next_float(), rng->next_float()};
  chunk.objects = chunk_objects(asset);
  // The chunk's order of objects is its own.
  std::reverse(chunk.objects.begin(), chunk.objects.end());
  const std::vector<uint32_t> base = bases_of(chunk.objects);
  for (int r = 0; r < options.relight_rays; ++r) {
    const uint32_t kind = rng->next_below(10);
    if (!options.closed && kind == 0) {
      chunk.rays.push_back(RelightChunk::kDead);
    } else if (!options.closed && kind == 1) {
      chunk.rays.push_back(RelightChunk::kSky);
    } else {
      const Texel t = texels[rng->next_below(static_cast<uint32_t>(texels.size()))];
      chunk.rays.push_back(base[base.size() - 1 - t.object] + t.key);
    }
  }
  return chunk;
}

CellChunk::Cluster random_cluster(const RandomAssetOptions& options, uint32_t first, uint32_t receivers,
                                  uint32_t cell_probes, const std::vector<double>& u, Rng* rng) {
  const uint32_t J = static_cast<uint32_t>(sh_count(options.order));
  const uint32_t stride = static_cast<uint32_t>(sh_stride(options.order));
  CellChunk::Cluster c;
  c.first_receiver = first;
  c.receivers = receivers;
  c.bounds.extend({0, 0, 0});
  const uint32_t P = count(rng, 1, std::min(cell_probes, options.max_cluster_probes));
  for (uint32_t i = 0; i < P; ++i) c.probes.push_back((i * 5 + first) % cell_probes);
  const uint32_t K = count(rng, 0, options.max_rank);
  const uint32_t padded = (receivers + 7) / 8 * 8;
  float scale = 0.3f;
  for (uint32_t k = 0; k < K; ++k, scale *= 0.8f) {
    // The last columns' halfs are subnormal, as those of small singular values are.
    const float range = k + 1 == K ? 3e-5f : scale / static_cast<float>(P);
    double correction = 0;
    for (uint32_t i = 0; i < P; ++i) {
      for (uint32_t j = 0; j < stride; ++j) {
        const Half h = j < J ? float_to_half(between(rng, -range, range)) : Half{0};
        c.projection.push_back(h);
        if (j < J) correction += static_cast<double>(half_to_float(h)) * u[j];
      }
    }
    c.correction.push_back(static_cast<float>(correction));
    for (uint32_t r = 0; r < padded; ++r) {
      c.reconstruction.push_back(r < receivers ? float_to_half(between(rng, -0.2f, 0.2f)) : Half{0});
    }
  }
  return c;
}

}  // namespace

ChunkRef SyntheticAsset::put(std::vector<uint8_t> bytes) {
  const ChunkRef ref{sha256(bytes), bytes.size()};
  chunks[ref.digest] = std::move(bytes);
  return ref;
}

ChunkObject SyntheticAsset::add_object(uint32_t width, uint32_t height, const std::vector<uint32_t>& keys) {
  const ChunkObject object{numbered(manifest.objects.size()), width, height};
  SurfaceChunk surface;
  surface.object = object;
  surface.keys = keys;
  surface.positions.assign(keys.size(), {0, 0, 0});
  surface.normals.assign(keys.size(), {0, 0, 1});
  surface.areas.assign(keys.size(), 1);
  ObjectEntry entry;
  entry.id = object.id;
  entry.name = "object " + std::to_string(manifest.objects.size());
  entry.width = static_cast<int32_t>(width);
  entry.height = static_cast<int32_t>(height);
  entry.surface = put(encode_surface(surface));
  manifest.objects.push_back(entry);
  manifest.width = std::max(manifest.width, entry.width);
  manifest.height = std::max(manifest.height, entry.height);
  return object;
}

void SyntheticAsset::add_probe(const RelightChunk& chunk) {
  ProbeEntry entry;
  entry.position = chunk.position;
  entry.relight = put(encode_relight(chunk));
  manifest.probes.push_back(entry);
}

void SyntheticAsset::add_cell(const CellChunk& chunk, const std::vector<uint32_t>& probes) {
  CellEntry entry;
  entry.bounds = {{0, 0, 0}, {1, 1, 1}};
  entry.receivers = static_cast<uint32_t>(chunk.receivers.size());
  entry.first_cluster = static_cast<uint32_t>(manifest.clusters.size());
  entry.clusters = static_cast<uint32_t>(chunk.clusters.size());
  entry.first_probe = static_cast<uint32_t>(manifest.cell_probes.size());
  entry.probes = static_cast<uint32_t>(probes.size());
  entry.chunk = put(encode_cell(chunk));
  manifest.cells.push_back(entry);
  manifest.cell_probes.insert(manifest.cell_probes.end(), probes.begin(), probes.end());
  for (const CellChunk::Cluster& c : chunk.clusters) {
    manifest.clusters.push_back({c.bounds, c.receivers, c.rank(), static_cast<uint32_t>(c.probes.size()), c.error});
  }
}

void SyntheticAsset::lay_out_in_a_row(int32_t height) {
  manifest.width = 0;
  for (ObjectEntry& o : manifest.objects) {
    o.x = manifest.width;
    manifest.width += o.width;
  }
  manifest.height = height;
}

absl::StatusOr<AssetSource> SyntheticAsset::open() const {
  const std::vector<uint8_t> bytes = encode_manifest(manifest);
  return AssetSource::open(bytes, [this](const ChunkRef& ref, std::span<uint8_t> out) -> absl::Status {
    const auto it = chunks.find(ref.digest);
    if (it == chunks.end() || it->second.size() != out.size()) return absl::AbortedError("no such chunk");
    std::copy(it->second.begin(), it->second.end(), out.begin());
    return absl::OkStatus();
  });
}

int SyntheticAsset::read_chunk(void* user, const uint8_t digest[32], uint64_t size, void* out) {
  const auto* asset = static_cast<const SyntheticAsset*>(user);
  Digest key;
  std::memcpy(key.bytes.data(), digest, 32);
  const auto it = asset->chunks.find(key);
  if (it == asset->chunks.end() || it->second.size() != size) return 1;
  std::memcpy(out, it->second.data(), size);
  return 0;
}

SyntheticAsset empty_asset(int order, int relight_rays) {
  SyntheticAsset asset;
  asset.manifest.method_version = "test";
  asset.manifest.params.order = order;
  asset.manifest.params.relight_rays = relight_rays;
  asset.manifest.params.spacing = 1;
  asset.manifest.params.near_field = 0.5f;
  asset.manifest.bounds = {{0, 0, 0}, {1, 1, 1}};
  return asset;
}

SyntheticAsset random_asset(const RandomAssetOptions& options) {
  Rng rng(options.seed);
  SyntheticAsset asset = empty_asset(options.order, options.relight_rays);

  std::vector<Texel> texels;
  for (uint32_t o = 0; o < options.objects; ++o) {
    const uint32_t w = count(&rng, options.side / 2, options.side), h = count(&rng, options.side / 2, options.side);
    std::vector<uint32_t> keys;
    for (uint32_t key = 0; key < 2 * w * h; ++key) {
      if (rng.next_below(4) != 0) keys.push_back(key);
    }
    asset.add_object(w, h, keys);
    for (const uint32_t key : keys) texels.push_back({o, key});
  }
  for (uint32_t p = 0; p < options.probes; ++p) asset.add_probe(random_relight(asset, texels, options, &rng));

  // Surface elements without receiver: the last tenth.
  shuffle(&texels, &rng);
  if (!options.closed) texels.resize(texels.size() * 9 / 10);
  const std::vector<double> u = uniform_coefficients(options.order, options.relight_rays);
  size_t next = 0;
  for (uint32_t i = 0; i < options.cells; ++i) {
    const size_t end = texels.size() * (i + 1) / options.cells;
    CellChunk cell;
    cell.order = static_cast<uint32_t>(options.order);
    cell.objects = chunk_objects(asset);
    const std::vector<uint32_t> base = bases_of(cell.objects);
    std::vector<uint32_t> probes;
    for (uint32_t p = rng.next_below(3); p < options.probes; p += 1 + rng.next_below(3)) probes.push_back(p);
    cell.probe_count = static_cast<uint32_t>(probes.size());
    for (; next < end; ++next) {
      cell.receivers.push_back({texels[next].object, texels[next].key});
      uint16_t near = 0;  // a tenth of the light
      cell.near_counts.push_back(static_cast<uint16_t>(rng.next_below(4)));
      for (int n = 0; n < cell.near_counts.back(); ++n) {
        const Texel t = texels[rng.next_below(static_cast<uint32_t>(texels.size()))];
        cell.near_texels.push_back(base[t.object] + t.key);
        cell.near_weights.push_back(static_cast<uint16_t>(rng.next_below(4000)));
        near = static_cast<uint16_t>(near + cell.near_weights.back());
      }
      cell.uniform.push_back(
          static_cast<uint16_t>(options.closed ? 65535 - near : 40000 + rng.next_below(25536 - 12000)));
    }
    const uint32_t receivers = static_cast<uint32_t>(cell.receivers.size());
    const uint32_t clusters = std::min(receivers, count(&rng, 1, options.max_clusters));
    for (uint32_t c = 0; c < clusters; ++c) {
      const uint32_t first = receivers * c / clusters, last = receivers * (c + 1) / clusters;
      cell.clusters.push_back(random_cluster(options, first, last - first, cell.probe_count, u, &rng));
    }
    asset.add_cell(cell, probes);
  }
  return asset;
}

SurfaceLight random_light(uint32_t surface_elements, uint64_t seed) {
  Rng rng(seed);
  const auto rgb = [&rng](float hi) { return Vec3{between(&rng, 0, hi), between(&rng, 0, hi), between(&rng, 0, hi)}; };
  SurfaceLight light;
  for (uint32_t s = 0; s < surface_elements; ++s) {
    // Few elements are lit, as by a spot light, and fewer shine.
    light.direct.push_back(s % 7 == 0 ? rgb(20) : Vec3{});
    light.albedo.push_back(rgb(0.8f));
    light.emission.push_back(s % 31 == 0 ? rgb(5) : Vec3{});
  }
  light.environment = {0.3f, 0.5f, 0.9f};
  return light;
}

std::vector<double> uniform_coefficients(int order, int rays) {
  std::vector<double> u(static_cast<size_t>(sh_count(order)));
  std::vector<float> y(u.size());
  for (int r = 0; r < rays; ++r) {
    sh_evaluate(order, sphere_direction(static_cast<uint32_t>(r), static_cast<uint32_t>(rays)), y);
    for (size_t j = 0; j < u.size(); ++j) u[j] += 4 * 3.14159265358979323846 / rays * static_cast<double>(y[j]);
  }
  return u;
}

}  // namespace lightloom::testing
