// A flight through the gallery with a part of its asset in memory (docs/results.md, "Streaming").
#include <gtest/gtest.h>
#include <lightloom.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "cli/loom_runtime.h"
#include "core/scene/builtin.h"
#include "tests/support/baked_level.h"
#include "tests/unit/runtime/test_engine.h"

namespace lightloom {
namespace {

using test::value_or_die;

/// The gallery, baked and lit once for all tests.
struct Gallery {
  std::unique_ptr<test::BakedLevel> level;
  SurfaceInputs inputs;
  std::vector<uint8_t> manifest;
  uint64_t asset_bytes = 0;      ///< of all chunks
  std::vector<Vec3> irradiance;  ///< with all of it resident

  SurfaceLight light() const { return {inputs.direct, inputs.albedo, inputs.emission, level->scene->environment}; }
};

const Gallery& gallery() {
  static const Gallery* const it = [] {
    auto* g = new Gallery;
    g->level = test::bake_level(value_or_die(builtin_scene("gallery")), BakeParams{});
    g->inputs = value_or_die(light_surfaces(*g->level->tracer, g->level->elements, 4, {}));
    g->manifest = encode_manifest(g->level->manifest);
    for (const ChunkRef& ref : chunks_of(g->level->manifest)) g->asset_bytes += ref.size;
    g->irradiance = test::light(*g->level, 40, test::Device::kSimd);
    return g;
  }();
  return *it;
}

/// A stream of the gallery that works when it is told to.
class Stream {
 public:
  Stream(lightloom_runtime* runtime, double share) : reader_(gallery().level->loom()) {
    budget_ = static_cast<uint64_t>(share * static_cast<double>(gallery().asset_bytes));
    lightloom_stream_info info{};
    info.struct_size = sizeof info;
    info.flags = LIGHTLOOM_STREAM_NO_THREAD;
    info.read_chunk = LoomReader::read;
    info.read_user = &reader_;
    info.byte_budget = budget_;
    EXPECT_EQ(lightloom_stream_create(runtime, &info, &stream_), LIGHTLOOM_OK);
  }
  ~Stream() { lightloom_stream_destroy(stream_); }
  uint64_t budget() const { return budget_; }

  /// One frame's worth of it.
  void see(Vec3 position, Vec3 velocity, uint64_t bytes) {
    lightloom_stream_view view{};
    view.struct_size = sizeof view;
    std::copy(&position.x, &position.x + 3, view.position);
    std::copy(&velocity.x, &velocity.x + 3, view.velocity);
    ASSERT_EQ(lightloom_stream_set_view(stream_, &view), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_stream_work(stream_, bytes, nullptr), LIGHTLOOM_OK);
    EXPECT_LE(state().bytes, budget_);
  }
  lightloom_stream_state state() const {
    lightloom_stream_state s{};
    s.struct_size = sizeof s;
    EXPECT_EQ(lightloom_stream_get_state(stream_, &s), LIGHTLOOM_OK);
    return s;
  }

 private:
  LoomReader reader_;
  uint64_t budget_ = 0;
  lightloom_stream* stream_ = nullptr;
};

/// The gallery without a device, streamed.
class CpuFlight {
 public:
  explicit CpuFlight(double share) : runtime_(LIGHTLOOM_CREATE_CPU | LIGHTLOOM_CREATE_SMOOTHING) {
    EXPECT_EQ(lightloom_load_manifest(runtime_.get(), gallery().manifest.data(), gallery().manifest.size()),
              LIGHTLOOM_OK);
    runtime_.light(gallery().light());
    runtime_.options(0, 0, 0, 1, 0.1f);
    stream_.emplace(runtime_.get(), share);
  }
  void frame(Vec3 position, Vec3 velocity) {
    stream_->see(position, velocity, 1 << 20);
    ASSERT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  }
  void stay(Vec3 position, int frames) {
    for (int f = 0; f < frames; ++f) frame(position, {});
  }
  std::vector<Vec3> irradiance() { return runtime_.irradiance(); }
  const Stream& stream() const { return *stream_; }

 private:
  testing::TestRuntime runtime_;
  std::optional<Stream> stream_;
};

/// What faces an eye with nothing in between.
struct Visible {
  std::vector<uint32_t> receivers;
  std::vector<double> solid_angle;  ///< of each; sr
};
Visible visible_from(Vec3 eye) {
  const Receivers& receivers = gallery().level->elements.receivers;
  Visible visible;
  for (uint32_t i = 0; i < receivers.all.size(); ++i) {
    const Receiver& r = receivers.all[i];
    const Vec3 to = r.point.position + r.point.normal * 0.01f - eye;
    const float distance = length(to), cosine = -dot(to, r.point.normal) / distance;
    if (cosine <= 0 || gallery().level->tracer->occluded(eye, to * (1 / distance), distance)) continue;
    visible.receivers.push_back(i);
    const float area = receivers.grids[r.object].texels[r.texel].area;
    visible.solid_angle.push_back(static_cast<double>(area * cosine / (distance * distance)));
  }
  return visible;
}

/// Relative, root mean square; `weights` empty: all alike.
double error_at(const std::vector<Vec3>& e, const std::vector<uint32_t>& receivers,
                const std::vector<double>& weights = {}) {
  double difference = 0, sum = 0;
  for (size_t n = 0; n < receivers.size(); ++n) {
    const double weight = weights.empty() ? 1 : weights[n];
    for (int c = 0; c < 3; ++c) {
      const double truth = static_cast<double>(gallery().irradiance[receivers[n]][c]);
      const double off = static_cast<double>(e[receivers[n]][c]) - truth;
      difference += weight * off * off;
      sum += weight * truth * truth;
    }
  }
  return std::sqrt(difference / sum);
}

/// Bytes of the cells that have one of the receivers, and of all their probes, in all detail.
uint64_t bytes_of(const std::vector<uint32_t>& receivers) {
  const Manifest& m = gallery().level->manifest;
  const auto& all = gallery().level->elements.receivers.all;
  std::vector<bool> probes(m.probes.size());
  uint64_t bytes = 0;
  for (const CellEntry& c : m.cells) {
    const auto inside = [&](uint32_t i) {
      for (int a = 0; a < 3; ++a) {
        if (std::floor(static_cast<double>(all[i].point.position[a]) / cell_side(m.params.spacing, c.level)) !=
            static_cast<double>(c.cell[static_cast<size_t>(a)]))
          return false;
      }
      return true;
    };
    if (std::none_of(receivers.begin(), receivers.end(), inside)) continue;
    bytes += c.chunk.size;
    for (uint32_t p = 0; p < c.probes; ++p) probes[m.cell_probes[c.first_probe + p]] = true;
  }
  for (size_t p = 0; p < probes.size(); ++p) bytes += probes[p] ? m.probes[p].relight.size : 0;
  return bytes;
}

/// In each of the gallery's rooms, off its middle.
std::vector<Vec3> rooms() {
  std::vector<Vec3> at;
  for (int z = 0; z < 3; ++z) {
    for (int x = 0; x < 4; ++x) {
      at.push_back({2.1f + 9.25f * static_cast<float>(x), 1.7f, 6.6f + 9.33f * static_cast<float>(z)});
    }
  }
  return at;
}

TEST(Flight, WhereTheVisibleSetFitsItIsLitAsIfAllWereThere) {
  int fit = 0, lit = 0;
  for (const double share : {0.25, 0.5}) {
    CpuFlight flight(share);
    std::printf("budget %.0f %% of %.1f MB\n| at | visible MB | E of visible receivers | as seen | all receivers |\n",
                100 * share, static_cast<double>(gallery().asset_bytes) / 1e6);
    std::vector<uint32_t> all(gallery().irradiance.size());
    std::iota(all.begin(), all.end(), 0);
    for (const Vec3 eye : rooms()) {
      // There at once, as after a cut: until all has arrived, and 30 frames more.
      bool arrived = false;
      for (int frame = 0; frame < 60 && !arrived; ++frame) {
        flight.stay(eye, 1);
        arrived = flight.stream().state().done != 0;
      }
      flight.stay(eye, 30);
      const std::vector<Vec3> e = flight.irradiance();
      const Visible visible = visible_from(eye);
      const double seen = error_at(e, visible.receivers, visible.solid_angle);
      const uint64_t bytes = bytes_of(visible.receivers);
      std::printf("| %.1f, %.1f | %.1f | %.4f | %.4f | %.4f |\n", static_cast<double>(eye.x),
                  static_cast<double>(eye.z), static_cast<double>(bytes) / 1e6, error_at(e, visible.receivers), seen,
                  error_at(e, all));
      EXPECT_TRUE(arrived);
      EXPECT_LT(seen, 0.1);
      // The bases are there too.
      if (static_cast<double>(bytes) + 0.07 * static_cast<double>(gallery().asset_bytes) >
          static_cast<double>(flight.stream().budget()))
        continue;
      ++fit;
      lit += seen <= 0.02;
      EXPECT_LE(seen, 0.045) << eye.x << ' ' << eye.z;
    }
  }
  // One of them has a bright wall in view, two doors and 20 m away, that no probe around the eye sees.
  EXPECT_EQ(fit, 13);
  EXPECT_GE(lit, 11);
}

TEST(Flight, OnTheWayLightIsNeverFarOff) {
  CpuFlight flight(0.25);
  Vec3 eye{1.5f, 1.7f, 14};
  const Vec3 velocity{3, 0, 0};
  flight.stay(eye, 60);
  Visible visible = visible_from(eye);
  std::vector<Vec3> before = flight.irradiance();
  double worst_error = 0, worst_step = 0;
  for (int frame = 0; frame < 640; ++frame) {
    eye = eye + velocity * (1 / 60.0f);
    flight.frame(eye, velocity);
    // What one frame changes.
    const std::vector<Vec3> after = flight.irradiance();
    double step = 0, sum = 0;
    for (size_t n = 0; n < visible.receivers.size(); ++n) {
      const Vec3 d = after[visible.receivers[n]] - before[visible.receivers[n]], e = before[visible.receivers[n]];
      step += visible.solid_angle[n] * static_cast<double>(dot(d, d));
      sum += visible.solid_angle[n] * static_cast<double>(dot(e, e));
    }
    worst_step = std::max(worst_step, std::sqrt(step / sum));
    before = after;
    if (frame % 40 != 39) continue;
    visible = visible_from(eye);
    worst_error = std::max(worst_error, error_at(before, visible.receivers, visible.solid_angle));
  }
  std::printf("on the way: error as seen at most %.4f, a frame changes at most %.4f\n", worst_error, worst_step);
  EXPECT_LT(worst_error, 0.15);
  EXPECT_LT(worst_step, 0.03);
}

/// The hard limits, with a device and under validation: memory and what a frame uploads.
TEST(Flight, BudgetAndUploadsHold) {
  const uint64_t upload_bytes = 256 << 10;
  const double share = 0.25;
  uint64_t hard = 0;
  {
    // What the level takes without any chunk.
    testing::Engine empty(VK_FORMAT_UNDEFINED, 0, [](const auto&, lightloom_vulkan_create_info* info) {
      info->flags = LIGHTLOOM_CREATE_SMOOTHING;
    });
    ASSERT_EQ(lightloom_load_manifest(empty.runtime(), gallery().manifest.data(), gallery().manifest.size()),
              LIGHTLOOM_OK);
    hard = empty.counts().gpu_bytes + static_cast<uint64_t>(share * static_cast<double>(gallery().asset_bytes));
  }
  testing::Engine engine(VK_FORMAT_UNDEFINED, LIGHTLOOM_CREATE_VALIDATION,
                         [&](const auto&, lightloom_vulkan_create_info* info) {
                           info->flags = LIGHTLOOM_CREATE_SMOOTHING;
                           info->byte_budget = hard;
                           info->page_bytes = 1 << 20;
                         });
  ASSERT_EQ(lightloom_load_manifest(engine.runtime(), gallery().manifest.data(), gallery().manifest.size()),
            LIGHTLOOM_OK);
  engine.light(gallery().light());
  lightloom_update_options options{};
  options.struct_size = sizeof options;
  options.upload_bytes = upload_bytes;
  options.max_probes = 16;
  options.max_cells = 16;
  options.fade = 0.2f;
  ASSERT_EQ(lightloom_set_update_options(engine.runtime(), &options), LIGHTLOOM_OK);
  Stream stream(engine.runtime(), share);
  Vec3 eye{1.5f, 1.7f, 14};
  uint64_t most = 0, uploaded = 0;
  for (int frame = 0; frame < 400; ++frame) {
    eye.x += 0.08f;
    stream.see(eye, {4.8f, 0, 0}, 1 << 20);
    engine.frame();
    const lightloom_counts counts = engine.counts();
    ASSERT_LE(counts.gpu_bytes, hard);
    ASSERT_LE(engine.stats().upload_bytes, upload_bytes);
    most = std::max(most, counts.gpu_bytes);
    uploaded += engine.stats().upload_bytes;
  }
  std::printf("device memory at most %.2f of %.2f MB; %.1f MB uploaded in 400 frames\n",
              static_cast<double>(most) / 1e6, static_cast<double>(hard) / 1e6, static_cast<double>(uploaded) / 1e6);
  EXPECT_GT(uploaded, hard / 4);
  EXPECT_EQ(engine.counts().active_cells, gallery().level->manifest.cells.size());
  EXPECT_GT(stream.state().all_cells, 5u);
}

}  // namespace
}  // namespace lightloom
