// lightloom make-scene: levels made by code, to try things on.
#include <cstdio>
#include <memory>

#include "cli/command.h"
#include "cli/files.h"
#include "core/base/text.h"
#include "core/scene/builtin.h"
#include "core/scene/gltf.h"
#include "core/scene/shapes.h"

namespace lightloom {
namespace {

struct Options {
  std::string name, output;
  int subdivide = 0;
};

std::string names() {
  std::string all;
  for (const std::string& name : builtin_scene_names()) all += (all.empty() ? "" : "|") + name;
  return all;
}

absl::Status check(const Options& o) {
  if (o.subdivide < 0 || o.subdivide > 4) return absl::InvalidArgumentError("--subdivide must be 0 to 4");
  return OutputCheck({}).file("-o", o.output, {".glb"});
}

absl::Status run(const Options& o) {
  LL_ASSIGN_OR_RETURN(Scene scene, builtin_scene(o.name));
  for (int i = 0; i < o.subdivide; ++i) {
    for (Object& object : scene.objects) subdivide(&object);
  }
  LL_RETURN_IF_ERROR(save_gltf(scene, o.output));
  std::printf("%s: %zu objects, %llu triangles, %zu lights\n", escape_controls(o.output).c_str(), scene.objects.size(),
              static_cast<unsigned long long>(scene.triangle_count()), scene.lights.size());
  return absl::OkStatus();
}

}  // namespace

Command make_scene_command() {
  const auto o = std::make_shared<Options>();
  return {"make-scene",
          "Write a built-in level as .glb",
          {{"NAME", names(), &o->name, true},
           {"-o,--output", ".glb to write", &o->output, true},
           {"--subdivide", "cut each triangle into four, so many times", &o->subdivide}},
          [o] { return check(*o); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
