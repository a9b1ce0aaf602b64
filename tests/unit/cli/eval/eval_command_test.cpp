// `lightloom eval` and `lightloom bake --error` as users run them.
#include <cstring>
#include <nlohmann/json.hpp>

#include "core/asset/asset.h"
#include "tests/support/program.h"

namespace lightloom {
namespace {

using test::text_of;
using test::write;
using ::testing::HasSubstr;
using ::testing::Not;

class EvalCommand : public test::ProgramTest {
 protected:
  std::vector<std::string> small(const std::string& methods) const {
    return {"eval", scene_,      "-o", path("out"), "--quick", "--methods",      methods, "--texels-per-metre",
            "1",    "--spacing", "3",  "--samples", "16",      "--most-samples", "16",    "--frames",
            "2",    "--json"};
  }
};

TEST_F(EvalCommand, ChartsAndReportsAndGoesOnWhereItWas) {
  const Result first = run(small("default,sh,static"));
  ASSERT_EQ(first.code, 0) << first.err;
  const auto report = nlohmann::json::parse(first.out);
  ASSERT_EQ(report["methods"].size(), 3u);
  const auto& ours = report["methods"]["default"];
  EXPECT_GT(ours["rel_rmse_geomean"], 0.0);
  EXPECT_GT(ours["bytes"]["total"], 1000);
  EXPECT_GT(ours["bytes"]["frame"], 1000);
  EXPECT_GT(ours["frame_ms"], 0.0);
  EXPECT_EQ(report["methods"]["static"]["frame_ms"], 0.0);
  for (const char* file :
       {"report.html", "results.csv", "rigs.csv", "evaluation.json", "error-bytes.svg", "error-seconds.svg",
        "error-core-seconds.svg", "error-frame-ms.svg", "error-frame-bytes.svg"}) {
    EXPECT_GT(text_of(path("out/") + file).size(), 100u) << file;
  }
  EXPECT_THAT(first.err, HasSubstr("1 of "));
  for (const auto& entry : std::filesystem::directory_iterator(path("out"))) {
    EXPECT_FALSE(entry.path().filename().string().starts_with("scratch")) << entry.path();
  }

  // Again: nothing is measured twice, and another method is measured beside.
  const Result again = run(small("default,sh,static"));
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_THAT(again.err, Not(HasSubstr(" of ")));
  EXPECT_EQ(again.out, first.out);
  const Result more = run(small("default,ddgi"));
  ASSERT_EQ(more.code, 0) << more.err;
  EXPECT_THAT(more.err, HasSubstr("ddgi"));
  EXPECT_THAT(more.err, Not(HasSubstr("default, default")));
}

TEST_F(EvalCommand, MeasuresAgainWhatNoLongerHolds) {
  // The level as .gltf with its buffer beside it.
  const std::string glb = text_of(scene_);
  const auto word = [&](size_t at) {
    uint32_t value = 0;
    std::memcpy(&value, glb.data() + at, 4);
    return value;
  };
  const size_t json_bytes = word(12), bin_at = 20 + json_bytes + 8;
  auto gltf = nlohmann::json::parse(glb.substr(20, json_bytes));
  gltf["buffers"][0]["uri"] = "level.bin";
  const std::string bin = glb.substr(bin_at, word(20 + json_bytes));
  gltf["buffers"][0]["byteLength"] = bin.size() + 1;
  write(path("level.gltf"), gltf.dump());
  write(path("level.bin"), bin + "a");

  auto command = small("default,static");
  command[1] = path("level.gltf");
  const auto measured = [&] {
    const Result r = run(command);
    EXPECT_EQ(r.code, 0) << r.err;
    return r.err;
  };
  EXPECT_THAT(measured(), HasSubstr("default, default"));
  EXPECT_THAT(measured(), Not(HasSubstr(" of ")));
  write(path("level.bin"), bin + "b");
  EXPECT_THAT(measured(), ::testing::AllOf(HasSubstr("default, default"), HasSubstr("static, 256")));
  *std::find(command.begin(), command.end(), "2") = "3";  // --frames
  EXPECT_THAT(measured(), ::testing::AllOf(HasSubstr("default, default"), Not(HasSubstr("static, 256"))));
}

TEST_F(EvalCommand, PoolsLevels) {
  ASSERT_EQ(run(small("default,static")).code, 0);
  auto other = small("static,default");
  other[3] = path("out2");
  other.insert(other.end(), {"--name", "another"});
  ASSERT_EQ(run(other).code, 0);
  const Result pooled = run({"eval", "--pool", path("out"), path("out2"), "-o", path("pool"), "--json"});
  ASSERT_EQ(pooled.code, 0) << pooled.err;
  const auto report = nlohmann::json::parse(pooled.out);
  const auto one = nlohmann::json::parse(run(small("default,static")).out);
  EXPECT_EQ(report["level"], "2 levels");
  // The same level twice: the mean is what each has.
  EXPECT_NEAR(report["methods"]["default"]["rel_rmse_geomean"], one["methods"]["default"]["rel_rmse_geomean"], 1e-6);
  EXPECT_EQ(report["methods"]["default"]["bytes"], one["methods"]["default"]["bytes"]);
  EXPECT_THAT(text_of(path("pool/report.html")), HasSubstr("Level by level"));
  for (const char* file : {"results.csv", "levels.csv", "error-bytes.svg"}) {
    EXPECT_GT(text_of(path("pool/") + file).size(), 100u) << file;
  }
  fails(1, {"eval", "--pool", path("out"), path("out"), "-o", path("pool")}, "is there twice");
}

TEST_F(EvalCommand, SaysWhatIsWrongBeforeAnyWork) {
  fails(2, {"eval", scene_}, "--output is required");
  fails(2, {"eval", "-o", path("o")}, "SCENE is required, or --pool");
  fails(2, {"eval", scene_, "--pool", path("p"), "-o", path("o")}, "--pool goes without SCENE");
  fails(1, {"eval", "--pool", path("p"), "-o", path("o")}, "evaluation.json");
  EXPECT_THAT(fails(2, {"eval", scene_, "-o", path("o"), "--methods", "default,best"}, "'best'"), HasSubstr("sl17"));
  fails(2, {"eval", scene_, "-o", path("o"), "--bounces", "0"}, "--bounces must be 1");
  fails(2, {"eval", scene_, "-o", path("o"), "--most-samples", "5"}, "--most-samples");
  fails(1, {"eval", scene_, "-o", path("o"), "--curve", path("none.csv")}, "none.csv");
  fails(1, {"eval", scene_, "-o", path("o"), "--stability", path("none")}, "stability.json");
  write(path("file"), "x");
  fails(1, {"eval", scene_, "-o", path("file")}, "file");
}

class BakeError : public test::ProgramTest {};

TEST_F(BakeError, ChoosesAndRecordsAndKeeps) {
  const std::string loom = path("t.loom");
  const Result first = run({"bake", scene_, "-o", loom, "--error", "0.3", "--texels-per-metre", "2", "--json"});
  ASSERT_EQ(first.code, 0) << first.err;
  const auto tuning = nlohmann::json::parse(first.out)["tuning"];
  EXPECT_TRUE(tuning["met"]);
  EXPECT_LE(tuning["error"]["total"], 0.3);
  const Manifest manifest = test::value_or_die(read_manifest(loom));
  EXPECT_EQ(manifest.params.order, tuning["order"]);
  EXPECT_EQ(manifest.params.rays, tuning["rays"]);
  EXPECT_FLOAT_EQ(manifest.params.spacing, tuning["spacing"]);

  const Result again = run({"bake", scene_, "-o", loom, "--error", "0.1", "--json"});
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_FALSE(nlohmann::json::parse(again.out).contains("tuning"));
  EXPECT_TRUE(test::value_or_die(read_manifest(loom)).params == manifest.params);

  const Result anew = run({"bake", scene_, "-o", loom, "--error", "0.2", "--retune"});
  ASSERT_EQ(anew.code, 0) << anew.err;
  EXPECT_THAT(anew.out, HasSubstr("estimated error"));
  const Manifest retuned = test::value_or_die(read_manifest(loom));
  EXPECT_FALSE(retuned.params == manifest.params);
  EXPECT_EQ(retuned.params.texels_per_metre, manifest.params.texels_per_metre);
}

TEST_F(BakeError, IsLookedForUnlessASettingIsGivenByHand) {
  const Result r = run({"bake", scene_, "-o", path("d.loom"), "--texels-per-metre", "1", "--json"});
  ASSERT_EQ(r.code, 0) << r.err;
  const auto tuning = nlohmann::json::parse(r.out)["tuning"];
  EXPECT_TRUE(tuning["error"]["total"].is_number());
  const BakeParams chosen = test::value_or_die(read_manifest(path("d.loom"))).params;
  EXPECT_EQ(chosen.order, tuning["order"]);
  EXPECT_FLOAT_EQ(chosen.near_field, tuning["near_field"]);

  const Result by_hand =
      run({"bake", scene_, "-o", path("h.loom"), "--texels-per-metre", "1", "--near-field", "0.25", "--json"});
  ASSERT_EQ(by_hand.code, 0) << by_hand.err;
  EXPECT_FALSE(nlohmann::json::parse(by_hand.out).contains("tuning"));
  const BakeParams given = test::value_or_die(read_manifest(path("h.loom"))).params;
  EXPECT_EQ(given.near_field, 0.25f);
  EXPECT_EQ(given.order, BakeParams().order);
}

TEST_F(BakeError, KeepsABudget) {
  const Result r =
      run({"bake", scene_, "-o", path("b.loom"), "--budget", "600KB", "--texels-per-metre", "3", "--json"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_LE(nlohmann::json::parse(r.out)["bytes"]["total"], 600'000);
  fails(1, {"bake", scene_, "-o", path("c.loom"), "--budget", "1KB", "--texels-per-metre", "3"},
        "the least model of this level");
  EXPECT_FALSE(std::filesystem::exists(path("c.loom/manifest")));
}

TEST_F(BakeError, SaysWhatCannotGoTogether) {
  fails(2, {"bake", scene_, "-o", path("o.loom"), "--error", "0"}, "--error must be above 0");
  fails(2, {"bake", scene_, "-o", path("o.loom"), "--near-field", "-1"}, "--near-field must be 0");
  fails(2, {"bake", scene_, "-o", path("o.loom"), "--method", "sl17", "--near-field", "1"}, "sl17 has none");
  fails(2, {"bake", scene_, "-o", path("o.loom"), "--error", "0.1", "--near-field", "1"}, "leave out one of them");
  fails(2, {"bake", scene_, "-o", path("o.loom"), "--error", "0.1", "--budget", "1MB"}, "give one of them");
  fails(2, {"bake", scene_, "-o", path("o.loom"), "--error", "0.1", "--order", "3"}, "leave out one of them");
  fails(2, {"bake", scene_, "-o", path("o.loom"), "--retune", "--spacing", "1"}, "leave out one of them");
  fails(2, {"bake", scene_, "-o", path("o.loom"), "--budget", "1MB", "--method", "sl17"}, "leave out one of them");
}

}  // namespace
}  // namespace lightloom
