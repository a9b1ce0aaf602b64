// A glTF file in which nodes are moved, copied and emptied, and all else stays as it was: names, extras and extensions of
// other programs too, which a Scene knows nothing of.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/base/vec.h"

namespace lightloom {

/// Nodes are numbered as in the file (Object::node). A node that does not exist is an error.
class GltfEdit {
 public:
  static absl::StatusOr<GltfEdit> open(const std::filesystem::path& path);
  GltfEdit(GltfEdit&&) noexcept;
  GltfEdit& operator=(GltfEdit&&) noexcept;
  ~GltfEdit();

  /// By `offset` in world space, with all that hangs on it.
  absl::Status move(int node, Vec3 offset);
  /// Its mesh goes: the node too, unless others hang on it.
  absl::Status remove(int node);
  /// A node with the same mesh, in the same place and under the same parent, without what hangs on it. Its number.
  absl::StatusOr<int> duplicate(int node, const std::string& name);
  /// The node and all that hangs on it.
  std::vector<int> subtree(int node) const;

  /// As a .glb. Files that the level links to are linked to by their relative names: then it must go into the folder that
  /// the level came from.
  absl::Status save(const std::filesystem::path& path) const;

 private:
  struct Impl;
  explicit GltfEdit(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace lightloom
