// A rebake that is killed, wherever that happens: the asset is the old one or the new one, whole, and the next bake
// finishes it.
#include <gtest/gtest.h>

#include "core/asset/asset.h"
#include "tests/support/program.h"

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
    }));
  }
  /// At its change of files number `at`; 0: never.
  Result killed(long at) {
    return rebake({{"LD_PRELOAD", LIGHTLOOM_KILLED_AT_A_FILE},
                   {"KILLED_AT_FILE_CHANGE", std::to_string(at)},
                   {"COUNTED_FILE_CHANGES", path("count.txt")}});
  }
  /// Of the process that makes most.
  long changes() {
    restore();
    const Result r = killed(0);
    EXPECT_EQ(r.code, 0) << r.err;
    std::ifstream in(path("count.txt"));
    long most = 0;
    for (long n = 0; in >> n;) most = std::max(most, n);
    EXPECT_EQ(test::text_of(loom_ + "/manifest"), new_manifest_);
    return most;
  }
  /// At `points` places spread over a rebake, the first and the last change among them.
  void killed_at_each_of(int points) {
    const long all = changes();
    ASSERT_GT(all, points);
    int failed = 0, old = 0;
    for (int p = 0; p < points; ++p) {
      const long at = 1 + (all - 1) * p / (points - 1);
      restore();
      const Result r = killed(at);
      failed += r.code != 0;
      const std::string manifest = test::text_of(loom_ + "/manifest");
      EXPECT_TRUE(manifest == old_manifest_ || manifest == new_manifest_) << "killed at " << at;
      old += manifest == old_manifest_;
      const Result whole = run({"verify", loom_});
      EXPECT_EQ(whole.code, 0) << "killed at " << at << ": " << whole.err;
      const Result again = rebake({});
      EXPECT_EQ(again.code, 0) << "killed at " << at << ": " << again.err;
      EXPECT_EQ(test::text_of(loom_ + "/manifest"), new_manifest_) << "killed at " << at;
    }
    EXPECT_GT(failed, points / 2);
    EXPECT_GT(old, points / 2);
    std::printf("%ld changes of files; %d of %d rebakes were killed, %d left the old asset\n", all, failed, points,
                old);
  }

  std::string loom_, edited_, old_manifest_, new_manifest_;
};

TEST_F(RebakeFaults, KilledAnywhere) { killed_at_each_of(24); }

}  // namespace
}  // namespace lightloom
