// A level baked into a temporary folder, and lit.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "core/asset/asset.h"
#include "core/bake/bake.h"
#include "core/relight/surface_inputs.h"

namespace lightloom::test {

/// A folder of this test alone; removed with its content at the end.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

struct BakedLevel {
  std::unique_ptr<Scene> scene;  ///< lights and emission may be changed before light()
  std::unique_ptr<RayTracer> tracer;
  TemporaryFolder folder;
  BakeReport report;
  Manifest manifest;
  SurfaceElements elements;

  std::filesystem::path loom() const { return folder.path() / "level.loom"; }
};

/// Aborts the program with the error's text on failure: a test level must bake.
std::unique_ptr<BakedLevel> bake_level(Scene scene, const BakeParams& params, int threads = 0);

/// E per surface element after `bounces` frames, by the reference decoder, by the runtime on the processor, or by Vulkan under the
/// validation layers.
/// `samples`: points per texel where direct light and colours are taken.
enum class Device { kCpu, kSimd, kVulkan };
std::vector<Vec3> light(const BakedLevel& level, int bounces, Device device = Device::kCpu, int samples = 16);

/// The value, or the program ends with the error's text.
template <class T>
T value_or_die(absl::StatusOr<T> value) {
  if (!value.ok()) {
    std::fprintf(stderr, "%s\n", std::string(value.status().message()).c_str());
    std::abort();
  }
  return *std::move(value);
}

}  // namespace lightloom::test
