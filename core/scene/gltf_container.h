// A glTF file read into tinygltf's model, after the checks that tinygltf leaves out.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/status.h"

namespace tinygltf {
class Model;
}

namespace lightloom {

/// Reads .glb or .gltf, whichever the bytes say. Buffers and image files come only from the file's own folder
/// or below. Images stay encoded: in Image::image if they came by URI, else behind Image::bufferView. Nothing
/// in the model is checked against anything else in it.
absl::StatusOr<std::unique_ptr<tinygltf::Model>> read_gltf_model(const std::filesystem::path& path);

/// The parts of a .glb or .gltf, by what its bytes say.
struct GltfParts {
  std::string_view json;
  std::span<const uint8_t> binary;  ///< the BIN chunk; empty in a .gltf
};
absl::StatusOr<GltfParts> gltf_parts(const std::vector<uint8_t>& file);

/// Header, JSON chunk, BIN chunk (glTF 2.0, 4.4).
absl::StatusOr<std::vector<uint8_t>> glb_bytes(std::string json, std::span<const uint8_t> binary);

}  // namespace lightloom
