// What the program does with command lines and files that are wrong: one line on stderr that says what, where and how to
// mend it, the right exit code, and nothing lost.
#include <sys/stat.h>

#include <csignal>
#include <thread>

#include "tests/support/program.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using test::text_of;
using test::write;
using ::testing::HasSubstr;
using ::testing::Not;

class CommandLine : public test::ProgramTest {};

TEST_F(CommandLine, HelpAndVersionSucceed) {
  EXPECT_THAT(run({"--help"}).out, HasSubstr("make-scene"));
  EXPECT_EQ(run({"bake", "--help"}).code, 0);
  EXPECT_EQ(run({"--version"}).code, 0);
}

TEST_F(CommandLine, UsageErrorsNameWhatIsWrong) {
  EXPECT_THAT(fails(2, {"bogus"}, "'bogus'"), HasSubstr("make-scene"));
  fails(2, {}, "--help");
  fails(2, {"bake", scene_}, "--output is required");
  fails(2, {"bake", scene_, "-o", "x.loom", "--foo"}, "--foo");
  EXPECT_THAT(fails(2, {"bake", scene_, "-o", "x.loom", "--rays", "1e3"}, "--rays '1e3'"), HasSubstr("whole number"));
  fails(2, {"bake", scene_, "-o", "x.loom", "--rays", "99999999999"}, "--rays");
  fails(2, {"bake", scene_, "-o", "x.loom", "--rays", "0"}, "--rays must be 1 to");
  fails(2, {"bake", scene_, "-o", "x.loom", "--lightmap-size", "8193"}, "0 to 8192");
  fails(2, {"reference", scene_, "-o", "x.exr", "--lightmap-size", "8193"}, "0 to 8192");
  fails(2, {"bake", scene_, "-o", "x.loom", "--threads", "2000"}, "--threads");
  fails(2, {"bake", scene_, "-o", "x.loom", "--threads", "-1"}, "--threads");
  fails(2, {"bake", scene_, "-o", "x.loom", "--tolerance", "1"}, "--tolerance must be at least 0");
  fails(2, {"bake", scene_, "-o", "x.loom", "--bad\nname"}, "--bad\\nname");
}

TEST_F(CommandLine, NumbersAreDecimalAndFinite) {
  for (const char* value : {"nan", "inf", "-inf", "1e99", "", "1,5"}) {
    fails(2, {"compare", "a.exr", "b.exr", "--scale-b", value}, "--scale-b");
    fails(2, {"render", "a.loom", scene_, "-o", "x.png", "--exposure", value}, "--exposure");
    fails(2, {"bake", scene_, "-o", "x.loom", "--spacing", value}, "--spacing");
    fails(2, {"reference", scene_, "-o", "x.exr", "--texels-per-metre", value}, "--texels-per-metre");
  }
  fails(2, {"bake", scene_, "-o", "x.loom", "--rays", "0x10"}, "--rays");
  const Result r = run(
      {"reference", scene_, "-o", "x.exr", "--samples", "010", "--bounces", "0", "--texels-per-metre", "1", "--json"});
  EXPECT_EQ(r.code, 0) << r.err;
}

TEST_F(CommandLine, SuffixesAreCheckedBeforeAnyWork) {
  // There is no such input either: the name comes first or second, but never after work.
  fails(2, {"reference", scene_, "-o", "x.png"}, ".exr");
  fails(2, {"make-scene", "cornell", "-o", "x.txt"}, ".glb");
  write(path("a.exr"), "");
  fails(2, {"compare", path("a.exr"), path("a.exr"), "--difference", "d.exr"}, ".png");
  fails(2, {"render", baked(), scene_, "--lightmap", "e.png"}, ".exr");
  fails(2, {"inspect", baked(), "--heatmap", "h.exr"}, ".png");
  EXPECT_FALSE(fs::exists(path("x.png")) || fs::exists(path("x.txt")) || fs::exists(path("d.exr")));
}

TEST_F(CommandLine, OutputsNeverReplaceInputs) {
  const std::string before = text_of(scene_), loom = baked(), a = path("a.exr");
  fs::copy_file(scene_, path("level.exr"));
  fails(2, {"reference", path("level.exr"), "-o", path("level.exr")}, "would replace");
  fails(2, {"render", loom, path("level.exr"), "--lightmap", path("./level.exr")}, "would replace");
  fs::create_hard_link(path("level.exr"), path("other.exr"));
  fails(2, {"reference", path("level.exr"), "-o", path("other.exr")}, "would replace");
  EXPECT_EQ(text_of(path("level.exr")), before);
  fails(2, {"render", loom, scene_, "-o", a, "--lightmap", a}, "would replace");
  fails(2, {"bake", scene_, "-o", scene_}, "would replace");
  EXPECT_EQ(text_of(scene_), before);
}

TEST_F(CommandLine, EveryNumberedPictureIsChecked) {
  const std::string loom = baked();
  fs::create_directory(path("F_9998.png"));
  fails(1, {"render", loom, scene_, "-o", path("F.png"), "--frames", "9999", "--light-path", "0,0,0;1,1,1"}, "F_9998");
}

TEST_F(CommandLine, OutputsNeverReplaceWhatALevelLinksTo) {
  write(path("my wall.png"), "pixels");
  write(path("level.gltf"), R"({"asset": {"version": "2.0"}, "images": [{"uri": "my%20wall.png"}]})");
  fails(2, {"render", baked(), path("level.gltf"), "-o", path("my wall.png")}, "would replace");
  EXPECT_EQ(text_of(path("my wall.png")), "pixels");
}

TEST_F(CommandLine, OutputsReplaceRegularFilesOnly) {
  ASSERT_EQ(::mkfifo(path("pipe.glb").c_str(), 0644), 0);
  fs::create_directory(path("folder.glb"));
  fs::create_symlink(scene_, path("link.glb"));
  const std::string before = text_of(scene_);
  for (const char* name : {"pipe.glb", "folder.glb", "link.glb"}) {
    fails(1, {"make-scene", "flat", "-o", path(name)}, name);
  }
  EXPECT_TRUE(fs::is_fifo(path("pipe.glb")));
  EXPECT_EQ(text_of(scene_), before);
}

TEST_F(CommandLine, UnwritableFoldersAreFoundFirst) {
  // It would fail at once for the missing camera: so this is said before the level is looked at.
  fails(1, {"reference", scene_, "--camera", "nobody", "-o", "/proc/nothing/x.exr"}, "/proc");
  write(path("file"), "");
  fails(1, {"bake", scene_, "-o", path("file/x.loom")}, "file");
  fails(1, {"make-scene", "flat", "-o", path("file/x.glb")}, "file");
  EXPECT_EQ(run({"make-scene", "flat", "-o", path("new/folder/x.glb")}).code, 0);
}

TEST_F(CommandLine, BakesGoIntoAFolderOfTheirOwn) {
  fails(2, {"bake", scene_, "-o", ""}, "-o is empty");
  fs::create_directory(path("photos"));
  write(path("photos/cat.png"), "cat");
  fails(1, {"bake", scene_, "-o", path("photos")}, "holds other files");
  write(path("file"), "");
  fails(1, {"bake", scene_, "-o", path("file")}, "is not a folder");
  fs::create_directory_symlink(path("nowhere"), path("dangling"));
  fails(1, {"bake", scene_, "-o", path("dangling")}, "is not a folder");
  const std::string loom = baked();
  EXPECT_EQ(baked(), loom);  // again into the same folder
  fs::create_directory(path("empty"));
  const Result r =
      run({"bake", scene_, "-o", path("empty"), "--texels-per-metre", "1", "--rays", "4", "--relight-rays", "16"});
  EXPECT_EQ(r.code, 0) << r.err;
  fs::remove(path("empty/manifest"));
  fs::create_directory(path("empty/manifest"));
  fails(1, {"bake", scene_, "-o", path("empty")}, "manifest");
  EXPECT_FALSE(fs::exists(path("chunks")) || fs::exists(path("manifest")));
}

TEST_F(CommandLine, InputsThatAreNotThereOrNotWhatTheyShouldBe) {
  EXPECT_THAT(fails(1, {"bake", path("no\nsuch.glb"), "-o", path("x.loom")}, "no\\nsuch.glb"), HasSubstr("check"));
  EXPECT_THAT(fails(1, {"inspect", scene_}, "level.glb"), HasSubstr(".loom folder"));
  EXPECT_THAT(fails(1, {"inspect", path("no.loom")}, "no.loom"), HasSubstr("lightloom bake"));
  fails(1, {"inspect", folder_.path().string()}, "no manifest");
  ASSERT_EQ(::mkfifo(path("pipe.glb").c_str(), 0644), 0);  // which nobody ever opens to write
  fails(1, {"bake", path("pipe.glb"), "-o", path("x.loom")}, "regular file");
  fails(1, {"compare", path("pipe.glb"), path("pipe.glb")}, "regular file");
  fs::create_directory(path("pipe.loom"));
  ASSERT_EQ(::mkfifo(path("pipe.loom/manifest").c_str(), 0644), 0);
  fails(1, {"inspect", path("pipe.loom")}, "regular file");
}

TEST_F(CommandLine, NamesInFilesThatAreUnknown) {
  const std::string loom = baked(), e = path("e.exr");
  EXPECT_THAT(fails(1, {"reference", scene_, "-o", e, "--camera", "nobody"}, "level.glb"), HasSubstr("front"));
  write(path("none.json"), R"({"rigs": []})");
  fails(1, {"reference", scene_, "-o", e, "--lights", path("none.json")}, "none.json has no rigs");
  write(path("rigs.json"), R"({"rigs": [{"name": "a"}, {"name": "b", "emissive": {"neon": [1, 1, 1]}}]})");
  fails(1, {"reference", scene_, "-o", e, "--lights", path("rigs.json"), "--rig", "c"}, "rigs.json");
  fails(1, {"reference", scene_, "-o", e, "--lights", path("rigs.json"), "--rig", "b"}, "rigs.json");
  fails(1, {"reference", scene_, "-o", e, "--lights", path("rigs.json")}, "--rig NAME: a, b");
  fails(2, {"reference", scene_, "-o", e, "--rig", "b"}, "--lights");
  fails(2, {"inspect", loom, "--quantity", "colour"}, "--quantity must be");
  fails(2, {"render", loom, scene_, "-o", "x.png", "--layer", "colour"}, "--layer must be");
  fails(2, {"render", loom, scene_, "-o", "x.png", "--device", "abacus"}, "--device must be");
  fails(1, {"render", loom, scene_, "-o", path("x.png"), "--camera", "nobody"}, "no camera");
}

TEST_F(CommandLine, ANarrowCameraAndALevelWithoutLightmaps) {
  Scene narrow = *builtin_scene("cornell");
  narrow.cameras[0].aspect = 1e-6f;
  ASSERT_TRUE(save_gltf(narrow, path("narrow.glb")).ok());
  fails(1, {"reference", path("narrow.glb"), "-o", path("e.exr"), "--camera", "first"}, "aspectRatio");
  fails(1, {"render", baked(), path("narrow.glb"), "-o", path("x.png"), "--device", "cpu"}, "aspectRatio");
  Scene dark = *builtin_scene("cornell");
  for (Object& o : dark.objects) o.receive = Receive::kNone;
  ASSERT_TRUE(save_gltf(dark, path("dark.glb")).ok());
  fails(1, {"reference", path("dark.glb"), "-o", path("e.exr")}, "dark.glb has no static object");
}

TEST_F(CommandLine, JsonSurvivesNamesThatAreNotUtf8) {
  const Result r = run({"verify", "\xff.loom", "--json"});
  EXPECT_EQ(r.code, 1);
  EXPECT_THAT(r.out, HasSubstr("\"ok\":false"));
}

TEST_F(CommandLine, AFullStandardOutputIsAFailure) {
  if (!fs::is_character_file("/dev/full")) GTEST_SKIP() << "there is no /dev/full here";
  EXPECT_EQ(run({"make-scene", "flat", "-o", path("x.glb")}, "/dev/full").code, 1);
  EXPECT_EQ(run({"--help"}, "/dev/full").code, 1);
}

TEST_F(CommandLine, EqualImagesHaveNoPsnr) {
  const std::string e = path("e.exr");
  ASSERT_EQ(run({"reference", scene_, "-o", e, "--samples", "2", "--texels-per-metre", "1"}).code, 0);
  const Result r = run({"compare", e, e, "--json", "--difference", path("d.png")});
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_THAT(r.out, HasSubstr("\"psnr\":null"));
}

TEST_F(CommandLine, VerifyCountsChunksOfOtherBakes) {
  const std::string loom = baked();
  EXPECT_THAT(run({"verify", loom}).out, Not(HasSubstr("other bakes")));
  const Result again = run({"bake", scene_, "-o", loom, "--texels-per-metre", "2", "--rays", "25", "--relight-rays",
                            "64", "--max-rank", "4"});
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_THAT(run({"verify", loom}).out, HasSubstr("of other bakes"));
  EXPECT_THAT(run({"verify", loom, "--json"}).out, Not(HasSubstr("\"files\":0")));
}

TEST_F(CommandLine, InspectSaysHowManyClustersMissTheThreshold) {
  const std::string loom = baked();
  EXPECT_THAT(run({"inspect", loom}).out, HasSubstr("end above 0.02: --max-rank 4"));
  EXPECT_THAT(run({"inspect", loom}).out, HasSubstr("besides, for rebakes"));
  EXPECT_THAT(run({"inspect", loom, "--json"}).out, HasSubstr("clusters_above_threshold"));
}

TEST_F(CommandLine, TheDecoderHasNoTimesAndSimdHas) {
  const std::string loom = baked();
  const std::vector<std::string> render = {
      "render", loom, scene_, "--bounces", "2", "--lightmap", path("e.exr"), "--direct-samples", "1"};
  auto cpu = render, simd = render;
  cpu.insert(cpu.end(), {"--device", "cpu"});
  simd.insert(simd.end(), {"--device", "simd"});
  const Result on_cpu = run(cpu), on_simd = run(simd);
  EXPECT_EQ(on_cpu.code, 0) << on_cpu.err;
  EXPECT_EQ(on_simd.code, 0) << on_simd.err;
  EXPECT_THAT(on_cpu.out, Not(HasSubstr(" ms")));
  EXPECT_THAT(on_simd.out, HasSubstr(" ms"));
  simd.insert(simd.end(), {"--direct", "shadows"});
  fails(2, simd, "--device vulkan");
}

TEST_F(CommandLine, ABakeThatWasStoppedGoesOn) {
  const std::string loom = path("long.loom");
  const auto bake_to = [&](const std::string& out) -> std::vector<std::string> {
    return {"bake",           scene_, "-o",        out, "--texels-per-metre", "4",   "--rays",    "1024",
            "--relight-rays", "64",   "--threads", "1", "--cell-receivers",   "128", "--spacing", "2"};
  };
  const auto only_folder = [](const fs::path& folder) {
    std::error_code error;
    const auto entries = fs::directory_iterator(folder, error);
    return error || entries == fs::directory_iterator() ? fs::path() : entries->path();
  };
  // Whether the bake has kept `tasks` results; its state has a folder per first byte of each.
  const auto kept = [&](size_t folders) {
    std::error_code error;
    const auto blobs = fs::directory_iterator(only_folder(loom + ".partial") / "blobs", error);
    return !error && static_cast<size_t>(std::distance(fs::begin(blobs), fs::end(blobs))) > folders;
  };
  const auto stop_at = [&](size_t folders, int signal) {
    const pid_t child = start(bake_to(loom));
    siginfo_t ended{};
    while (!kept(folders) && ended.si_pid == 0) {
      EXPECT_EQ(::waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOHANG | WNOWAIT), 0);
      std::this_thread::yield();
    }
    EXPECT_EQ(::kill(child, signal), 0);
    return finish(child);
  };
  const Result r = stop_at(10, SIGINT);
  EXPECT_EQ(r.code, 130) << r.err;
  EXPECT_THAT(r.err, HasSubstr("holds no asset yet, and "));
  EXPECT_THAT(r.err, HasSubstr("bake again to go on"));
  EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  EXPECT_FALSE(fs::exists(fs::path(loom) / "manifest"));
  EXPECT_EQ(stop_at(30, SIGKILL).code, -SIGKILL);

  EXPECT_EQ(run(bake_to(loom)).code, 0);
  EXPECT_FALSE(fs::exists(loom + ".partial"));
  ASSERT_EQ(run(bake_to(path("whole.loom"))).code, 0);
  EXPECT_EQ(text_of(fs::path(loom) / "manifest"), text_of(path("whole.loom/manifest")));
  EXPECT_EQ(run({"verify", loom}).code, 0);
}

TEST_F(CommandLine, ARebakeTakesOverWhatStillHolds) {
  const std::vector<std::string> how = {"--texels-per-metre", "3",  "--rays",     "32", "--relight-rays", "64",
                                        "--cell-receivers",   "64", "--max-rank", "4"};
  const auto bake = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "bake");
    const Result r = run(arguments);
    EXPECT_EQ(r.code, 0) << r.err;
    return r;
  };
  const auto with_how = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), how.begin(), how.end());
    return arguments;
  };
  const std::string loom = path("edited.loom"), whole = path("whole.loom"), edited = path("edited.glb");
  bake(with_how({scene_, "-o", loom}));
  const auto manifest = [](const std::string& folder) { return text_of(fs::path(folder) / "manifest"); };
  const std::string before = manifest(loom);

  // Without parameters: those of the asset, which is up to date. Names are no geometry, but in the manifest.
  EXPECT_THAT(bake({scene_, "-o", loom}).out, HasSubstr("are the earlier bake's"));
  EXPECT_EQ(manifest(loom), before);
  Scene scene = *builtin_scene("cornell");
  scene.objects[0].name = "another name";
  ASSERT_TRUE(save_gltf(scene, edited).ok());
  bake({edited, "-o", loom});
  EXPECT_NE(manifest(loom), before);

  Object& moved = scene.objects.back();
  moved.transform[12] += 0.03;
  for (Vec3& p : moved.positions) p.x += 0.03f;
  ASSERT_TRUE(save_gltf(scene, edited).ok());
  fails(1, {"verify", loom, "--scene", edited}, "stale");
  const std::string still = manifest(loom);
  EXPECT_THAT(bake({edited, "-o", loom, "--dry-run", "--explain"}).out, HasSubstr("of its rays pass where"));
  EXPECT_THAT(bake({edited, "-o", loom, "--dry-run", "--json"}).out, HasSubstr("\"cells_dirty\":"));
  EXPECT_EQ(manifest(loom), still) << "a dry run writes nothing";

  // First what matters, on record; then the rest.
  EXPECT_THAT(bake({edited, "-o", loom, "--tolerance", "0.9"}).out, HasSubstr("of the cells are stale"));
  EXPECT_THAT(bake({edited, "-o", loom, "--tolerance", "0.9"}).out, HasSubstr("of the cells are stale"));
  fails(1, {"verify", loom, "--scene", edited}, "with a tolerance");
  bake({edited, "-o", loom});
  EXPECT_EQ(run({"verify", loom, "--scene", edited}).code, 0);
  bake(with_how({edited, "-o", whole}));
  EXPECT_EQ(manifest(loom), manifest(whole));

  // A manifest that cannot be read says nothing of its parameters.
  test::write(fs::path(loom) / "manifest", "no manifest");
  EXPECT_THAT(bake(with_how({edited, "-o", loom})).err, HasSubstr("baked anew: its manifest cannot be read"));
  EXPECT_EQ(manifest(loom), manifest(whole));

  // An asset that has lost something is baked anew, and whole.
  const auto chunk = [&] {
    for (const auto& file : fs::recursive_directory_iterator(fs::path(whole) / "chunks")) {
      if (file.is_regular_file()) return file.path();
    }
    return fs::path();
  }();
  const std::string bytes = text_of(chunk);
  for (const bool damaged : {false, true}) {
    fs::remove(chunk);
    if (damaged) write(chunk, std::string(bytes.size(), 'x'));
    EXPECT_THAT(bake({edited, "-o", whole}).err, HasSubstr("baked anew: some of its chunks are missing or damaged"));
    EXPECT_EQ(text_of(chunk), bytes);
    EXPECT_EQ(manifest(loom), manifest(whole));
  }
  EXPECT_THAT(bake({edited, "-o", whole, "--fresh", "--rays", "4", "--json"}).out, HasSubstr("\"cells_reused\":0"));
}

TEST_F(CommandLine, WhatIsWrongWithALevelIsOneWarning) {
  Scene scene = *builtin_scene("cornell");
  scene.objects.push_back(scene.objects[0]);
  scene.objects.back().name = "twice";
  const size_t twice = scene.objects[0].triangles.size();
  ASSERT_TRUE(save_gltf(scene, path("twice.glb")).ok());
  const Result r = run({"bake", path("twice.glb"), "-o", path("twice.loom"), "--texels-per-metre", "1", "--rays", "4",
                        "--relight-rays", "16"});
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_THAT(r.err,
              HasSubstr("warning: " + path("twice.glb") + ": " + std::to_string(twice) + " duplicate triangles"));
  EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
}

TEST_F(CommandLine, BakesBySilvennoinenAndLehtinen) {
  const Result r = run({"bake", scene_, "-o", path("a.loom"), "--method", "sl17", "--probes", "12",
                        "--texels-per-metre", "2", "--rays", "16", "--relight-rays", "64", "--json"});
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_THAT(r.out, HasSubstr("\"probes\":12"));
  fails(2, {"bake", scene_, "-o", path("b.loom"), "--method", "best"}, "--method must be default or sl17");
  fails(2, {"bake", scene_, "-o", path("b.loom"), "--probes", "12"}, "--probes goes with --method sl17");
}

}  // namespace
}  // namespace lightloom
