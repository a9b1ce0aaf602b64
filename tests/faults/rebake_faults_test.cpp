// A rebake that is killed, or finds the disk full, wherever that happens: the asset is the old one or the new one, whole,
// and the next bake finishes it. Who finds the disk full says so in one line.
#include <gtest/gtest.h>
#include <unistd.h>

#include <set>

#include "core/asset/asset.h"
#include "core/base/rng.h"
#include "tests/support/program.h"
#include "tests/support/small_disk.h"

namespace lightloom {
namespace {

class RebakeFaults : public test::ProgramTest {
 protected:
  void SetUp() override {
    test::ProgramTest::SetUp();
    loom_ = baked();
    old_manifest_ = test::text_of(loom_ + "/manifest");
    std::filesystem::copy(loom_, path("saved.loom"), std::filesystem::copy_options::recursive);
    Scene scene = *builtin_scene("cornell");
    for (Object& o : scene.objects) {
      if (o.name != "short box") continue;
      for (Vec3& p : o.positions) p.x += 0.3f;
    }
    edited_ = path("edited.glb");
    ASSERT_TRUE(save_gltf(scene, edited_).ok());
    const Result r = rebake({});
    ASSERT_EQ(r.code, 0) << r.err;
    new_manifest_ = test::text_of(loom_ + "/manifest");
    ASSERT_NE(new_manifest_, old_manifest_);
  }
  void restore() {
    std::filesystem::remove_all(loom_);
    std::filesystem::remove_all(loom_ + ".partial");
    std::filesystem::copy(path("saved.loom"), loom_, std::filesystem::copy_options::recursive);
  }
  Result rebake(const std::vector<std::pair<std::string, std::string>>& environment) {
    return finish(start({"bake", edited_, "-o", loom_}, "", [&environment] {
      for (const auto& [name, value] : environment) ::setenv(name.c_str(), value.c_str(), 1);
      ::alarm(60);  // ends one that waits
    }));
  }
  /// `fault` (kill, full) at its change of files number `at`; 0: never.
  Result rebake_with(const std::string& fault, long at) {
    return rebake({{"LD_PRELOAD", LIGHTLOOM_FAULT_AT_A_FILE},
                   {"FILE_FAULT", fault},
                   {"FAULT_AT_FILE_CHANGE", std::to_string(at)},
                   {"COUNTED_FILE_CHANGES", path("count.txt")}});
  }
  /// Of the process that makes most.
  long changes() {
    restore();
    const Result r = rebake_with("kill", 0);
    EXPECT_EQ(r.code, 0) << r.err;
    std::ifstream in(path("count.txt"));
    long most = 0;
    for (long n = 0; in >> n;) most = std::max(most, n);
    EXPECT_EQ(test::text_of(loom_ + "/manifest"), new_manifest_);
    return most;
  }
  /// What a fault left is whole; the next rebake makes the new asset of it. Whether it left the old one.
  bool left_old_and_finishes(const std::string& when) {
    const std::string manifest = test::text_of(loom_ + "/manifest");
    EXPECT_TRUE(manifest == old_manifest_ || manifest == new_manifest_) << when;
    const Result whole = run({"verify", loom_});
    EXPECT_EQ(whole.code, 0) << when << ": " << whole.err;
    const Result again = rebake({});
    EXPECT_EQ(again.code, 0) << when << ": " << again.err;
    EXPECT_EQ(test::text_of(loom_ + "/manifest"), new_manifest_) << when;
    return manifest == old_manifest_;
  }
  void expect_no_room(const Result& r, const std::string& when) const {
    EXPECT_EQ(r.code, 1) << when << ": " << r.err;
    EXPECT_EQ(r.out, "") << when;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << when << ": " << r.err;
    EXPECT_THAT(r.err, testing::AllOf(testing::HasSubstr(loom_), testing::HasSubstr("o space left"),
                                      testing::ContainsRegex("free (some|space)")))
        << when;
  }

  std::string loom_, edited_, old_manifest_, new_manifest_;
};

/// At 24 places spread over a rebake, the first and the last change among them.
TEST_F(RebakeFaults, KilledAnywhere) {
  constexpr int kPlaces = 24;
  const long all = changes();
  ASSERT_GT(all, kPlaces);
  int failed = 0, old = 0;
  for (int p = 0; p < kPlaces; ++p) {
    const long at = 1 + (all - 1) * p / (kPlaces - 1);
    restore();
    failed += rebake_with("kill", at).code != 0;
    old += left_old_and_finishes("killed at " + std::to_string(at));
  }
  EXPECT_GT(failed, kPlaces / 2);
  EXPECT_GT(old, kPlaces / 2);
  std::printf("%ld changes of files; %d of %d rebakes were killed, %d left the old asset\n", all, failed, kPlaces, old);
}

/// One place in each of 12 parts of a rebake, and its first change.
TEST_F(RebakeFaults, FullAnywhere) {
  constexpr int kParts = 12;
  const long all = changes();
  ASSERT_GT(all, kParts);
  Rng rng(1);
  std::set<long> places{1};
  for (int p = 0; p < kParts; ++p) {
    const long first = all * p / kParts, next = all * (p + 1) / kParts;
    places.insert(1 + first + rng.next_below(static_cast<uint32_t>(next - first)));
  }
  int failed = 0, old = 0;
  for (const long at : places) {
    restore();
    const std::string when = "full from change " + std::to_string(at);
    const Result r = rebake_with("full", at);
    if (r.code != 0) expect_no_room(r, when);  // the last changes are made by cleaning up, or not at all
    failed += r.code != 0;
    const bool left_old = left_old_and_finishes(when);
    EXPECT_TRUE(r.code != 0 || !left_old) << when;
    old += left_old;
  }
  EXPECT_GT(failed, kParts / 2);
  EXPECT_GT(old, kParts / 2);
  std::printf("%ld changes of files; full at %zu of them: %d rebakes failed, %d left the old asset\n", all,
              places.size(), failed, old);
}

TEST_F(RebakeFaults, ASmallDiskFull) {
  const test::SmallDisk disk(path("small"), "32m");
  if (!disk.mounted()) GTEST_SKIP() << "this user may not mount a small file system to fill";
  loom_ = path("small/level.loom");
  for (const uint64_t room : {uint64_t{64} << 10, uint64_t{512} << 10, uint64_t{2} << 20}) {
    restore();
    const std::string when = std::to_string(room) + " bytes of room", filler = path("small/filler");
    test::write(filler, std::string(std::filesystem::space(path("small")).available - room, 'x'));
    expect_no_room(rebake({}), when);
    std::filesystem::remove(filler);
    EXPECT_TRUE(left_old_and_finishes(when)) << when;
  }
}

}  // namespace
}  // namespace lightloom
