#include "core/scene/gltf.h"

#include <gmock/gmock.h>

#include "tests/unit/scene/gltf_fixture.h"

namespace lightloom {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

#define LOAD(name, gltf)                             \
  const auto name##_or = (gltf).load();              \
  ASSERT_TRUE(name##_or.ok()) << name##_or.status(); \
  const Scene& name = *name##_or

void expect_near(Vec3 a, Vec3 b, float tolerance = 1e-6f) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

TEST(GltfLoad, OneTriangle) {
  TestGltf g;
  LOAD(scene, g);
  ASSERT_EQ(scene.objects.size(), 1u);
  const Object& o = scene.objects[0];
  EXPECT_EQ(o.name, "tri");
  EXPECT_THAT(o.positions, ElementsAre(Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{0, 1, 0}));
  EXPECT_THAT(o.normals, ElementsAre(Vec3{0, 0, 1}, Vec3{0, 0, 1}, Vec3{0, 0, 1}));
  ASSERT_EQ(o.triangles.size(), 1u);
  ASSERT_EQ(scene.materials.size(), 1u);
  EXPECT_EQ(scene.materials[0].name, "default");
  EXPECT_TRUE(scene.warnings.empty());
  EXPECT_NE(o.id, Digest{});
}

TEST(GltfLoad, GlbAndGltfAgree) {
  TestGltf g;
  LOAD(scene, g);
  const auto path = test_folder() / "level.glb";
  ASSERT_TRUE(save_gltf(scene, path).ok());
  const auto again = load_gltf(path);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->objects[0].id, scene.objects[0].id);
}

TEST(GltfLoad, NodesComposeInDouble) {
  TestGltf g;
  g.json["nodes"] = {
      {{"children", {1}}, {"translation", {1e6, 0, 0}}, {"scale", {2, 2, 2}}},
      {{"mesh", 0}, {"translation", {-5e5, 1, 0}}, {"rotation", {0, 0, 0.7071067811865476, 0.7071067811865476}}}};
  LOAD(scene, g);
  const Object& o = scene.objects[0];
  EXPECT_EQ(o.name, "node 1");
  expect_near(o.positions[0], {0, 2, 0});  // 2 · -5e5 + 1e6 is exact in double only if composed there
  expect_near(o.positions[1], {0, 4, 0});  // +x turned to +y, twice as long
  expect_near(o.positions[2], {-2, 2, 0});
}

TEST(GltfLoad, NormalsTurnWithTheInverseTranspose) {
  TestGltf g;
  const float h = 0.70710678f;
  g.primitive()["attributes"]["NORMAL"] = g.accessor(std::vector<float>{h, 0, h, h, 0, h, h, 0, h}, "VEC3", 5126);
  g.json["nodes"][0]["scale"] = {2, 1, 1};
  LOAD(scene, g);
  expect_near(scene.objects[0].normals[0], {0.4472136f, 0, 0.8944272f});  // (1/2, 0, 1) normalised
}

TEST(GltfLoad, MirrorsKeepFrontSides) {
  TestGltf g;
  g.json["nodes"][0]["scale"] = {-1, 1, 1};
  LOAD(scene, g);
  const Object& o = scene.objects[0];
  const auto& v = o.triangles[0].v;
  const Vec3 n = cross(o.positions[v[1]] - o.positions[v[0]], o.positions[v[2]] - o.positions[v[0]]);
  EXPECT_GT(n.z, 0);
  expect_near(o.normals[0], {0, 0, 1});
}

TEST(GltfLoad, MissingNormalsBecomeFlat) {
  TestGltf g;
  const std::vector<float> tent{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  g.primitive()["attributes"] = {{"POSITION", g.accessor(tent, "VEC3", 5126)}};
  g.primitive()["indices"] = g.accessor(std::vector<uint8_t>{0, 1, 2, 0, 3, 1}, "SCALAR", 5121);
  LOAD(scene, g);
  const Object& o = scene.objects[0];
  ASSERT_EQ(o.positions.size(), 6u);  // split: no corner is shared
  expect_near(o.normals[o.triangles[0].v[0]], {0, 0, 1});
  expect_near(o.normals[o.triangles[1].v[0]], {0, 1, 0});
  EXPECT_THAT(scene.warnings, ElementsAre(HasSubstr("no normals")));
}

TEST(GltfLoad, StripsFansAndUnindexed) {
  const std::vector<float> quad{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
  for (const int mode : {5, 6}) {
    TestGltf g;
    const std::vector<float> corners = mode == 5 ? quad : std::vector<float>{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    g.primitive() = {{"attributes", {{"POSITION", g.accessor(corners, "VEC3", 5126)}}}, {"mode", mode}};
    LOAD(scene, g);
    ASSERT_EQ(scene.triangle_count(), 2u) << mode;
    for (const Vec3 n : scene.objects[0].normals) expect_near(n, {0, 0, 1});
  }
}

TEST(GltfLoad, PointsAreSkippedWithAWarning) {
  TestGltf g;
  auto points = g.primitive();
  points["mode"] = 0;
  g.json["meshes"][0]["primitives"].push_back(points);
  LOAD(scene, g);
  EXPECT_EQ(scene.triangle_count(), 1u);
  EXPECT_THAT(scene.warnings, ElementsAre(HasSubstr("points or lines")));
}

TEST(GltfLoad, NormalisedAndStridedAccessors) {
  TestGltf g;
  // Shorts, normalised, 4 apart with a padding short.
  const int view = g.view(std::vector<int16_t>{0, 0, 0, 99, 32767, 0, 0, 99, 0, -32768, 0, 99});
  g.json["bufferViews"][static_cast<size_t>(view)]["byteStride"] = 8;
  g.json["accessors"].push_back(
      {{"bufferView", view}, {"componentType", 5122}, {"type", "VEC3"}, {"count", 3}, {"normalized", true}});
  g.primitive()["attributes"]["POSITION"] = g.json["accessors"].size() - 1;
  g.primitive()["attributes"]["TEXCOORD_1"] =
      g.accessor(std::vector<uint8_t>{0, 255, 0, 0, 51, 102}, "VEC2", 5121, true);
  LOAD(scene, g);
  EXPECT_THAT(scene.objects[0].positions, ElementsAre(Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{0, -1, 0}));
  EXPECT_THAT(scene.objects[0].uv1, ElementsAre(Vec2{0, 1}, Vec2{0, 0}, Vec2{0.2f, 0.4f}));
}

TEST(GltfLoad, SparseOverNothing) {
  TestGltf g;
  const int indices = g.view(std::vector<uint8_t>{1, 2}), values = g.view(std::vector<float>{3, 0, 0, 0, 4, 0});
  g.json["accessors"].push_back({{"componentType", 5126},
                                 {"type", "VEC3"},
                                 {"count", 3},
                                 {"sparse",
                                  {{"count", 2},
                                   {"indices", {{"bufferView", indices}, {"componentType", 5121}}},
                                   {"values", {{"bufferView", values}}}}}});
  g.primitive()["attributes"]["POSITION"] = g.json["accessors"].size() - 1;
  LOAD(scene, g);
  EXPECT_THAT(scene.objects[0].positions, ElementsAre(Vec3{0, 0, 0}, Vec3{3, 0, 0}, Vec3{0, 4, 0}));
}

TEST(GltfLoad, DefectiveTrianglesAreLeftOut) {
  TestGltf g;
  // A good triangle, one whose corners lie on a line, and a vertex that is not a number and not used.
  const float nan = std::numeric_limits<float>::quiet_NaN();
  g.primitive()["attributes"] = {
      {"POSITION", g.accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0, nan, 0, 0, 2, 0, 0}, "VEC3", 5126)}};
  g.primitive()["indices"] = g.accessor(std::vector<uint32_t>{0, 1, 2, 0, 1, 4}, "SCALAR", 5125);
  LOAD(scene, g);
  EXPECT_EQ(scene.triangle_count(), 1u);
  EXPECT_EQ(scene.bounds().hi, (Vec3{1, 1, 0}));
  EXPECT_THAT(scene.warnings,
              ElementsAre(HasSubstr("no normals"), HasSubstr("1 triangles without area were left out (in \"tri\")")));
}

TEST(GltfLoad, Materials) {
  TestGltf g;
  g.json["materials"] = {{{"name", "lamp"},
                          {"pbrMetallicRoughness", {{"baseColorFactor", {0.25, 0.5, 0.75, 0.5}}}},
                          {"emissiveFactor", {1, 0.5, 0}},
                          {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}}}},
                          {"alphaMode", "MASK"},
                          {"alphaCutoff", 0.25},
                          {"doubleSided", true}}};
  g.primitive()["material"] = 0;
  LOAD(scene, g);
  ASSERT_EQ(scene.materials.size(), 1u);
  const Material& m = scene.materials[0];
  EXPECT_EQ(m.base_color, (Vec3{0.25f, 0.5f, 0.75f}));
  EXPECT_EQ(m.alpha, 0.5f);
  EXPECT_EQ(m.emission, (Vec3{8, 4, 0}));
  EXPECT_EQ(m.alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(m.alpha_cutoff, 0.25f);
  EXPECT_TRUE(m.double_sided);
}

TEST(GltfLoad, LightsShineAlongTheirNodesMinusZ) {
  TestGltf g;
  g.json["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "spot"},
       {"intensity", 3},
       {"range", 7},
       {"color", {1, 0.5, 0}},
       {"spot", {{"innerConeAngle", 0.1}, {"outerConeAngle", 0.2}}}},
      {{"type", "directional"}, {"name", "sun"}}};
  const double h = 0.7071067811865476;
  g.json["scenes"][0]["nodes"] = {0, 1, 2};
  // Turned by 90° around x, -z becomes +y; by -90° around y, -z becomes +x.
  g.json["nodes"].push_back({{"name", "spot"},
                             {"rotation", {h, 0, 0, h}},
                             {"translation", {1, 2, 3}},
                             {"scale", {2, 2, 2}},
                             {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  g.json["nodes"].push_back({{"rotation", {0, -h, 0, h}}, {"extensions", {{"KHR_lights_punctual", {{"light", 1}}}}}});
  LOAD(scene, g);
  ASSERT_EQ(scene.lights.size(), 2u);
  const Light& spot = scene.lights[0];
  EXPECT_EQ(spot.type, LightType::kSpot);
  EXPECT_EQ(spot.position, (Vec3{1, 2, 3}));
  expect_near(spot.direction, {0, 1, 0});
  EXPECT_EQ(spot.color, (Vec3{1, 0.5f, 0}));
  EXPECT_EQ(spot.intensity, 3);
  EXPECT_EQ(spot.range, 7);
  EXPECT_EQ(spot.inner_cone_angle, 0.1f);
  EXPECT_EQ(spot.outer_cone_angle, 0.2f);
  EXPECT_EQ(scene.lights[1].name, "sun");
  expect_near(scene.lights[1].direction, {1, 0, 0});
}

TEST(GltfLoad, Cameras) {
  TestGltf g;
  g.json["cameras"] = {
      {{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"aspectRatio", 1.5}, {"znear", 0.1}}}}};
  g.json["scenes"][0]["nodes"] = {0, 1};
  g.json["nodes"].push_back({{"name", "eye"}, {"camera", 0}, {"rotation", {0, 1, 0, 0}}, {"translation", {4, 5, 6}}});
  LOAD(scene, g);
  ASSERT_EQ(scene.cameras.size(), 1u);
  const Camera& c = scene.cameras[0];
  EXPECT_EQ(c.position, (Vec3{4, 5, 6}));
  expect_near(c.forward, {0, 0, 1});
  expect_near(c.right, {-1, 0, 0});
  expect_near(c.up, {0, 1, 0});
  EXPECT_EQ(c.yfov, 0.7f);
  EXPECT_EQ(c.aspect, 1.5f);
}

TEST(GltfLoad, Extras) {
  TestGltf g;
  g.json["nodes"][0]["extras"]["lightloom"] = {{"static", false}, {"texel_scale", 2}, {"receive", "volume"}};
  LOAD(scene, g);
  EXPECT_FALSE(scene.objects[0].is_static);
  EXPECT_EQ(scene.objects[0].texel_scale, 2);
  EXPECT_EQ(scene.objects[0].receive, Receive::kVolume);
}

TEST(GltfLoad, NamesAreUnique) {
  TestGltf g;
  g.json["scenes"][0]["nodes"] = {0, 1, 2, 3};
  for (const char* name : {"tri", "tri #2", ""}) g.json["nodes"].push_back({{"mesh", 0}, {"name", name}});
  LOAD(scene, g);
  std::vector<std::string> names;
  for (const Object& o : scene.objects) names.push_back(o.name);
  EXPECT_THAT(names, ElementsAre("tri", "tri #2", "tri #2 #2", "node 3"));
}

TEST(GltfLoad, UriBesideAndBelowAreRead) {
  TestGltf g;
  g.json["buffers"] = {{{"uri", "./data.bin"}, {"byteLength", g.bin.size()}}};
  LOAD(scene, g);
  EXPECT_EQ(scene.triangle_count(), 1u);
}

TEST(GltfLoad, UnreferencedImagesDoNotMatter) {
  TestGltf g;
  g.json["images"] = {{{"uri", "missing.png"}}};
  LOAD(scene, g);
  EXPECT_TRUE(scene.textures.empty());
}

// --- Identity
// ---------------------------------------------------------------------------------------------------------

TEST(GltfIdentity, IgnoresColourButNotShape) {
  TestGltf base, painted, bent, sided;
  painted.json["materials"] = {
      {{"name", "paint"},
       {"pbrMetallicRoughness", {{"baseColorFactor", {0.1, 0.2, 0.3, 1}}, {"roughnessFactor", 0.2}}},
       {"emissiveFactor", {1, 1, 1}}}};
  painted.primitive()["material"] = 0;
  painted.json["nodes"][0]["name"] = "renamed";
  bent.bin[0] = 1;  // the lowest bit of the first coordinate
  sided.json["materials"] = {{{"doubleSided", true}}};
  sided.primitive()["material"] = 0;
  LOAD(a, base);
  LOAD(b, painted);
  LOAD(c, bent);
  LOAD(d, sided);
  EXPECT_EQ(a.objects[0].mesh_hash, b.objects[0].mesh_hash);
  EXPECT_EQ(a.objects[0].id, b.objects[0].id);
  EXPECT_NE(a.objects[0].mesh_hash, c.objects[0].mesh_hash);
  EXPECT_NE(a.objects[0].mesh_hash, d.objects[0].mesh_hash);
}

TEST(GltfIdentity, Uv0CountsOnlyUnderMasks) {
  const auto load_with = [](float u, bool uv1, const char* mode) {
    TestGltf g;
    const char* set = uv1 ? "TEXCOORD_1" : "TEXCOORD_0";
    g.primitive()["attributes"][set] = g.accessor(std::vector<float>{u, 0, 1, 0, 0, 1}, "VEC2", 5126);
    g.json["materials"] = {{{"alphaMode", mode}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
    g.primitive()["material"] = 0;
    // A PNG of one white texel.
    const char* png =
        "data:image/"
        "png;base64,"
        "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGAhKmMIQAAAABJRU5ErkJggg==";
    g.json["images"] = {{{"uri", png}}};
    g.json["textures"] = {{{"source", 0}}};
    const auto scene = g.load();
    EXPECT_TRUE(scene.ok()) << scene.status();
    return scene.ok() ? scene->objects[0].mesh_hash : Digest{};
  };
  EXPECT_EQ(load_with(0, false, "OPAQUE"), load_with(0.5f, false, "OPAQUE"));
  EXPECT_NE(load_with(0, false, "MASK"), load_with(0.5f, false, "MASK"));
  EXPECT_NE(load_with(0, true, "OPAQUE"), load_with(0.5f, true, "OPAQUE"));
}

TEST(GltfIdentity, EqualObjectsGetOrdinals) {
  TestGltf g;
  g.json["scenes"][0]["nodes"] = {0, 1, 2};
  g.json["nodes"].push_back({{"mesh", 0}});
  g.json["nodes"].push_back({{"mesh", 0}, {"translation", {1, 0, 0}}});
  LOAD(scene, g);
  ASSERT_EQ(scene.objects.size(), 3u);
  EXPECT_EQ(scene.objects[0].mesh_hash, scene.objects[2].mesh_hash);
  EXPECT_EQ(scene.objects[0].ordinal, 0u);
  EXPECT_EQ(scene.objects[1].ordinal, 1u);
  EXPECT_EQ(scene.objects[2].ordinal, 0u);
  EXPECT_NE(scene.objects[0].id, scene.objects[1].id);
  EXPECT_NE(scene.objects[0].id, scene.objects[2].id);
}

// --- Textures
// ---------------------------------------------------------------------------------------------------------

TEST(GltfTexture, RoundTripKeepsTexelsAndWrapping) {
  TestGltf g;
  g.primitive()["attributes"]["TEXCOORD_0"] = g.accessor(std::vector<float>{0, 0, 1, 0, 0, 1}, "VEC2", 5126);
  LOAD(loaded, g);
  Scene scene = loaded;
  Texture t;
  t.name = "checks";
  t.width = 3;
  t.height = 2;
  t.wrap_s = Wrap::kClamp;
  t.wrap_t = Wrap::kMirror;
  for (int i = 0; i < 24; ++i) t.rgba.push_back(static_cast<uint8_t>(i * 10));
  scene.textures = {t};
  scene.materials[0].base_color_texture = 0;
  const auto path = test_folder() / "textured.glb";
  ASSERT_TRUE(save_gltf(scene, path).ok());
  const auto again = load_gltf(path);
  ASSERT_TRUE(again.ok()) << again.status();
  ASSERT_EQ(again->textures.size(), 1u);
  EXPECT_EQ(again->textures[0].rgba, t.rgba);
  EXPECT_EQ(again->textures[0].width, 3);
  EXPECT_EQ(again->textures[0].wrap_s, Wrap::kClamp);
  EXPECT_EQ(again->textures[0].wrap_t, Wrap::kMirror);
  EXPECT_EQ(again->materials[0].base_color_texture, 0);
}

}  // namespace
}  // namespace lightloom
