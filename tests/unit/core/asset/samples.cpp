#include "tests/unit/core/asset/samples.h"

#include "core/base/check.h"

namespace lightloom::testing {
namespace {

std::vector<Half> halfs(const std::vector<float>& v) {
  std::vector<Half> out;
  out.reserve(v.size());
  for (const float f : v) out.push_back(float_to_half(f));
  return out;
}

const ChunkObject kFirst{digest_of(0x11), 4, 2};
const ChunkObject kSecond{digest_of(0x22), 3, 3};

}  // namespace

Digest digest_of(uint8_t byte) {
  Digest d;
  d.bytes.fill(byte);
  return d;
}

CellChunk sample_cell() {
  CellChunk c;
  c.order = 1;
  c.probe_count = 3;
  c.objects = {kFirst, kSecond};
  c.receivers = {{0, 0}, {0, 15}, {1, 17}, {1, 4}, {0, 7}};
  c.uniform = {0, 65535, 32768, 1, 40000};
  CellChunk::Cluster a;
  a.first_receiver = 0;
  a.receivers = 3;
  a.probes = {0, 2};
  a.correction = {0.5f, -0.25f};
  a.projection = halfs({1,  2,   3,    4,     0, 0, 0, 0, 5,  6,    7, 8,     0, 0, 0, 0,    // k = 0
                        -1, .5f, .25f, .125f, 0, 0, 0, 0, -2, -.5f, 0, 65504, 0, 0, 0, 0});  // k = 1
  a.reconstruction = halfs({.5f, -.5f, .75f, 0, 0, 0, 0, 0, .1f, .2f, .3f, 0, 0, 0, 0, 0});
  a.bounds = {{-1, 0, 2}, {3, 0.5f, 4}};
  a.error = 0.01f;
  CellChunk::Cluster b;
  b.first_receiver = 3;
  b.receivers = 2;
  b.probes = {1};
  b.correction = {2};
  b.projection = halfs({9, 10, 11, 12, 0, 0, 0, 0});
  b.reconstruction = halfs({-1, 1, 0, 0, 0, 0, 0, 0});
  b.bounds = {{5, 5, 5}, {5, 5, 5}};
  b.error = 0;
  c.clusters = {a, b};
  c.near_counts = {2, 0, 0, 1, 0};
  c.near_texels = {15, 16, 33};  // keys 0..15 are the first object's, 16..33 the second's
  c.near_weights = {1000, 65535, 256};
  return c;
}

RelightChunk sample_relight() {
  RelightChunk c;
  c.position = {1.5f, -2, 0.25f};
  c.objects = {kFirst, kSecond};
  // Keys 0..15 are the first object's, 16..33 the second's.
  c.rays = {0, 15, 16, 33, RelightChunk::kDead, RelightChunk::kSky, 7, 7};
  return c;
}

SurfaceChunk sample_surface() {
  SurfaceChunk c;
  c.object = kFirst;
  c.keys = {0, 3, 7, 15};
  c.positions = {{0, 0, 0}, {1, 2, 3}, {-1, -2, -3}, {0.5f, 0.25f, 100}};
  c.normals = {{0, 0, 1}, {1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  c.areas = {0.5f, 0.25f, 1, 2};
  return c;
}

SurfaceChunk other_sample_surface() {
  SurfaceChunk c;
  c.object = kSecond;
  c.keys = {0, 4, 17};
  c.positions = {{5, 5, 5}, {4, 5, 6}, {-4, 0.125f, 6}};
  c.normals = {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}};
  c.areas = {0.75f, 1, 3};
  return c;
}

Manifest sample_manifest() {
  const auto ref = [](const std::vector<uint8_t>& bytes) { return ChunkRef{sha256(bytes), bytes.size()}; };
  const CellChunk cell = sample_cell();
  const RelightChunk relight = sample_relight();
  RelightChunk other = relight;
  other.position.x = 4;

  Manifest m;
  m.method_version = "golden";
  m.scene_hash = digest_of(0x33);
  m.params.order = 1;
  m.params.spacing = 2.5f;
  m.params.near_field = 0.625f;
  m.params.links = 3;
  m.params.rays = 64;
  m.params.relight_rays = 8;
  m.params.max_rank = 4;
  m.params.average = 1.5f;
  m.params.threshold = 0.125f;
  m.params.cell_receivers = 512;
  m.params.texels_per_metre = 4;
  m.params.lightmap_size = 16;
  m.params.seed = 0x0102030405060708;
  m.layout_mode = 1;
  m.width = 16;
  m.height = 8;
  m.bounds = {{-4, -3, -2}, {4, 3, 2}};
  m.objects = {{kFirst.id, "floor", 4, 2, 1, 1, ref(encode_surface(sample_surface()))},
               {kSecond.id, "Wände", 3, 3, 8, 2, ref(encode_surface(other_sample_surface()))}};
  m.probes = {{relight.position, {0, -1, 0}, 0, ref(encode_relight(relight))},
              {other.position, {1, -1, 0}, 5, ref(encode_relight(other))}};
  CellEntry entry;
  entry.level = -1;
  entry.cell = {-3, 2, 7};
  entry.bounds = {{-1, 0, 2}, {5, 5, 5}};
  entry.receivers = 5;
  entry.clusters = 2;
  entry.probes = 3;
  entry.chunk = ref(encode_cell(cell));
  entry.error = 0.0625f;
  entry.unseen = 0.5f;
  m.cells = {entry};
  for (const CellChunk::Cluster& k : cell.clusters) {
    m.clusters.push_back({k.bounds, k.receivers, k.rank(), static_cast<uint32_t>(k.probes.size()), k.error});
  }
  m.cell_probes = {1, 0, 1};
  return m;
}

void write_sample(const std::filesystem::path& loom) {
  const ChunkStore store = chunk_store(loom);
  RelightChunk other = sample_relight();
  other.position.x = 4;
  LL_CHECK(store.put(encode_cell(sample_cell())).ok());
  LL_CHECK(store.put(encode_relight(sample_relight())).ok());
  LL_CHECK(store.put(encode_relight(other)).ok());
  LL_CHECK(store.put(encode_surface(sample_surface())).ok());
  LL_CHECK(store.put(encode_surface(other_sample_surface())).ok());
  LL_CHECK(write_manifest(loom, sample_manifest()).ok());
}

}  // namespace lightloom::testing
