#include "core/scene/gltf_material.h"

#include <stb/stb_image.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <string>

#include "core/scene/gltf_accessor.h"

namespace lightloom {
namespace {

constexpr int kMaxSide = 16384;
constexpr uint64_t kMaxTextureBytes = uint64_t{1} << 30;

absl::Status invalid(std::string message) { return absl::InvalidArgumentError(std::move(message)); }

Wrap wrap_mode(int mode) {
  if (mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::kClamp;
  if (mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return Wrap::kMirror;
  return Wrap::kRepeat;
}

/// The encoded bytes of an image.
absl::StatusOr<ByteRange> image_bytes(const tinygltf::Model& model, const tinygltf::Image& image,
                                      const std::string& whose) {
  if (image.bufferView >= 0) return buffer_view_bytes(model, image.bufferView);
  if (image.image.empty()) {
    return invalid(whose + ": image " + shown(image.uri) + " is missing or empty; put it beside the glTF file");
  }
  return ByteRange{image.image.data(), image.image.size(), 0};
}

class TextureReader {
 public:
  TextureReader(const tinygltf::Model& model, Scene* scene) : model_(model), scene_(scene) {}

  /// Index into Scene::textures of a glTF texture, decoded when first asked for.
  absl::StatusOr<int> texture(int index, const std::string& user) {
    if (index < 0 || static_cast<size_t>(index) >= model_.textures.size()) {
      return invalid(user + " uses texture " + std::to_string(index) + ", which does not exist");
    }
    const auto [known, is_new] = loaded_.emplace(index, static_cast<int>(scene_->textures.size()));
    if (!is_new) return known->second;
    LL_ASSIGN_OR_RETURN(Texture texture, decode(index));
    scene_->textures.push_back(std::move(texture));
    return known->second;
  }

 private:
  absl::StatusOr<Texture> decode(int index) {
    const tinygltf::Texture& in = model_.textures[static_cast<size_t>(index)];
    const std::string whose = "texture " + std::to_string(index);
    if (in.source < 0 || static_cast<size_t>(in.source) >= model_.images.size()) {
      return invalid(whose + " has no image that can be read; convert it to PNG or JPEG");
    }
    const tinygltf::Image& image = model_.images[static_cast<size_t>(in.source)];
    LL_ASSIGN_OR_RETURN(const ByteRange bytes, image_bytes(model_, image, whose));
    const bool png = bytes.size > 8 && std::memcmp(bytes.data, "\x89PNG\r\n\x1a\n", 8) == 0;
    const bool jpeg = bytes.size > 3 && std::memcmp(bytes.data, "\xff\xd8\xff", 3) == 0;
    if ((!png && !jpeg) || bytes.size > std::numeric_limits<int>::max()) {
      return invalid(whose + ": its image is neither PNG nor JPEG; convert it");
    }

    const int size = static_cast<int>(bytes.size);
    int width = 0, height = 0, channels = 0;
    if (!stbi_info_from_memory(bytes.data, size, &width, &height, &channels) || width <= 0 || height <= 0) {
      return invalid(whose + ": its image is broken; export it again");
    }
    const uint64_t decoded = static_cast<uint64_t>(width) * static_cast<uint64_t>(height) * 4;
    if (width > kMaxSide || height > kMaxSide || decoded > kMaxTextureBytes - bytes_) {
      return invalid(whose + ": its image of " + std::to_string(width) + " x " + std::to_string(height) +
                     " is too large (16384 per side, 1 GiB for all textures); scale it down");
    }
    bytes_ += decoded;
    const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
        stbi_load_from_memory(bytes.data, size, &width, &height, &channels, 4), stbi_image_free);
    if (!pixels || static_cast<uint64_t>(width) * static_cast<uint64_t>(height) * 4 != decoded) {
      return invalid(whose + ": its image is broken; export it again");
    }

    Texture out;
    out.name = image.name.empty() ? image.uri : image.name;
    out.width = width;
    out.height = height;
    out.rgba.assign(pixels.get(), pixels.get() + decoded);
    if (in.sampler >= 0) {
      if (static_cast<size_t>(in.sampler) >= model_.samplers.size()) {
        return invalid(whose + " uses sampler " + std::to_string(in.sampler) + ", which does not exist");
      }
      const tinygltf::Sampler& sampler = model_.samplers[static_cast<size_t>(in.sampler)];
      out.wrap_s = wrap_mode(sampler.wrapS);
      out.wrap_t = wrap_mode(sampler.wrapT);
    }
    return out;
  }

  const tinygltf::Model& model_;
  Scene* scene_;
  std::map<int, int> loaded_;
  uint64_t bytes_ = 0;
};

absl::Status read_texture(const tinygltf::TextureInfo& info, const std::string& whose, TextureReader* textures,
                          GltfWarnings* warnings, int* texture, int* uv) {
  if (info.index == -1) return absl::OkStatus();
  if (info.texCoord != 0 && info.texCoord != 1) {
    return invalid(whose + " uses TEXCOORD_" + std::to_string(info.texCoord) + "; only 0 and 1 are read");
  }
  if (info.extensions.count("KHR_texture_transform")) {
    warnings->add("texture transforms were ignored (apply them to the UVs)", whose);
  }
  LL_ASSIGN_OR_RETURN(*texture, textures->texture(info.index, whose));
  *uv = info.texCoord;
  return absl::OkStatus();
}

absl::StatusOr<double> emissive_strength(const tinygltf::Material& in, const std::string& whose) {
  const auto extension = in.extensions.find("KHR_materials_emissive_strength");
  if (extension == in.extensions.end() || !extension->second.Has("emissiveStrength")) return 1.0;
  const tinygltf::Value& value = extension->second.Get("emissiveStrength");
  const double strength = value.IsNumber() ? value.GetNumberAsDouble() : -1;
  if (!(strength >= 0)) return invalid(whose + ": emissiveStrength must be a number of at least 0");
  return strength;
}

absl::StatusOr<Material> read_material(const tinygltf::Material& in, const std::string& whose, TextureReader* textures,
                                       GltfWarnings* warnings) {
  Material out;
  out.name = in.name;
  const auto& pbr = in.pbrMetallicRoughness;
  const std::vector<double>& color = pbr.baseColorFactor;
  if (color.size() != 4) return invalid(whose + ": baseColorFactor must have 4 numbers");
  const auto fraction = [](double v) { return static_cast<float>(std::clamp(v, 0.0, 1.0)); };
  out.base_color = {fraction(color[0]), fraction(color[1]), fraction(color[2])};
  out.alpha = fraction(color[3]);
  LL_RETURN_IF_ERROR(
      read_texture(pbr.baseColorTexture, whose, textures, warnings, &out.base_color_texture, &out.base_color_uv));

  LL_ASSIGN_OR_RETURN(const double strength, emissive_strength(in, whose));
  if (!in.emissiveFactor.empty()) {
    if (in.emissiveFactor.size() != 3) return invalid(whose + ": emissiveFactor must have 3 numbers");
    for (int c = 0; c < 3; ++c) {
      out.emission[c] = static_cast<float>(in.emissiveFactor[static_cast<size_t>(c)] * strength);
      if (!(out.emission[c] >= 0) || !std::isfinite(out.emission[c])) {
        return invalid(whose + ": its emission must be finite and not negative");
      }
    }
  }
  LL_RETURN_IF_ERROR(
      read_texture(in.emissiveTexture, whose, textures, warnings, &out.emission_texture, &out.emission_uv));

  if (in.alphaMode == "MASK") {
    out.alpha_mode = AlphaMode::kMask;
  } else if (in.alphaMode == "BLEND") {
    out.alpha_mode = AlphaMode::kBlend;
    warnings->add("materials with alpha blending are taken as opaque", in.name);
  } else if (in.alphaMode != "OPAQUE") {
    return invalid(whose + ": alphaMode " + shown(in.alphaMode) + " is unknown; use OPAQUE, MASK or BLEND");
  }
  out.alpha_cutoff = static_cast<float>(std::clamp(in.alphaCutoff, 0.0, 1e6));
  out.double_sided = in.doubleSided;
  return out;
}

}  // namespace

absl::Status read_materials(const tinygltf::Model& model, Scene* scene, GltfWarnings* warnings) {
  TextureReader textures(model, scene);
  for (size_t i = 0; i < model.materials.size(); ++i) {
    const std::string whose = "material " + std::to_string(i) + " " + shown(model.materials[i].name);
    LL_ASSIGN_OR_RETURN(Material material, read_material(model.materials[i], whose, &textures, warnings));
    scene->materials.push_back(std::move(material));
  }
  return absl::OkStatus();
}

}  // namespace lightloom
