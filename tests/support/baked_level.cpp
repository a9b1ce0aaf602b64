#include "tests/support/baked_level.h"

#include <stdlib.h>

#include <string>

#include "cli/player.h"
#include "core/base/check.h"

namespace lightloom::test {

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "lightloom-XXXXXX").string();
  LL_CHECK(::mkdtemp(name.data()) != nullptr);
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::unique_ptr<BakedLevel> bake_level(Scene scene, const BakeParams& params, int threads) {
  auto level = std::make_unique<BakedLevel>();
  level->scene = std::make_unique<Scene>(std::move(scene));
  level->tracer = value_or_die(RayTracer::create(*level->scene));
  BakeControl control;
  control.threads = threads;
  level->report = value_or_die(bake(*level->tracer, params, level->loom(), control));
  level->manifest = value_or_die(read_manifest(level->loom()));
  level->elements = value_or_die(load_surface_elements(level->loom(), level->manifest, *level->scene));
  return level;
}

std::vector<Vec3> light(const BakedLevel& level, int bounces, Device device, int samples) {
  const SurfaceInputs inputs = value_or_die(light_surfaces(*level.tracer, level.elements, samples, {}));
  PlayOptions options;
  options.iterations = bounces;
  options.player = device == Device::kCpu    ? Player::kDecoder
                   : device == Device::kSimd ? Player::kSimd
                                             : Player::kVulkan;
  options.validation = device == Device::kVulkan;
  return value_or_die(play(level.loom(), inputs, level.scene->environment, options));
}

}  // namespace lightloom::test
