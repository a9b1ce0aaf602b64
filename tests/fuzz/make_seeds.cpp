// make_seeds FOLDER: small valid inputs of each kind, from which the fuzzers start.
#include <cstdio>
#include <filesystem>
#include <string>

#include "core/base/file.h"
#include "core/scene/builtin.h"
#include "core/scene/gltf.h"
#include "core/scene/image.h"
#include "tests/support/test_scenes.h"
#include "tests/unit/core/asset/samples.h"
#include "tests/unit/core/bake/sample_traces.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

/// All there is in one file: textures in data URIs, a sparse and a normalised accessor, lights, a camera, extras.
constexpr char kGltf[] = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1,2]}],
"extensionsUsed":["KHR_lights_punctual","KHR_materials_emissive_strength"],
"extensions":{"KHR_lights_punctual":{"lights":[{"type":"spot","intensity":3,"color":[1,0.5,0.2],"spot":{"innerConeAngle":0.1,"outerConeAngle":0.4}},{"type":"directional"},{"type":"point","range":4}]}},
"nodes":[{"mesh":0,"name":"tri","rotation":[0,0,0.7071068,0.7071068],"scale":[1,2,1],"extras":{"lightloom":{"static":true}}},
{"camera":0,"translation":[0,1,3],"extensions":{"KHR_lights_punctual":{"light":0}}},{"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,1,2,3,1],"children":[3]},{"extensions":{"KHR_lights_punctual":{"light":2}}}],
"cameras":[{"type":"perspective","perspective":{"yfov":0.8,"znear":0.1,"aspectRatio":1.5}}],
"materials":[{"name":"m","doubleSided":true,"alphaMode":"MASK","alphaCutoff":0.3,"emissiveFactor":[0.1,0.2,0.3],
"extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":4}},
"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.6,0.7,1],"baseColorTexture":{"index":0}}}],
"textures":[{"source":0,"sampler":0}],"samplers":[{"wrapS":33071}],
"images":[{"uri":"data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M/wHwAEBgIApD5fRAAAAABJRU5ErkJggg=="}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1,"TEXCOORD_1":1},"material":0}]}],
"buffers":[{"byteLength":68,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAgD8AAAAAAAAAAAAAgD8CAAAAAAAAQAAAAAA="}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24,"byteStride":8},{"buffer":0,"byteOffset":60,"byteLength":1},{"buffer":0,"byteOffset":56,"byteLength":12}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":1,"indices":{"bufferView":2,"componentType":5121},"values":{"bufferView":3}}},
{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}]})";

constexpr char kRigs[] = R"({"units":"W","rigs":[{"name":"night","lights":[
{"type":"point","position":[1,2,3],"color":[1,0.5,0],"intensity":4},
{"type":"spot","position":[0,0,0],"direction":[0,-2,0],"innerConeAngle":0.1,"outerConeAngle":0.3},
{"type":"directional","direction":[0,0,5],"intensity":2}],"emissive":{"lamp":[3,2,1]},"environment":[0.1,0.2,0.3]},{"name":"dark"}]})";

void must(const absl::Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "make_seeds: %s\n", std::string(status.message()).c_str());
  std::exit(1);
}

void put_loom(const fs::path& path, uint8_t kind, std::vector<uint8_t> bytes) {
  bytes.insert(bytes.begin(), kind);
  must(write_file_atomic(path, bytes));
}

int make_seeds(const fs::path& folder) {
  for (const char* kind : {"gltf", "exr", "rig", "loom", "traces"}) fs::create_directories(folder / kind);
  must(write_file_atomic(folder / "gltf" / "all.gltf", std::string_view(kGltf)));
  must(save_gltf(test::facing_plates(1, 2), folder / "gltf" / "plates.glb"));
  must(save_gltf(test::room_with_crate(), folder / "gltf" / "crate.glb"));
  must(save_gltf(*builtin_scene("cornell"), folder / "gltf" / "cornell.glb"));
  must(write_file_atomic(folder / "rig" / "all.json", std::string_view(kRigs)));
  Image image(5, 3, {"R", "G", "B"});
  for (int i = 0; i < 15; ++i) image.set_rgb(i % 5, i / 5, {0.1f * static_cast<float>(i), 1, 2});
  must(write_exr(image, folder / "exr" / "small.exr"));
  put_loom(folder / "loom" / "manifest", 0, encode_manifest(testing::sample_manifest()));
  put_loom(folder / "loom" / "cell", 1, encode_cell(testing::sample_cell()));
  put_loom(folder / "loom" / "relight", 2, encode_relight(testing::sample_relight()));
  put_loom(folder / "loom" / "surface", 3, encode_surface(testing::sample_surface()));
  must(write_file_atomic(folder / "traces" / "small", encode_bake_traces(test::sample_traces())));
  return 0;
}

}  // namespace
}  // namespace lightloom

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: make_seeds FOLDER\n");
    return 2;
  }
  return lightloom::make_seeds(argv[1]);
}
