// Small glTF files made in tests.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/file.h"
#include "core/scene/gltf.h"

namespace lightloom {

/// A folder of this test's own, empty.
inline std::filesystem::path test_folder() {
  const auto* info = testing::UnitTest::GetInstance()->current_test_info();
  std::string name = std::string(info->test_suite_name()) + "." + info->name();
  for (char& c : name) {
    if (c == '/') c = '_';
  }
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "lightloom_scene" / name;
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

/// A glTF with one triangle in the plane z = 0, facing +z. Edit `json` and `bin`, then load().
struct TestGltf {
  nlohmann::json json;
  std::vector<uint8_t> bin;

  TestGltf() {
    json["asset"]["version"] = "2.0";
    json["scene"] = 0;
    json["scenes"] = {{{"nodes", {0}}}};
    json["nodes"] = {{{"mesh", 0}, {"name", "tri"}}};
    const int position = accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3", 5126);
    const int normal = accessor(std::vector<float>{0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3", 5126);
    const int indices = accessor(std::vector<uint16_t>{0, 1, 2}, "SCALAR", 5123);
    json["meshes"] = {
        {{"primitives", {{{"attributes", {{"POSITION", position}, {"NORMAL", normal}}}, {"indices", indices}}}}}};
  }

  nlohmann::json& primitive() { return json["meshes"][0]["primitives"][0]; }

  template <class T>
  int view(const std::vector<T>& values) {
    const size_t offset = bin.size(), size = values.size() * sizeof(T);
    bin.resize(offset + (size + 3) / 4 * 4, 0);
    std::memcpy(bin.data() + offset, values.data(), size);
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", offset}, {"byteLength", size}});
    return static_cast<int>(json["bufferViews"].size()) - 1;
  }

  template <class T>
  int accessor(const std::vector<T>& values, const std::string& type, int component, bool normalized = false) {
    const size_t width = type == "SCALAR" ? 1 : static_cast<size_t>(type.back() - '0');
    nlohmann::json a{{"bufferView", view(values)}, {"componentType", component}, {"type", type}};
    a["count"] = values.size() / width;
    if (normalized) a["normalized"] = true;
    json["accessors"].push_back(a);
    return static_cast<int>(json["accessors"].size()) - 1;
  }

  /// level.gltf, its buffer beside it unless `json` says where.
  std::filesystem::path save(const std::filesystem::path& folder) {
    if (!json.contains("buffers")) json["buffers"] = {{{"uri", "data.bin"}, {"byteLength", bin.size()}}};
    EXPECT_TRUE(write_file_atomic(folder / "data.bin", bin).ok());
    EXPECT_TRUE(write_file_atomic(folder / "level.gltf", json.dump()).ok());
    return folder / "level.gltf";
  }
  absl::StatusOr<Scene> load() { return load_gltf(save(test_folder())); }
};

}  // namespace lightloom
