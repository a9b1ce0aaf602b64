// A glTF file read into tinygltf's model, after the checks that tinygltf leaves out.
#pragma once

#include <filesystem>
#include <memory>

#include "core/base/status.h"

namespace tinygltf {
class Model;
}

namespace lightloom {

/// Reads .glb or .gltf, whichever the bytes say. Buffers and image files come only from the file's own folder
/// or below. Images stay encoded: in Image::image if they came by URI, else behind Image::bufferView. Nothing
/// in the model is checked against anything else in it.
absl::StatusOr<std::unique_ptr<tinygltf::Model>> read_gltf_model(const std::filesystem::path& path);

}  // namespace lightloom
