#include "core/bake/load_glb.h"

#include <filesystem>
#include <string>
#include <system_error>

#include "core/base/file.h"
#include "core/scene/gltf.h"

namespace lightloom {

// load_gltf reads files. The folder holds nothing else, so that no link in the level leads anywhere.
absl::StatusOr<Scene> load_glb(std::span<const uint8_t> bytes) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path folder = temporary_beside(fs::temp_directory_path(error) / "lightloom-level");
  if (error || !fs::create_directory(folder, error)) {
    return absl::UnavailableError("cannot create the folder " + folder.string() +
                                  " to unpack a level: " + (error ? error.message() : "it is there already") +
                                  "; set TMPDIR to a folder that may be written");
  }
  const fs::path path = folder / "level.glb";
  const auto load = [&]() -> absl::StatusOr<Scene> {
    LL_RETURN_IF_ERROR(write_file_atomic(path, bytes));
    return load_gltf(path);
  };
  absl::StatusOr<Scene> scene = load();
  fs::remove_all(folder, error);
  if (scene.ok()) return scene;
  // The file is gone: its path helps nobody, and changes with every run.
  std::string message(scene.status().message());
  for (size_t at = message.find(path.string()); at != message.npos; at = message.find(path.string(), at)) {
    message.replace(at, path.string().size(), "level.glb");
  }
  return absl::Status(scene.status().code(), message);
}

}  // namespace lightloom
