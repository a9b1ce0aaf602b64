// What can be said about a command's files before any work: that inputs are there, and that outputs can be written and
// replace nothing else.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status.h"

namespace lightloom {

/// `path` is a regular file.
absl::Status check_input(const std::string& path);
/// `path` is a folder with a manifest.
absl::Status check_loom(const std::string& path);

/// Buffers and textures beside a .gltf. Whatever cannot be read names nothing: the loader will say why.
std::vector<std::string> linked_files(const std::string& gltf);

class OutputCheck {
 public:
  /// `inputs`: files and .loom folders that the command reads; empty names are skipped. What a .gltf links to counts too.
  explicit OutputCheck(const std::vector<std::string>& inputs);

  /// `option` is what the user calls it. The name must end in one of `suffixes`, and the file be none of the inputs and
  /// earlier outputs; what it replaces, if anything, is a regular file; its folder takes new files.
  absl::Status file(const std::string& option, const std::string& path, std::initializer_list<const char*> suffixes);
  /// A .loom folder: new, empty, or one that was baked before.
  absl::Status loom(const std::string& option, const std::string& path);

 private:
  void use(const std::string& path);
  absl::Status unused(const std::string& option, const std::string& path);

  // What is read and written, by name and, where it exists, by device and inode.
  std::map<std::string, std::string> by_name_;
  std::map<std::pair<uint64_t, uint64_t>, std::string> by_inode_;
  std::set<std::string> folders_;  ///< that were found to take new files
};

}  // namespace lightloom
