#include "core/scene/gltf_container.h"

#include <tiny_gltf.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "core/base/file.h"
#include "core/scene/gltf_warnings.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

// Bounds on what a file may make us allocate; far above any level.
constexpr uint64_t kMaxFileBytes = 0xffffffffu;          // sizes in a .glb have 32 bits
constexpr uint64_t kMaxLinkedBytes = uint64_t{8} << 30;  // buffers and images beside the file, together
constexpr size_t kMaxJsonDepth = 64;
constexpr size_t kMaxJsonObjects = 2'000'000;
constexpr size_t kMaxJsonValues = 8'000'000;

constexpr std::array<std::string_view, 4> kKnownExtensions{"KHR_lights_punctual", "KHR_materials_emissive_strength",
                                                           "KHR_mesh_quantization", "KHR_materials_unlit"};

/// The files that a level links to. tinygltf asks for them by callbacks.
struct Folder {
  fs::path path;
  uint64_t bytes_left = kMaxLinkedBytes;
  std::string refused;  ///< the first URI that left the folder
  std::string missing;  ///< the first URI that no file has
};

bool stays_inside(std::string_view uri) {
  if (uri.empty() || uri.front() == '/' || uri.find('\\') != uri.npos || uri.find('\0') != uri.npos) return false;
  if (uri.substr(0, uri.find('/')).find(':') != uri.npos) return false;  // a scheme
  for (const fs::path& part : fs::path(uri)) {
    if (part == "..") return false;
  }
  return true;
}

bool file_exists(const std::string& uri, void* user) {
  auto& folder = *static_cast<Folder*>(user);
  if (!stays_inside(uri)) {
    if (folder.refused.empty()) folder.refused = uri.empty() ? "(empty)" : uri;
    return false;
  }
  std::error_code error;
  const bool there = fs::is_regular_file(folder.path / uri, error);
  if (!there && folder.missing.empty()) folder.missing = uri;
  return there;
}

std::string expand_path(const std::string& uri, void*) { return uri; }

bool read_linked_file(std::vector<unsigned char>* out, std::string* error, const std::string& uri, void* user) {
  auto& folder = *static_cast<Folder*>(user);
  if (!file_exists(uri, user)) return false;
  std::error_code code;
  const uint64_t size = fs::file_size(folder.path / uri, code);
  if (code || size > folder.bytes_left) {
    *error = "the linked files are larger than 8 GiB together";
    return false;
  }
  folder.bytes_left -= size;
  auto data = read_file(folder.path / uri);
  if (!data.ok()) {
    *error = std::string(data.status().message());
    return false;
  }
  *out = std::move(*data);
  return true;
}

/// tinygltf passes images of buffer views without checking their bounds: they are left for later.
bool keep_encoded(tinygltf::Image* image, const int, std::string*, std::string*, int, int, const unsigned char* bytes,
                  int size, void*) {
  image->as_is = true;
  if (image->bufferView < 0 && size > 0) image->image.assign(bytes, bytes + size);
  return true;
}

uint32_t u32_at(const std::vector<uint8_t>& data, size_t offset) {
  uint32_t v = 0;
  std::memcpy(&v, &data[offset], sizeof v);
  return v;
}

/// The JSON text of a .glb, whose chunks are made sure to lie in the file (tinygltf's own check is 8 bytes
/// short).
absl::StatusOr<std::string_view> json_chunk(const std::vector<uint8_t>& data) {
  const auto broken = [](std::string_view what) {
    return absl::InvalidArgumentError("is a broken .glb: " + std::string(what) + "; export it again");
  };
  if (data.size() < 20) return broken("it ends within its header");
  if (u32_at(data, 4) != 2) return broken("it is of version " + std::to_string(u32_at(data, 4)) + ", not 2");
  const uint64_t length = u32_at(data, 8), json_length = u32_at(data, 12);
  if (length > data.size()) {
    return broken("it says it has " + std::to_string(length) + " bytes but has " + std::to_string(data.size()));
  }
  if (u32_at(data, 16) != 0x4e4f534a) return broken("its first chunk is not JSON");
  if (20 + json_length > length) return broken("its JSON chunk runs past the end");
  if (20 + json_length < length) {
    if (28 + json_length > length) return broken("it ends within its second chunk's header");
    if (28 + json_length + u32_at(data, 20 + json_length) > length) return broken("its BIN chunk runs past the end");
  }
  return std::string_view(reinterpret_cast<const char*>(&data[20]), json_length);
}

/// Bounds depth and size of the JSON before anything is built from it.
absl::Status check_json_size(std::string_view json) {
  size_t depth = 0, objects = 0, values = 0;
  bool in_string = false;
  for (size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
      continue;
    }
    if (c == '"') in_string = true;
    if (c == '{') ++objects;
    if (c == '{' || c == '[' || c == ',') ++values;
    if (c == '{' || c == '[') ++depth;
    if ((c == '}' || c == ']') && depth > 0) --depth;
    if (depth > kMaxJsonDepth)
      return absl::InvalidArgumentError("has JSON nested deeper than 64 levels; simplify its extras");
    if (objects > kMaxJsonObjects || values > kMaxJsonValues) {
      return absl::InvalidArgumentError("has more than 8 million JSON values; split the level");
    }
  }
  return absl::OkStatus();
}

absl::Status check_json(const nlohmann::json& root, bool binary) {
  if (!root.is_object()) return absl::InvalidArgumentError("is not glTF: its JSON is not an object");
  if (const auto required = root.find("extensionsRequired"); required != root.end() && required->is_array()) {
    for (const auto& e : *required) {
      const std::string name = e.is_string() ? e.get<std::string>() : "";
      if (std::find(kKnownExtensions.begin(), kKnownExtensions.end(), name) == kKnownExtensions.end()) {
        return absl::InvalidArgumentError("requires the glTF extension " + shown(name) +
                                          ", which is not supported; export without it");
      }
    }
  }
  if (const auto buffers = root.find("buffers"); buffers != root.end() && buffers->is_array()) {
    for (size_t i = 0; i < buffers->size(); ++i) {
      const auto& buffer = (*buffers)[i];
      if (!buffer.is_object() || buffer.contains("uri") || (binary && i == 0)) continue;
      return absl::InvalidArgumentError("buffer " + std::to_string(i) + " has no uri; only a .glb's first may lack it");
    }
  }
  return absl::OkStatus();
}

/// tinygltf's several lines as one.
std::string one_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  std::string out;
  for (const char c : text.substr(0, 500)) {
    if (c == '\n') {
      out += "; ";
    } else {
      out += static_cast<unsigned char>(c) < 32 ? ' ' : c;
    }
  }
  return out;
}

}  // namespace

absl::StatusOr<GltfParts> gltf_parts(const std::vector<uint8_t>& file) {
  const bool binary = file.size() >= 4 && std::memcmp(file.data(), "glTF", 4) == 0;
  GltfParts parts;
  parts.json = {reinterpret_cast<const char*>(file.data()), file.size()};
  if (!binary) return parts;
  LL_ASSIGN_OR_RETURN(parts.json, json_chunk(file));
  const size_t header = 20 + parts.json.size();
  if (header < u32_at(file, 8)) parts.binary = std::span(file).subspan(header + 8, u32_at(file, header));
  return parts;
}

absl::StatusOr<std::vector<uint8_t>> glb_bytes(std::string json, std::span<const uint8_t> binary) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const size_t padded = (binary.size() + 3) / 4 * 4;
  const uint64_t total = 12 + 8 + json.size() + (binary.empty() ? 0 : 8 + padded);
  if (total > 0xffffffffu) return absl::InvalidArgumentError("is larger than the 4 GiB of a .glb; split the level");
  std::vector<uint8_t> out;
  out.reserve(total);
  const auto u32 = [&](uint64_t v) {
    for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<uint8_t>(v >> shift));
  };
  u32(0x46546c67);
  u32(2);
  u32(total);
  u32(json.size());
  u32(0x4e4f534a);
  out.insert(out.end(), json.begin(), json.end());
  if (binary.empty()) return out;
  u32(padded);
  u32(0x004e4942);
  out.insert(out.end(), binary.begin(), binary.end());
  out.resize(total, 0);
  return out;
}

absl::StatusOr<std::unique_ptr<tinygltf::Model>> read_gltf_model(const fs::path& path) {
  std::error_code code;
  if (fs::exists(path, code) && !fs::is_regular_file(path, code)) {
    return absl::InvalidArgumentError("is not a regular file; give a .glb or .gltf");
  }
  if (fs::file_size(path, code) > kMaxFileBytes && !code) {
    return absl::InvalidArgumentError("is larger than 4 GiB; move its buffers into .bin files");
  }
  LL_ASSIGN_OR_RETURN(const std::vector<uint8_t> data, read_file(path));
  if (data.empty()) return absl::InvalidArgumentError("is empty; export it again");

  LL_ASSIGN_OR_RETURN(const GltfParts parts, gltf_parts(data));
  const std::string_view json = parts.json;
  const bool binary = json.data() != reinterpret_cast<const char*>(data.data());
  LL_RETURN_IF_ERROR(check_json_size(json));

  auto model = std::make_unique<tinygltf::Model>();
  Folder folder;
  folder.path = path.parent_path();
  std::string error, warning;
  bool ok = false;
  try {
    LL_RETURN_IF_ERROR(check_json(nlohmann::json::parse(json), binary));
    tinygltf::TinyGLTF reader;
    reader.SetImageLoader(keep_encoded, nullptr);
    reader.SetFsCallbacks({file_exists, expand_path, read_linked_file, nullptr, &folder});
    const auto size = static_cast<unsigned int>(data.size());
    ok = binary ? reader.LoadBinaryFromMemory(model.get(), &error, &warning, data.data(), size, "")
                : reader.LoadASCIIFromString(model.get(), &error, &warning, json.data(), size, "");
  } catch (const std::exception& e) {
    return absl::InvalidArgumentError("is not readable as glTF: " + one_line(e.what()) + "; export it again");
  }
  if (!folder.refused.empty()) {
    return absl::InvalidArgumentError("links to " + shown(folder.refused) +
                                      ", which is not in the file's folder; copy it there and link to it by its name");
  }
  // A missing image may belong to a texture that nothing uses: that is for later.
  if (!ok && !folder.missing.empty() && error.find(folder.missing) != error.npos) {
    return absl::NotFoundError("links to " + shown(folder.missing) + ", which is missing; put it beside the glTF file");
  }
  if (!ok || !error.empty()) {
    return absl::InvalidArgumentError("is not readable as glTF: " + one_line(error) + "; export it again");
  }
  return model;
}

}  // namespace lightloom
