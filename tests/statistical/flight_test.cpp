// A flight through the gallery with a quarter of its asset in memory.
#include <gtest/gtest.h>
#include <lightloom.h>

#include <cmath>
#include <cstdio>

#include "core/scene/builtin.h"
#include "runtime/asset_source.h"
#include "runtime/simd/simd_runtime.h"
#include "runtime/detail.h"
#include "tests/support/baked_level.h"

namespace lightloom {
namespace {

using test::value_or_die;

constexpr float kFrame = 1.0f / 60;  // seconds

/// The gallery, baked and lit once for all tests.
struct Gallery {
  std::unique_ptr<test::BakedLevel> level;
  SurfaceInputs inputs;
  std::vector<uint8_t> manifest;
  uint64_t asset_bytes = 0;  ///< of all chunks
};
const Gallery& gallery() {
  static const Gallery* const it = [] {
    auto* g = new Gallery;
    g->level = test::bake_level(value_or_die(builtin_scene("gallery")), BakeParams{});
    g->inputs = value_or_die(light_surfaces(*g->level->tracer, g->level->elements, 4, {}));
    g->manifest = encode_manifest(g->level->manifest);
    for (const ChunkRef& ref : chunks_of(g->level->manifest)) g->asset_bytes += ref.size;
    return g;
  }();
  return *it;
}

int read_chunk(void* user, const uint8_t digest[32], uint64_t size, void* out) {
  ChunkRef ref;
  std::copy(digest, digest + 32, ref.digest.bytes.begin());
  ref.size = size;
  const auto bytes = static_cast<const ChunkStore*>(user)->get(ref);
  if (!bytes.ok()) return 1;
  std::copy(bytes->begin(), bytes->end(), static_cast<uint8_t*>(out));
  return 0;
}

/// A runtime with the gallery's manifest and light.
class Lit {
 public:
  explicit Lit(uint32_t flags, uint64_t byte_budget = 0, uint64_t page_bytes = 0) : store_(chunk_store(gallery().level->loom())) {
    lightloom_create_info info{};
    info.struct_size = sizeof info;
    info.flags = flags | LIGHTLOOM_CREATE_SMOOTHING;
    info.byte_budget = byte_budget;
    info.page_bytes = page_bytes;
    info.message = [](void* user, lightloom_message_kind, const char* text) {
      static_cast<std::vector<std::string>*>(user)->emplace_back(text);
    };
    info.message_user = &messages_;
    EXPECT_EQ(lightloom_create(&info, &runtime_), LIGHTLOOM_OK);
    EXPECT_EQ(lightloom_load_manifest(runtime_, gallery().manifest.data(), gallery().manifest.size()), LIGHTLOOM_OK);
    const SurfaceInputs& in = gallery().inputs;
    EXPECT_EQ(lightloom_set_direct(runtime_, &in.direct[0].x, 0, in.direct.size()), LIGHTLOOM_OK);
    EXPECT_EQ(lightloom_set_albedo(runtime_, &in.albedo[0].x, 0, in.direct.size()), LIGHTLOOM_OK);
    EXPECT_EQ(lightloom_set_emission(runtime_, &in.emission[0].x, 0, in.direct.size()), LIGHTLOOM_OK);
    EXPECT_EQ(lightloom_set_environment(runtime_, &gallery().level->scene->environment.x), LIGHTLOOM_OK);
  }
  ~Lit() {
    lightloom_stream_destroy(stream_);
    lightloom_destroy(runtime_);
    EXPECT_EQ(messages_, std::vector<std::string>());
  }
  void load_all() {
    lightloom_asset_info info{};
    info.struct_size = sizeof info;
    info.manifest = gallery().manifest.data();
    info.manifest_bytes = gallery().manifest.size();
    info.read_chunk = read_chunk;
    info.read_user = &store_;
    ASSERT_EQ(lightloom_load(runtime_, &info), LIGHTLOOM_OK);
  }
  void stream(uint64_t byte_budget) {
    lightloom_stream_info info{};
    info.struct_size = sizeof info;
    info.flags = LIGHTLOOM_STREAM_NO_THREAD;
    info.read_chunk = read_chunk;
    info.read_user = &store_;
    info.byte_budget = byte_budget;
    ASSERT_EQ(lightloom_stream_create(runtime_, &info, &stream_), LIGHTLOOM_OK);
  }
  void see(Vec3 position, Vec3 velocity) {
    lightloom_stream_view view{};
    view.struct_size = sizeof view;
    std::copy(&position.x, &position.x + 3, view.position);
    std::copy(&velocity.x, &velocity.x + 3, view.velocity);
    ASSERT_EQ(lightloom_stream_set_view(stream_, &view), LIGHTLOOM_OK);
  }
  void work(uint64_t bytes) { ASSERT_EQ(lightloom_stream_work(stream_, bytes, nullptr), LIGHTLOOM_OK); }
  void frames(uint32_t n) { ASSERT_EQ(lightloom_update(runtime_, n), LIGHTLOOM_OK); }
  std::vector<Vec3> irradiance() {
    std::vector<Vec3> e(gallery().inputs.direct.size());
    EXPECT_EQ(lightloom_read_irradiance(runtime_, &e[0].x, e.size()), LIGHTLOOM_OK);
    return e;
  }
  lightloom_stream_state state() const {
    lightloom_stream_state s{};
    s.struct_size = sizeof s;
    EXPECT_EQ(lightloom_stream_get_state(stream_, &s), LIGHTLOOM_OK);
    return s;
  }
  std::vector<uint8_t> levels() const {
    std::vector<uint8_t> levels(gallery().level->manifest.cells.size());
    EXPECT_EQ(lightloom_stream_get_levels(stream_, levels.data(), static_cast<uint32_t>(levels.size())), LIGHTLOOM_OK);
    return levels;
  }
  lightloom_counts counts() const {
    lightloom_counts c{};
    c.struct_size = sizeof c;
    EXPECT_EQ(lightloom_get_counts(runtime_, &c), LIGHTLOOM_OK);
    return c;
  }
  lightloom_runtime* get() const { return runtime_; }

 private:
  ChunkStore store_;
  std::vector<std::string> messages_;
  lightloom_runtime* runtime_ = nullptr;
  lightloom_stream* stream_ = nullptr;
};

/// Receivers that face the eye with nothing in between.
std::vector<uint32_t> visible_from(Vec3 eye) {
  const auto& all = gallery().level->elements.receivers.all;
  std::vector<uint32_t> visible;
  for (uint32_t i = 0; i < all.size(); ++i) {
    const Vec3 at = all[i].point.position + all[i].point.normal * 0.01f;
    const Vec3 to = at - eye;
    const float distance = length(to);
    if (dot(to, all[i].point.normal) >= 0) continue;
    if (!gallery().level->tracer->occluded(eye, to * (1 / distance), distance)) visible.push_back(i);
  }
  return visible;
}

double rel_rmse(const std::vector<Vec3>& a, const std::vector<Vec3>& b, const std::vector<uint32_t>& at) {
  double difference = 0, sum = 0;
  for (const uint32_t i : at) {
    for (int c = 0; c < 3; ++c) {
      const double x = static_cast<double>(a[i][c]), y = static_cast<double>(b[i][c]);
      difference += (x - y) * (x - y);
      sum += y * y;
    }
  }
  return std::sqrt(difference / sum);
}

TEST(Flight, Experiment) {
  const Gallery& g = gallery();
  Lit whole(LIGHTLOOM_CREATE_CPU);
  whole.load_all();
  // load() starts anew
  const SurfaceInputs& in = g.inputs;
  lightloom_set_direct(whole.get(), &in.direct[0].x, 0, in.direct.size());
  lightloom_set_albedo(whole.get(), &in.albedo[0].x, 0, in.direct.size());
  lightloom_set_emission(whole.get(), &in.emission[0].x, 0, in.direct.size());
  lightloom_set_environment(whole.get(), &g.level->scene->environment.x);
  whole.frames(40);
  const std::vector<Vec3> truth = whole.irradiance();
  std::vector<uint32_t> every(truth.size());
  for (uint32_t i = 0; i < every.size(); ++i) every[i] = i;

  const char* share = std::getenv("SHARE");
  const uint64_t budget = static_cast<uint64_t>(static_cast<double>(g.asset_bytes) * (share ? atof(share) : 0.25));
  std::printf("asset %.1f MB budget %.1f MB\n", g.asset_bytes / 1e6, budget / 1e6);
  {
    Lit part(LIGHTLOOM_CREATE_CPU);
    part.stream(UINT64_MAX);
    part.see({18, 1.7f, 14}, {});
    part.work(UINT64_MAX);
    part.frames(40);
    std::printf("all streamed: %.5f bytes %.1f MB\n", rel_rmse(part.irradiance(), truth, every), part.state().bytes / 1e6);
    Lit base(LIGHTLOOM_CREATE_CPU);
    base.stream(1);
    base.see({18, 1.7f, 14}, {});
    base.work(UINT64_MAX);
    base.frames(40);
    std::printf("bases: %.5f bytes %.2f MB done %u\n", rel_rmse(base.irradiance(), truth, every), base.state().bytes / 1e6, base.state().done);
  }
  Lit part(LIGHTLOOM_CREATE_CPU);
  lightloom_update_options o{};
  o.struct_size = sizeof o;
  o.fade = 0.2f;
  lightloom_set_update_options(part.get(), &o);
  part.stream(budget);
  Vec3 eye{1.5f, 1.7f, 14};
  const Vec3 v{3, 0, 0};
  for (int stop = 0; stop < 5; ++stop) {
    for (int frame = 0; frame < 160; ++frame) {
      eye = eye + v * kFrame;
      part.see(eye, v);
      part.work(1 << 20);
      part.frames(1);
    }
    const auto moving = part.irradiance();
    for (int frame = 0; frame < 30; ++frame) {
      part.see(eye, {});
      part.work(1 << 20);
      part.frames(1);
    }
    const auto e = part.irradiance();
    const auto visible = visible_from(eye);
    const auto levels = part.levels();
    static std::vector<uint32_t> cell_of;
    if (cell_of.empty()) {
      cell_of.assign(truth.size(), 0);
      const ChunkStore store = chunk_store(g.level->loom());
      auto source = *AssetSource::open(g.manifest, [&](const ChunkRef& ref, std::span<uint8_t> out) -> absl::Status {
        auto bytes = *store.get(ref);
        std::copy(bytes.begin(), bytes.end(), out.begin());
        return absl::OkStatus();
      });
      for (uint32_t c = 0; c < levels.size(); ++c) {
        SourceCell cell = *source.cell(c);
        for (uint32_t el : cell.elements) cell_of[el] = c;
      }
    }
    std::vector<int> seen(levels.size());
    std::vector<std::vector<uint32_t>> by(4);
    for (uint32_t i : visible) { ++seen[cell_of[i]]; by[levels[cell_of[i]]].push_back(i); }
    uint64_t need = 0; int n = 0;
    std::vector<bool> probes(g.level->manifest.probes.size());
    for (uint32_t c = 0; c < levels.size(); ++c) {
      if (!seen[c]) continue;
      ++n;
      const auto& cell = g.level->manifest.cells[c];
      need += cell.chunk.size;
      for (uint32_t k = 0; k < cell.probes; ++k) probes[g.level->manifest.cell_probes[cell.first_probe + k]] = true;
    }
    std::printf("  visible cells %d: %.1f MB, probes %ld: %.1f MB;", n, need / 1e6, std::count(probes.begin(), probes.end(), true), std::count(probes.begin(), probes.end(), true) * 0.0164);
    for (int l = 1; l < 4; ++l) std::printf(" level %d: %zu receivers %.4f;", l, by[l].size(), rel_rmse(e, truth, by[l]));
    double m1 = 0, m2 = 0; for (uint32_t i : every) { m1 += (double)e[i].x; m2 += (double)truth[i].x; }
    std::printf(" energy %.4f\n", m1 / m2);
    const auto s = part.state();
    std::printf("x %.1f: visible %zu, moving %.4f, there %.4f, all %.4f; cells %u/%u/%u probes %u/%u bytes %.2f drops %llu read %.1f MB done %u\n", eye.x,
                visible.size(), rel_rmse(moving, truth, visible), rel_rmse(e, truth, visible), rel_rmse(e, truth, every),
                s.base_cells, s.some_cells, s.all_cells, s.base_probes, s.all_probes, s.bytes / 1e6,
                (unsigned long long)s.drops, s.read_bytes / 1e6, s.done);
  }
}

#include "/tmp/m/exp.cpp"
}  // namespace
}  // namespace lightloom
