// glTF materials, and the textures that they use.
#pragma once

#include "core/base/status.h"
#include "core/scene/gltf_warnings.h"
#include "core/scene/scene.h"

namespace tinygltf {
class Model;
}

namespace lightloom {

/// Fills Scene::materials, index for index, and Scene::textures with the images that base colours and
/// emission use. Every surface is Lambertian: metalness, roughness and normal maps are not looked at.
absl::Status read_materials(const tinygltf::Model& model, Scene* scene, GltfWarnings* warnings);

}  // namespace lightloom
