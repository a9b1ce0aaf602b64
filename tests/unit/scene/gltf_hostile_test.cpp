// Files that are broken or mean harm end in one-line errors that name the file.
#include <gmock/gmock.h>

#include <fstream>
#include <functional>

#include "tests/unit/scene/gltf_fixture.h"

namespace lightloom {
namespace {

using testing::HasSubstr;

struct Case {
  const char* name;
  const char* expected;  ///< part of the error
  std::function<void(TestGltf&)> spoil;
};

std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

class Hostile : public testing::TestWithParam<Case> {};

TEST_P(Hostile, IsRefused) {
  TestGltf g;
  GetParam().spoil(g);
  const auto scene = g.load();
  ASSERT_FALSE(scene.ok());
  const std::string message(scene.status().message());
  EXPECT_THAT(message, HasSubstr(GetParam().expected));
  EXPECT_THAT(message, HasSubstr("level.gltf"));
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
}

nlohmann::json& accessor(TestGltf& g, size_t i) { return g.json["accessors"][i]; }
void use_image(TestGltf& g, nlohmann::json image) {
  g.json["images"] = nlohmann::json::array({image});
  g.json["textures"] = {{{"source", 0}}};
  g.json["materials"] = {{{"name", "paint"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
}
void use_light(TestGltf& g, nlohmann::json light) {
  g.json["extensions"]["KHR_lights_punctual"]["lights"] = nlohmann::json::array({light});
  g.json["nodes"][0]["extensions"]["KHR_lights_punctual"]["light"] = 0;
}
void set_extras(TestGltf& g, nlohmann::json extras) { g.json["nodes"][0]["extras"]["lightloom"] = extras; }
void set_buffer(TestGltf& g, const char* uri) { g.json["buffers"] = {{{"uri", uri}, {"byteLength", g.bin.size()}}}; }

const Case kCases[] = {
    {"NoVersion", "asset", [](TestGltf& g) { g.json.erase("asset"); }},
    {"NoTriangles", "contains no triangles", [](TestGltf& g) { g.json["nodes"][0].erase("mesh"); }},
    {"EmptyScene", "contains no triangles",
     [](TestGltf& g) { g.json["scenes"][0]["nodes"] = nlohmann::json::array(); }},
    {"SceneMissing", "default scene 7", [](TestGltf& g) { g.json["scene"] = 7; }},
    {"NodeMissing", "node 9 does not exist", [](TestGltf& g) { g.json["scenes"][0]["nodes"] = {9}; }},
    {"MeshMissing", "mesh 5", [](TestGltf& g) { g.json["nodes"][0]["mesh"] = 5; }},
    {"Cycle", "reached twice", [](TestGltf& g) { g.json["nodes"][0]["children"] = {0}; }},
    {"TwoParents", "reached twice",
     [](TestGltf& g) {
       g.json["scenes"][0]["nodes"] = {0, 1, 2};
       g.json["nodes"].push_back({{"children", {3}}});
       g.json["nodes"].push_back({{"children", {3}}});
       g.json["nodes"].push_back(nlohmann::json::object());
     }},
    {"BadMatrix", "transform has the wrong number",
     [](TestGltf& g) {
       g.json["nodes"][0]["matrix"] = {1, 0, 0};
     }},
    {"ZeroQuaternion", "unit quaternion",
     [](TestGltf& g) {
       g.json["nodes"][0]["rotation"] = {0, 0, 0, 0};
     }},
    {"HugeTransform", "not finite",
     [](TestGltf& g) {
       g.json["nodes"][0]["translation"] = {1e300, 0, 0};
     }},
    {"BillionElements", "more than the limit", [](TestGltf& g) { accessor(g, 0)["count"] = 1000000000; }},
    {"BillionZeros", "more than the limit",
     [](TestGltf& g) {
       accessor(g, 0)["count"] = 1000000000;
       accessor(g, 0).erase("bufferView");
     }},
    {"NegativeCount", "", [](TestGltf& g) { accessor(g, 0)["count"] = -3; }},
    {"TooManyElements", "reach past the end of buffer view 0", [](TestGltf& g) { accessor(g, 0)["count"] = 1000; }},
    {"AccessorOffset", "reach past", [](TestGltf& g) { accessor(g, 0)["byteOffset"] = 8; }},
    {"AccessorOffsetHuge", "byte offset", [](TestGltf& g) { accessor(g, 0)["byteOffset"] = 0x7fffffffffffffff; }},
    {"ViewTooLong", "past the end of buffer 0", [](TestGltf& g) { g.json["bufferViews"][0]["byteLength"] = 100000; }},
    {"ViewOffset", "past the end of buffer 0",
     [](TestGltf& g) { g.json["bufferViews"][0]["byteOffset"] = 0x7ffffffffffffff0; }},
    {"ViewBuffer", "buffer 3, which does not exist", [](TestGltf& g) { g.json["bufferViews"][0]["buffer"] = 3; }},
    {"ViewMissing", "buffer view 77 does not exist", [](TestGltf& g) { accessor(g, 0)["bufferView"] = 77; }},
    {"Stride", "stride", [](TestGltf& g) { g.json["bufferViews"][0]["byteStride"] = 4; }},
    {"AccessorMissing", "accessor 66 does not exist",
     [](TestGltf& g) { g.primitive()["attributes"]["POSITION"] = 66; }},
    {"PositionType", "not a VEC3", [](TestGltf& g) { accessor(g, 0)["type"] = "VEC2"; }},
    {"ComponentType", "not a VEC3 of numbers", [](TestGltf& g) { accessor(g, 0)["componentType"] = 5127; }},
    {"NormalCount", "NORMAL has 2 elements", [](TestGltf& g) { accessor(g, 1)["count"] = 2; }},
    {"IndexRange", "index 3 is out of range",
     [](TestGltf& g) {
       g.primitive()["indices"] = g.accessor(std::vector<uint16_t>{0, 1, 3}, "SCALAR", 5123);
     }},
    {"IndexFloat", "cannot hold indices",
     [](TestGltf& g) {
       g.primitive()["indices"] = g.accessor(std::vector<float>{0, 1, 2}, "SCALAR", 5126);
     }},
    {"IndexCount", "not a multiple of 3", [](TestGltf& g) { accessor(g, 2)["count"] = 2; }},
    {"IndexMissing", "out of bounds", [](TestGltf& g) { g.primitive()["indices"] = 50; }},
    {"SparseIndex", "sparse index 200 is out of range",
     [](TestGltf& g) {
       const int i = g.view(std::vector<uint8_t>{200}), v = g.view(std::vector<float>{1, 2, 3});
       accessor(g, 0)["sparse"] = {
           {"count", 1}, {"indices", {{"bufferView", i}, {"componentType", 5121}}}, {"values", {{"bufferView", v}}}};
     }},
    {"SparseCount", "sparse",
     [](TestGltf& g) {
       accessor(g, 0)["sparse"] = {{"count", 2000000000},
                                   {"indices", {{"bufferView", 0}, {"componentType", 5125}}},
                                   {"values", {{"bufferView", 0}}}};
     }},
    {"SparseOffset", "sparse indices",
     [](TestGltf& g) {
       accessor(g, 0)["sparse"] = {{"count", 1},
                                   {"indices", {{"bufferView", 0}, {"byteOffset", -8}, {"componentType", 5125}}},
                                   {"values", {{"bufferView", 0}}}};
     }},
    {"BufferMissing", "missing.bin", [](TestGltf& g) { set_buffer(g, "missing.bin"); }},
    {"BufferShort", "",
     [](TestGltf& g) {
       g.json["buffers"] = {{{"uri", "data.bin"}, {"byteLength", g.bin.size() + 4}}};
     }},
    {"BufferNoUri", "has no uri",
     [](TestGltf& g) {
       g.json["buffers"] = {{{"byteLength", 8}}};
     }},
    {"UriClimbs", "not in the file's folder", [](TestGltf& g) { set_buffer(g, "../data.bin"); }},
    {"UriClimbsEncoded", "not in the file's folder", [](TestGltf& g) { set_buffer(g, "%2e%2e/data.bin"); }},
    {"UriClimbsInside", "not in the file's folder", [](TestGltf& g) { set_buffer(g, "a/../../data.bin"); }},
    {"UriAbsolute", "not in the file's folder", [](TestGltf& g) { set_buffer(g, "/etc/passwd"); }},
    {"UriScheme", "not in the file's folder", [](TestGltf& g) { set_buffer(g, "file:///etc/passwd"); }},
    {"UriHttp", "not in the file's folder", [](TestGltf& g) { set_buffer(g, "https://example.com/a.bin"); }},
    {"ImageClimbs", "not in the file's folder",
     [](TestGltf& g) {
       use_image(g, {{"uri", "../../x.png"}});
     }},
    {"ImageMissing", "\"x.png\" is missing",
     [](TestGltf& g) {
       use_image(g, {{"uri", "x.png"}});
     }},
    {"ImageNotPng", "neither PNG nor JPEG",
     [](TestGltf& g) {
       use_image(g, {{"bufferView", 0}, {"mimeType", "image/png"}});
     }},
    {"ImageViewOutside", "past the end of buffer 0",
     [](TestGltf& g) {
       g.json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 1 << 30}, {"byteLength", 100}});
       use_image(g, {{"bufferView", g.json["bufferViews"].size() - 1}, {"mimeType", "image/png"}});
     }},
    {"ImageBroken", "image is broken",
     [](TestGltf& g) {
       const int view =
           g.view(std::vector<uint8_t>{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n', 0, 0, 0, 13, 'I', 'H'});
       use_image(g, {{"bufferView", view}, {"mimeType", "image/png"}});
     }},
    {"ImageHuge", "too large",
     [](TestGltf& g) {
       const int view =
           g.view(std::vector<uint8_t>{0x89, 'P',  'N', 'G', '\r', '\n', 0x1a, '\n', 0, 0, 0, 13, 'I', 'H', 'D', 'R', 0,
                                       0,    0x80, 0,   0,   0,    0x10, 0,    8,    6, 0, 0, 0,  0,   0,   0,   0});
       use_image(g, {{"bufferView", view}, {"mimeType", "image/png"}});
     }},
    {"TextureMissing", "texture 4, which does not exist",
     [](TestGltf& g) {
       use_image(g, {{"bufferView", 0}, {"mimeType", "image/png"}});
       g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 4;
     }},
    {"TexCoord", "TEXCOORD_5",
     [](TestGltf& g) {
       use_image(g, {{"bufferView", 0}, {"mimeType", "image/png"}});
       g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 5;
     }},
    {"MaterialMissing", "material 3, which does not exist", [](TestGltf& g) { g.primitive()["material"] = 3; }},
    {"NegativeEmission", "emission",
     [](TestGltf& g) {
       g.json["materials"] = {{{"emissiveFactor", {-1, 0, 0}}}};
     }},
    {"AlphaMode", "alphaMode \"SOME\"",
     [](TestGltf& g) {
       g.json["materials"] = {{{"alphaMode", "SOME"}}};
     }},
    {"LightType", "light type \"disco\"",
     [](TestGltf& g) {
       use_light(g, {{"type", "disco"}});
     }},
    {"LightNegative", "not negative",
     [](TestGltf& g) {
       use_light(g, {{"type", "point"}, {"intensity", -4}});
     }},
    {"LightInfinite", "finite",
     [](TestGltf& g) {
       use_light(g, {{"type", "point"}, {"intensity", 1e300}});
     }},
    {"LightCone", "cone angles",
     [](TestGltf& g) {
       use_light(g, {{"type", "spot"}, {"spot", {{"innerConeAngle", 1}, {"outerConeAngle", 0.5}}}});
     }},
    {"LightMissing", "light that does not exist",
     [](TestGltf& g) { g.json["nodes"][0]["extensions"]["KHR_lights_punctual"]["light"] = 2; }},
    {"CameraMissing", "camera 2", [](TestGltf& g) { g.json["nodes"][0]["camera"] = 2; }},
    {"CameraFov", "yfov",
     [](TestGltf& g) {
       g.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 4.0}, {"znear", 0.1}}}}};
       g.json["nodes"][0]["camera"] = 0;
     }},
    {"ExtrasStatic", "static must be true or false",
     [](TestGltf& g) {
       set_extras(g, {{"static", "no"}});
     }},
    {"ExtrasScale", "texel_scale must be a number above 0",
     [](TestGltf& g) {
       set_extras(g, {{"texel_scale", 0}});
     }},
    {"ExtrasReceive", "receive must be",
     [](TestGltf& g) {
       set_extras(g, {{"receive", "light"}});
     }},
    {"ExtrasType", "must be an object", [](TestGltf& g) { set_extras(g, 3); }},
    {"RequiredExtension", "KHR_draco_mesh_compression",
     [](TestGltf& g) { g.json["extensionsRequired"] = {"KHR_draco_mesh_compression"}; }},
    {"DeepJson", "nested deeper",
     [](TestGltf& g) {
       nlohmann::json deep = 1;
       for (int i = 0; i < 200; ++i) deep = nlohmann::json::array({deep});
       g.json["extras"] = deep;
     }},
};

INSTANTIATE_TEST_SUITE_P(Gltf, Hostile, testing::ValuesIn(kCases), [](const auto& info) { return info.param.name; });

std::string load_bytes(const std::vector<uint8_t>& bytes) {
  const auto path = test_folder() / "level.glb";
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  const auto scene = load_gltf(path);
  return scene.ok() ? "" : std::string(scene.status().message());
}

TEST(HostileBytes, EmptyMissingAndFolder) {
  EXPECT_THAT(load_bytes({}), HasSubstr("is empty"));
  EXPECT_THAT(load_bytes({'h', 'e', 'l', 'l', 'o'}), HasSubstr("not readable as glTF"));
  const auto folder = test_folder();
  EXPECT_THAT(std::string(load_gltf(folder).status().message()), HasSubstr("not a regular file"));
  EXPECT_EQ(load_gltf(folder / "none.glb").status().code(), absl::StatusCode::kNotFound);
}

TEST(HostileBytes, EveryTruncationOfAGlbIsRefused) {
  TestGltf g;
  const auto scene = g.load();
  ASSERT_TRUE(scene.ok());
  const auto path = test_folder() / "whole.glb";
  ASSERT_TRUE(save_gltf(*scene, path).ok());
  const auto whole = read_file(path);
  ASSERT_TRUE(whole.ok());
  for (size_t size = 0; size < whole->size(); ++size) {
    EXPECT_NE(load_bytes({whole->begin(), whole->begin() + static_cast<std::ptrdiff_t>(size)}), "") << size;
    if (size < 8) continue;
    // The same with a length that agrees: the chunks themselves run past the end.
    std::vector<uint8_t> cut(whole->begin(), whole->begin() + static_cast<std::ptrdiff_t>(size));
    for (size_t i = 8; i < 12 && i < size; ++i) cut[i] = static_cast<uint8_t>(size >> (8 * (i - 8)));
    EXPECT_NE(load_bytes(cut), "") << size;
  }
}

TEST(HostileBytes, FlippedBytesNeverCrash) {
  TestGltf g;
  const auto scene = g.load();
  ASSERT_TRUE(scene.ok());
  const auto path = test_folder() / "whole.glb";
  ASSERT_TRUE(save_gltf(*scene, path).ok());
  auto bytes = read_file(path);
  ASSERT_TRUE(bytes.ok());
  for (size_t i = 0; i < bytes->size(); ++i) {
    for (const uint8_t flip : {0x01, 0x80, 0x10}) {
      (*bytes)[i] ^= flip;
      const std::string message = load_bytes(*bytes);
      EXPECT_EQ(message.find('\n'), std::string::npos) << message;
      (*bytes)[i] ^= flip;
    }
  }
}

}  // namespace
}  // namespace lightloom
