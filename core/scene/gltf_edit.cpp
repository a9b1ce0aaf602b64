#include "core/scene/gltf_edit.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/base/file.h"
#include "core/scene/gltf_container.h"
#include "core/scene/gltf_transform.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::vector<double> numbers(const Json& node, const char* key) {
  const auto it = node.find(key);
  return it == node.end() ? std::vector<double>() : it->get<std::vector<double>>();
}

/// Children of a node, or roots of a scene.
std::vector<int> numbers_of_nodes(const Json& parent, const char* key) {
  const auto it = parent.find(key);
  return it == parent.end() ? std::vector<int>() : it->get<std::vector<int>>();
}

bool links_to_files(const Json& root) {
  for (const char* list : {"buffers", "images"}) {
    for (const Json& item : root.value(list, Json::array())) {
      const std::string uri = item.value("uri", "");
      if (!uri.empty() && !uri.starts_with("data:")) return true;
    }
  }
  return false;
}

}  // namespace

struct GltfEdit::Impl {
  fs::path path;
  Json root;
  std::vector<uint8_t> binary;

  absl::StatusOr<Json*> node(int index) {
    if (index < 0 || !root.contains("nodes") || static_cast<size_t>(index) >= root["nodes"].size()) {
      return absl::InvalidArgumentError(path.string() + " has no node " + std::to_string(index) + "; reload the level");
    }
    return &root["nodes"][static_cast<size_t>(index)];
  }
  absl::StatusOr<Transform> local(int index) {
    LL_ASSIGN_OR_RETURN(const Json* n, node(index));
    return local_transform(numbers(*n, "matrix"), numbers(*n, "translation"), numbers(*n, "rotation"),
                           numbers(*n, "scale"));
  }
  /// -1: a root.
  int parent(int index) const {
    const Json& nodes = root.at("nodes");
    for (size_t i = 0; i < nodes.size(); ++i) {
      const std::vector<int> children = numbers_of_nodes(nodes[i], "children");
      if (std::find(children.begin(), children.end(), index) != children.end()) return static_cast<int>(i);
    }
    return -1;
  }
  /// Every list that names the node: its parent's children, or the roots of scenes.
  std::vector<Json*> lists_with(int index) {
    std::vector<Json*> lists;
    const auto look = [&](Json& owner, const char* key) {
      const auto it = owner.find(key);
      if (it != owner.end() && std::find(it->begin(), it->end(), index) != it->end()) lists.push_back(&*it);
    };
    for (Json& n : root["nodes"]) look(n, "children");
    if (root.contains("scenes")) {
      for (Json& scene : root["scenes"]) look(scene, "nodes");
    }
    return lists;
  }
};

GltfEdit::GltfEdit(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
GltfEdit::GltfEdit(GltfEdit&&) noexcept = default;
GltfEdit& GltfEdit::operator=(GltfEdit&&) noexcept = default;
GltfEdit::~GltfEdit() = default;

absl::StatusOr<GltfEdit> GltfEdit::open(const fs::path& path) {
  LL_ASSIGN_OR_RETURN(const std::vector<uint8_t> file, read_file(path));
  const auto broken = [&](const std::string& what) { return absl::InvalidArgumentError(path.string() + " " + what); };
  const auto parts = gltf_parts(file);
  if (!parts.ok()) return broken(std::string(parts.status().message()));
  auto impl = std::make_unique<Impl>();
  impl->path = path;
  impl->root = Json::parse(parts->json, nullptr, /*allow_exceptions=*/false);
  if (!impl->root.is_object()) return broken("is not readable as glTF; export it again");
  try {  // what is of another type than glTF says throws here, and not in an edit
    for (const Json& n : impl->root.value("nodes", Json::array())) {
      for (const char* key : {"matrix", "translation", "rotation", "scale"}) (void)numbers(n, key);
      (void)numbers_of_nodes(n, "children");
    }
    for (const Json& s : impl->root.value("scenes", Json::array())) (void)numbers_of_nodes(s, "nodes");
    (void)links_to_files(impl->root);
  } catch (const Json::exception&) {
    return broken("has nodes that are not glTF; export it again");
  }
  impl->binary.assign(parts->binary.begin(), parts->binary.end());
  return GltfEdit(std::move(impl));
}

absl::Status GltfEdit::move(int index, Vec3 offset) {
  Transform parents = kIdentity;
  for (int p = impl_->parent(index); p >= 0; p = impl_->parent(p)) {
    LL_ASSIGN_OR_RETURN(const Transform local, impl_->local(p));
    parents = compose(local, parents);
  }
  if (determinant(parents) == 0) {
    return absl::FailedPreconditionError(
        "the object hangs on a node that is scaled to nothing; move that one elsewhere");
  }
  parents[12] = parents[13] = parents[14] = 0;  // an offset has a direction and no place
  const Dvec3 step = transform_point(inverse(parents), {offset.x, offset.y, offset.z});
  LL_ASSIGN_OR_RETURN(Json* const node, impl_->node(index));
  const bool has_matrix = node->contains("matrix");
  std::vector<double> values = numbers(*node, has_matrix ? "matrix" : "translation");
  values.resize(has_matrix ? 16 : 3, 0);
  for (size_t i = 0; i < 3; ++i) values[(has_matrix ? 12 : 0) + i] += step[i];
  (*node)[has_matrix ? "matrix" : "translation"] = values;
  return absl::OkStatus();
}

absl::Status GltfEdit::remove(int index) {
  LL_ASSIGN_OR_RETURN(Json* const node, impl_->node(index));
  node->erase("mesh");
  node->erase("skin");
  if (!numbers_of_nodes(*node, "children").empty()) return absl::OkStatus();
  if (!impl_->root.contains("scenes")) return absl::OkStatus();  // every node is there; this one shows nothing
  for (Json* list : impl_->lists_with(index)) list->erase(std::find(list->begin(), list->end(), index));
  for (Json& n : impl_->root["nodes"]) {
    if (n.contains("children") && n["children"].empty()) n.erase("children");  // glTF has no empty lists
  }
  return absl::OkStatus();
}

absl::StatusOr<int> GltfEdit::duplicate(int index, const std::string& name) {
  LL_ASSIGN_OR_RETURN(const Json* const node, impl_->node(index));
  Json copy = *node;
  copy.erase("children");
  copy["name"] = name;
  // A light or camera of the node stays the only one.
  copy.erase("camera");
  if (copy.contains("extensions")) {
    copy["extensions"].erase("KHR_lights_punctual");
    if (copy["extensions"].empty()) copy.erase("extensions");
  }
  const int number = static_cast<int>(impl_->root["nodes"].size());
  for (Json* list : impl_->lists_with(index)) list->push_back(number);
  impl_->root["nodes"].push_back(std::move(copy));
  return number;
}

std::vector<int> GltfEdit::subtree(int index) const {
  std::vector<int> all{index};
  for (size_t i = 0; i < all.size(); ++i) {
    const auto node = impl_->node(all[i]);
    if (!node.ok()) continue;
    const std::vector<int> children = numbers_of_nodes(**node, "children");
    all.insert(all.end(), children.begin(), children.end());
  }
  return all;
}

absl::Status GltfEdit::save(const fs::path& path) const {
  const auto folder = [](const fs::path& file) { return fs::weakly_canonical(fs::absolute(file).parent_path()); };
  if (links_to_files(impl_->root) && folder(path) != folder(impl_->path)) {
    return absl::FailedPreconditionError("cannot write " + path.string() +
                                         ": the level links to files beside it; save into " +
                                         folder(impl_->path).string());
  }
  LL_ASSIGN_OR_RETURN(const std::vector<uint8_t> bytes, glb_bytes(impl_->root.dump(), impl_->binary));
  return write_file_atomic(path, bytes);
}

}  // namespace lightloom
