// lightloom reference: path-traced truth for the texels or a camera.
#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "cli/command.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "cli/level.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/base/stopwatch.h"
#include "core/base/text.h"
#include "core/reference/path_tracer.h"

namespace lightloom {
namespace {

struct Options {
  std::string scene, output, lights, rig, camera, footprint = "texel";
  int bounces = 1, samples = 1024, lightmap_size = 0, width = 512, threads = 0;
  float texels_per_metre = 0;
  uint64_t seed = 1;
  bool json = false;
};

absl::Status check(const Options& o) {
  const auto bad = [](const std::string& what) { return absl::InvalidArgumentError(what); };
  if (o.bounces < 0) return bad("--bounces must be ≥ 0");
  if (o.samples < 2) return bad("--samples must be ≥ 2");
  if (o.width < 1 || o.width > 16384) return bad("--width must be 1 to 16384");
  if (o.footprint != "texel" && o.footprint != "cycles") return bad("--footprint must be texel or cycles");
  if (o.lightmap_size < 0 || o.lightmap_size > kMaxLightmapSide) {
    return bad("--lightmap-size must be 0 to " + std::to_string(kMaxLightmapSide));
  }
  if (!(o.texels_per_metre >= 0)) return bad("--texels-per-metre must be ≥ 0");
  LL_RETURN_IF_ERROR(check_threads(o.threads));
  LL_RETURN_IF_ERROR(check_level(o.scene, o.lights, o.rig));
  return OutputCheck({o.scene, o.lights}).file("-o", o.output, {".exr"});
}

absl::Status run(const Options& o) {
  cancel_on_interrupt();
  LL_ASSIGN_OR_RETURN(const Level level, load_level(o.scene, o.lights, o.rig));
  ProgressBar bar;
  ReferenceOptions options;
  options.bounces = o.bounces;
  options.samples = o.samples;
  options.seed = o.seed;
  options.footprint = o.footprint == "cycles" ? Footprint::kCycles : Footprint::kTexel;
  options.parallel = bar.parallel("tracing", o.threads);

  const Stopwatch watch;
  absl::StatusOr<ReferenceResult> result;
  if (o.camera.empty()) {
    LayoutOptions layout_options;
    layout_options.lightmap_size = o.lightmap_size;
    layout_options.texels_per_metre = o.texels_per_metre;
    LL_ASSIGN_OR_RETURN(const AtlasLayout layout, make_layout(*level.scene, layout_options));
    if (layout.width == 0) {
      return absl::FailedPreconditionError(o.scene +
                                           " has no static object that receives a lightmap; give it one, or look "
                                           "through a camera with --camera first");
    }
    result = reference_lightmap(*level.tracer, layout, options);
  } else {
    LL_ASSIGN_OR_RETURN(const Camera camera,
                        find_camera(*level.scene, o.camera == "first" ? "" : o.camera, o.scene, o.width));
    result = reference_camera(*level.tracer, camera, o.width, options);
  }
  LL_RETURN_IF_ERROR(result.status());
  const double seconds = watch.seconds();
  bar.finish();
  LL_RETURN_IF_ERROR(write_exr(result->image, o.output));
  if (o.json) {
    print_json({{"noise", result->noise}, {"seconds", seconds}});
  } else {
    std::printf("%s: %dx%d, %d bounces, noise %.4f (rel_rmse), %s\n", escape_controls(o.output).c_str(),
                result->image.width, result->image.height, o.bounces, result->noise, human_seconds(seconds).c_str());
  }
  return absl::OkStatus();
}

}  // namespace

Command reference_command() {
  const auto o = std::make_shared<Options>();
  return {
      "reference",
      "Path-trace the irradiance that the bake approximates",
      {{"SCENE", "level, .glb or .gltf", &o->scene, true},
       {"-o,--output", "EXR to write: E in W/m², A, area", &o->output, true},
       {"--lights", "lights.json that replaces the level's lights", &o->lights},
       {"--rig", "which rig of --lights", &o->rig},
       {"--bounces", "surfaces that light is reflected at on its way", &o->bounces},
       {"--samples", "paths per texel or pixel; each half is rounded down to a square number", &o->samples},
       {"--lightmap-size", "side of the scene atlas, texels; 0: from --texels-per-metre", &o->lightmap_size},
       {"--texels-per-metre", "lightmap density; 0: chosen from the scene", &o->texels_per_metre},
       {"--camera", "render this camera ('first': the first one) in place of the lightmap", &o->camera},
       {"--width", "pixels across, with --camera", &o->width},
       {"--footprint", "texel: average over the whole texel; cycles: as Blender Cycles 3.4 bakes do", &o->footprint},
       {"--seed", "of the random numbers", &o->seed},
       {"--threads", "0: one per hardware thread", &o->threads},
       {"--json", "print the result as JSON", &o->json}},
      [o] { return check(*o); },
      [o] { return run(*o); }};
}

}  // namespace lightloom
