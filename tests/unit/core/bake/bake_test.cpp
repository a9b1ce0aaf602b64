// A bake is a pure function of scene and parameters, and local: what an edit cannot reach keeps its bytes.
#include "core/bake/bake.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <set>
#include <thread>

#include "core/base/file.h"
#include "tests/support/baked_level.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using test::bake_level;
using ::testing::HasSubstr;

BakeParams small() {
  BakeParams p;
  p.order = 3;
  p.spacing = 1.5f;
  p.rays = 36;
  p.relight_rays = 256;
  p.texels_per_metre = 4;
  p.cell_receivers = 256;
  return p;
}

std::vector<uint8_t> manifest_bytes(const test::BakedLevel& level) {
  return test::value_or_die(read_file(level.loom() / "manifest"));
}

/// A room with a crate at the origin and, out of its sight, another room moved along x.
Scene two_rooms(float distance, float crate_shift) {
  Scene scene = test::room_with_crate();
  const Scene other = test::room_with_crate();
  for (Object object : other.objects) {
    const float shift = distance + (object.name == "crate" ? crate_shift : 0);
    for (Vec3& p : object.positions) p.x += shift;
    object.name = "far " + object.name;
    scene.objects.push_back(std::move(object));
  }
  test::identify(&scene);
  return scene;
}

TEST(Bake, SameBytesForAnyThreadCount) {
  const auto one = bake_level(test::room_with_crate(), small(), 1);
  const auto two = bake_level(test::room_with_crate(), small(), 2);
  const auto seven = bake_level(test::room_with_crate(), small(), 7);
  // The manifest names every chunk by its SHA-256.
  EXPECT_EQ(manifest_bytes(*one), manifest_bytes(*two));
  EXPECT_EQ(manifest_bytes(*one), manifest_bytes(*seven));
}

TEST(Bake, SameBytesOnALoadedMachine) {
  const auto quiet = bake_level(test::room_with_crate(), small(), 2);
  std::atomic<bool> stop{false};
  std::vector<std::jthread> load;
  for (unsigned i = 0; i < 2 * std::thread::hardware_concurrency(); ++i) {
    load.emplace_back([&stop] {
      while (!stop) std::this_thread::yield();
    });
  }
  const auto busy = bake_level(test::room_with_crate(), small(), 2);
  stop = true;
  EXPECT_EQ(manifest_bytes(*quiet), manifest_bytes(*busy));
}

TEST(Bake, ObjectOrderChangesNoChunk) {
  Scene scene = test::room_with_crate();
  const auto straight = bake_level(scene, small());
  std::reverse(scene.objects.begin(), scene.objects.end());
  const auto reversed = bake_level(scene, small());
  const auto chunks = [](const Manifest& m) {
    std::set<Digest> all;
    for (const CellEntry& c : m.cells) all.insert(c.chunk.digest);
    for (const ProbeEntry& p : m.probes) all.insert(p.relight.digest);
    for (const ObjectEntry& o : m.objects) all.insert(o.surface.digest);
    return all;
  };
  EXPECT_EQ(chunks(straight->manifest), chunks(reversed->manifest));
}

TEST(Bake, FarEditKeepsEveryChunkItCannotReach) {
  constexpr float kFar = 96;  // beyond ProbeGrid::kReach cells
  const auto before = bake_level(two_rooms(kFar, 0), small());
  const auto after = bake_level(two_rooms(kFar, 0.5f), small());
  using CellKey = std::pair<int32_t, GridCell>;
  std::map<CellKey, Digest> cells;
  for (const CellEntry& c : before->manifest.cells) cells[{c.level, c.cell}] = c.chunk.digest;
  int near = 0, far_changed = 0;
  for (const CellEntry& c : after->manifest.cells) {
    const auto it = cells.find({c.level, c.cell});
    const bool same = it != cells.end() && it->second == c.chunk.digest;
    if (c.bounds.hi.x < kFar / 2) {
      ++near;
      EXPECT_TRUE(same) << "cell " << c.cell[0] << "," << c.cell[1] << "," << c.cell[2];
    } else if (!same) {
      ++far_changed;
    }
  }
  EXPECT_GT(near, 4);
  EXPECT_GT(far_changed, 0) << "the edit must have changed something";

  std::map<std::pair<GridCell, uint32_t>, Digest> probes;
  for (const ProbeEntry& p : before->manifest.probes) probes[{p.cell, p.slot}] = p.relight.digest;
  for (const ProbeEntry& p : after->manifest.probes) {
    if (p.position.x > kFar / 2) continue;
    EXPECT_EQ((probes[{p.cell, p.slot}]), p.relight.digest);
  }
}

TEST(Bake, LightAlbedoAndEmissionAreInNoByte) {
  Scene scene = test::room_with_crate();
  const auto before = bake_level(scene, small());
  scene.lights.clear();
  for (Material& m : scene.materials) {
    m.base_color = {0.1f, 0.2f, 0.9f};
    m.emission = {3, 2, 1};
  }
  scene.environment = {1, 1, 1};
  const auto after = bake_level(scene, small());
  EXPECT_EQ(manifest_bytes(*before), manifest_bytes(*after));
}

TEST(Bake, AssetVerifiesAndCountsAgree) {
  const auto level = bake_level(test::room_with_crate(), small());
  EXPECT_TRUE(verify_asset(level->loom()).ok()) << verify_asset(level->loom());
  uint64_t receivers = 0;
  for (const CellEntry& c : level->manifest.cells) {
    EXPECT_LT(c.receivers, 256u);
    receivers += c.receivers;
  }
  EXPECT_EQ(receivers, level->report.receivers);
  EXPECT_EQ(receivers, level->elements.receivers.all.size());
  EXPECT_EQ(level->manifest.probes.size(), level->report.probes);
  EXPECT_EQ(level->report.unseen, 0u);
}

TEST(Bake, CancelKeepsTheOldManifest) {
  const auto level = bake_level(test::room_with_crate(), small());
  const auto old = manifest_bytes(*level);
  CancelFlag cancel;
  BakeControl control;
  control.cancel = &cancel;
  control.progress = [&](const std::string& stage, uint64_t, uint64_t, uint64_t) {
    if (stage == "cells") cancel.cancel();
  };
  BakeParams other = small();
  other.order = 2;
  const auto result = bake(*level->tracer, other, level->loom(), control);
  EXPECT_EQ(result.status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(manifest_bytes(*level), old);
  EXPECT_TRUE(verify_asset(level->loom()).ok());
}

TEST(Bake, StopsAtTheFirstChunkThatCannotBeWritten) {
  const Scene scene = test::room_with_crate();
  const auto tracer = test::value_or_die(RayTracer::create(scene));
  const test::TemporaryFolder folder;
  ASSERT_TRUE(write_file_atomic(folder.path() / "x.loom" / "chunks", std::string_view("not a folder")).ok());
  BakeControl control;
  control.threads = 1;
  uint64_t first = 0, last = 0;
  bool relight = false;
  control.progress = [&](const std::string& stage, uint64_t, uint64_t, uint64_t rays) {
    if (stage == "cells") first = first == 0 ? rays : first, last = rays;
    relight |= stage == "relight rays";
  };
  const auto result = bake(*tracer, small(), folder.path() / "x.loom", control);
  EXPECT_THAT(std::string(result.status().message()), HasSubstr("chunks"));
  EXPECT_GT(first, 0u);
  EXPECT_EQ(last, first) << "rays were shot after the first cell";
  EXPECT_FALSE(relight);
}

TEST(Bake, RefusesWhatItCannotBake) {
  const auto error = [](Scene scene, BakeParams params) {
    const test::TemporaryFolder folder;
    const auto tracer = test::value_or_die(RayTracer::create(scene));
    const auto result = bake(*tracer, params, folder.path() / "x.loom", {});
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "x.loom" / "manifest"));
    return std::string(result.status().message());
  };
  BakeParams bad = small();
  bad.order = 10;
  EXPECT_THAT(error(test::room_with_crate(), bad), HasSubstr("--order"));
  bad = small();
  bad.spacing = -1;
  EXPECT_THAT(error(test::room_with_crate(), bad), HasSubstr("--spacing"));
  bad = small();
  bad.near_field = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(error(test::room_with_crate(), bad), HasSubstr("--near-field"));
  bad = sl17_params();
  bad.near_field = 1;
  EXPECT_THAT(error(test::room_with_crate(), bad), HasSubstr("sl17"));
  bad = small();
  bad.average = -1;
  EXPECT_THAT(error(test::room_with_crate(), bad), HasSubstr("--average"));
  bad = sl17_params();
  bad.average = 1;
  EXPECT_THAT(error(test::room_with_crate(), bad), HasSubstr("sl17"));
  bad = small();
  bad.rays = 0;
  EXPECT_THAT(error(test::room_with_crate(), bad), HasSubstr("--rays"));
  Scene none = test::room_with_crate();
  for (Object& o : none.objects) o.receive = Receive::kNone;
  EXPECT_THAT(error(none, small()), HasSubstr("lightmap"));
}

TEST(Bake, ElementsOfAnotherSceneAreStale) {
  const auto level = bake_level(test::room_with_crate(), small());
  Scene other = test::room_with_crate();
  other.objects.pop_back();
  test::identify(&other);
  const auto elements = load_surface_elements(level->loom(), level->manifest, other);
  EXPECT_EQ(elements.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(elements.status().message()), HasSubstr("bake again"));
}

}  // namespace
}  // namespace lightloom
