// An edit rebakes what it may have reached, and the bytes are those of a whole bake.
#include "core/bake/reuse.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/asset/asset.h"
#include "core/bake/bake.h"
#include "core/scene/builtin.h"
#include "tests/support/baked_level.h"
#include "tests/support/random_edit.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

#ifdef LIGHTLOOM_MANY_EDITS
constexpr uint64_t kSeeds = 20;
constexpr int kSequence = 20;
#else
constexpr uint64_t kSeeds = 4;
constexpr int kSequence = 5;
#endif

BakeParams coarse() {
  BakeParams p;
  p.order = 2;
  p.spacing = 1.2f;
  p.rays = 16;
  p.relight_rays = 64;
  p.texels_per_metre = 3;
  p.cell_receivers = 64;
  return p;
}

/// A square under the sky, with things on it.
Scene yard() {
  Scene scene = test::open_plane(8, {1, 1, 1});
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  test::add_solid_box(&scene, "hut", {-3, 0, -3}, {-1, 2, -1}, grey);
  test::add_solid_box(&scene, "wall", {1, 0, -3}, {1.2f, 1.5f, 3}, grey);
  test::add_solid_box(&scene, "post", {2.5f, 0, 1}, {2.8f, 3, 1.3f}, grey);
  test::identify(&scene);
  return scene;
}

struct Level {
  const char* name;
  Scene (*make)();
};
constexpr Level kLevels[] = {
    {"room_with_crate", [] { return test::room_with_crate(); }},
    {"sealed_rooms", [] { return test::sealed_double_room(0.2f); }},
    {"yard", yard},
    {"cornell", [] { return test::value_or_die(builtin_scene("cornell")); }},
    {"flat", [] { return test::value_or_die(builtin_scene("flat")); }},
};

/// An asset that is rebaked after every edit.
class Edited {
 public:
  explicit Edited(const Level& level) : scene_(level.make()) {
    params_ = coarse();
    if (std::string(level.name) == "flat") params_.texels_per_metre = 1.5f, params_.spacing = 2;
    (void)rebake(nullptr);
    params_ = test::value_or_die(read_manifest(loom())).params;
  }

  void edit_and_compare(Rng* rng) {
    Scene before = scene_;
    const test::Edit edit = test::random_edit(&scene_, rng);
    SCOPED_TRACE(edit.what);
    const Manifest old = test::value_or_die(read_manifest(loom()));
    const BakeTraces earlier = test::value_or_die(decode_bake_traces(test::value_or_die(read_traces(loom(), old))));
    const auto report = rebake(&earlier);
    if (!report.ok()) {  // nothing is left to bake: as a whole bake would say
      scene_ = std::move(before);
      return;
    }
    if (!edit.geometry) {
      EXPECT_EQ(report->cells_reused, report->cells);
      EXPECT_GE(report->probes_reused, report->probes);
    }
    reused_ += report->cells_reused;
    cells_ += report->cells;
    const test::TemporaryFolder whole;
    const auto tracer = test::value_or_die(RayTracer::create(scene_));
    (void)test::value_or_die(bake(*tracer, params_, whole.path() / "whole.loom", {}));
    const Manifest expected = test::value_or_die(read_manifest(whole.path() / "whole.loom"));
    EXPECT_EQ(encode_manifest(test::value_or_die(read_manifest(loom()))), encode_manifest(expected));
    EXPECT_EQ(verify_asset(loom()), absl::OkStatus());
  }

  /// With any tolerance what is kept must fit what is baked anew; a later bake without one finishes it. Returns how many
  /// cells were kept stale.
  uint64_t edit_with_tolerance(double tolerance, Rng* rng) {
    Scene before = scene_;
    const test::Edit edit = test::random_edit(&scene_, rng);
    SCOPED_TRACE(edit.what);
    const auto traces = [&] {
      return test::value_or_die(
          decode_bake_traces(test::value_or_die(read_traces(loom(), test::value_or_die(read_manifest(loom()))))));
    };
    BakeTraces earlier = traces();
    if (!rebake(&earlier, tolerance).ok()) {
      scene_ = std::move(before);
      return 0;
    }
    EXPECT_EQ(verify_asset(loom()), absl::OkStatus());
    const Manifest lenient = test::value_or_die(read_manifest(loom()));
    const auto stale = static_cast<uint64_t>(
        std::count_if(lenient.cells.begin(), lenient.cells.end(), [](const CellEntry& c) { return c.stale > 0; }));
    earlier = traces();
    (void)test::value_or_die(rebake(&earlier));
    const Manifest finished = test::value_or_die(read_manifest(loom()));
    (void)test::value_or_die(rebake(nullptr));
    EXPECT_EQ(encode_manifest(finished), encode_manifest(test::value_or_die(read_manifest(loom()))));
    return stale;
  }

  uint64_t reused() const { return reused_; }
  uint64_t cells() const { return cells_; }

 private:
  std::filesystem::path loom() const { return folder_.path() / "edited.loom"; }
  absl::StatusOr<BakeReport> rebake(const BakeTraces* earlier, double tolerance = 0) const {
    const auto tracer = test::value_or_die(RayTracer::create(scene_));
    return bake(*tracer, params_, loom(), {}, earlier, tolerance);
  }

  test::TemporaryFolder folder_;
  Scene scene_;
  BakeParams params_;
  uint64_t reused_ = 0, cells_ = 0;
};

class Rebake : public ::testing::TestWithParam<Level> {};

TEST_P(Rebake, RandomEditsGiveTheBytesOfAWholeBake) {
  uint64_t reused = 0;
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Edited level(GetParam());
    Rng rng(hash_combine(seed, 0xed17));
    level.edit_and_compare(&rng);
    reused += level.reused();
  }
  EXPECT_GT(reused, 0u) << "an edit that leaves nothing as it was tests nothing";
}

TEST_P(Rebake, ASequenceOfEditsGivesTheBytesOfAWholeBake) {
  Edited level(GetParam());
  Rng rng(0x5e9);
  for (int i = 0; i < kSequence; ++i) {
    SCOPED_TRACE("edit " + std::to_string(i));
    level.edit_and_compare(&rng);
  }
  EXPECT_GT(level.reused(), 0u);
}

TEST_P(Rebake, WhatAToleranceKeepsFits) {
  Edited level(GetParam());
  Rng rng(0x701);
  for (int i = 0; i < kSequence; ++i) {
    SCOPED_TRACE("edit " + std::to_string(i));
    level.edit_with_tolerance(0.5, &rng);
  }
}

TEST(RebakeWithTolerance, KeepsCellsStale) {
  Edited level({"yard", yard});
  Rng rng(0x702);
  uint64_t stale = 0;
  for (int i = 0; i < 4; ++i) stale += level.edit_with_tolerance(0.5, &rng);
  EXPECT_GT(stale, 0u);
}

INSTANTIATE_TEST_SUITE_P(Levels, Rebake, ::testing::ValuesIn(kLevels),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace lightloom
