// lightloom render: lights an asset in the runtime, headless, and writes pictures and lightmaps.
#include <nlohmann/json.hpp>

#include <chrono>
#include <cstdio>
#include <map>
#include <memory>

#include "cli/command.h"
#include "cli/level.h"
#include "cli/player.h"
#include "cli/progress.h"
#include "core/asset/asset.h"
#include "core/relight/camera_view.h"

namespace lightloom {
namespace {

struct Options {
  std::string loom, scene, output, lightmap, lights, rig, camera, layer = "full", device = "vulkan";
  int bounces = 16, width = 960, samples = 4, direct_samples = 16, threads = 0;
  float exposure = 0;
  bool json = false, validation = false;
};

absl::Status write_picture(const Options& o, const Level& level, const SurfaceElements& elements,
                           const std::vector<Vec3>& e, ProgressBar* bar) {
  static const std::map<std::string, Layer> kLayers = {
      {"full", Layer::kFull}, {"direct", Layer::kDirect}, {"indirect", Layer::kIndirect}, {"E", Layer::kE}};
  const auto layer = kLayers.find(o.layer);
  if (layer == kLayers.end()) return absl::InvalidArgumentError("--layer must be full, direct, indirect or E");
  LL_ASSIGN_OR_RETURN(const Camera camera, find_camera(*level.scene, o.camera));
  ViewOptions view;
  view.width = o.width;
  view.samples = o.samples;
  view.layer = layer->second;
  view.parallel = bar->parallel("picture", o.threads);
  LL_ASSIGN_OR_RETURN(Image image, render_view(*level.tracer, elements, e, camera, view));
  bar->finish();
  if (o.output.ends_with(".exr")) return write_exr(image, o.output);
  const float exposure = expose(&image, o.exposure);
  if (!o.json) std::printf("%s: exposure %.4g\n", o.output.c_str(), static_cast<double>(exposure));
  return write_png(image, o.output);
}

absl::Status check(const Options& o) {
  if (o.output.empty() && o.lightmap.empty())
    return absl::InvalidArgumentError("give -o PICTURE or --lightmap E.exr, or both");
  if (!o.output.empty() && !o.output.ends_with(".png") && !o.output.ends_with(".exr")) {
    return absl::InvalidArgumentError("-o must end in .png or .exr");
  }
  if (o.bounces < 0 || o.bounces > 1000) return absl::InvalidArgumentError("--bounces must be 0 to 1000");
  if (o.width < 1 || o.width > 16384) return absl::InvalidArgumentError("--width must be 1 to 16384");
  if (o.samples < 1 || o.direct_samples < 1)
    return absl::InvalidArgumentError("--samples and --direct-samples must be ≥ 1");
  if (o.device != "vulkan" && o.device != "cpu") return absl::InvalidArgumentError("--device must be vulkan or cpu");
  return absl::OkStatus();
}

absl::Status run(const Options& o) {
  LL_RETURN_IF_ERROR(check(o));
  LL_ASSIGN_OR_RETURN(const Manifest manifest, read_manifest(o.loom));
  LL_ASSIGN_OR_RETURN(const Level level, load_level(o.scene, o.lights, o.rig));
  LL_ASSIGN_OR_RETURN(const SurfaceElements elements, load_surface_elements(o.loom, manifest, *level.scene));

  ProgressBar bar;
  LL_ASSIGN_OR_RETURN(const SurfaceInputs inputs, light_surfaces(*level.tracer, elements, o.direct_samples,
                                                                 bar.parallel("direct light", o.threads)));
  bar.finish();
  const auto start = std::chrono::steady_clock::now();
  PlayTimes times;
  const PlayOptions play_options{o.bounces, o.device == "cpu", o.validation};
  LL_ASSIGN_OR_RETURN(const std::vector<Vec3> e, play(o.loom, inputs, level.scene->environment, play_options, &times));
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  if (!o.lightmap.empty()) LL_RETURN_IF_ERROR(write_exr(lightmap_image(elements, e), o.lightmap));
  if (!o.output.empty()) LL_RETURN_IF_ERROR(write_picture(o, level, elements, e, &bar));
  const double frames = std::max(1, o.bounces);
  if (o.json) {
    const nlohmann::json out = {{"receivers", e.size()},
                                {"frames", o.bounces},
                                {"seconds", seconds},
                                {"frame_ms",
                                 {{"radiosity", times.radiosity / frames},
                                  {"relight", times.relight / frames},
                                  {"project", times.project / frames},
                                  {"receive", times.receive / frames}}}};
    std::printf("%s\n", out.dump().c_str());
  } else {
    std::printf("%s: %d frames on %s in %s; a frame: radiosity %.2f + relight %.2f + project %.2f + receive %.2f ms\n",
                o.loom.c_str(), o.bounces, o.device.c_str(), human_seconds(seconds).c_str(), times.radiosity / frames,
                times.relight / frames, times.project / frames, times.receive / frames);
  }
  return absl::OkStatus();
}

}  // namespace

Command render_command() {
  const auto o = std::make_shared<Options>();
  return {"render",
          "Light an asset in the runtime and write pictures and lightmaps",
          {{"OUT", ".loom folder", &o->loom, true},
           {"SCENE", "the level it was baked from", &o->scene, true},
           {"-o,--output", "picture to write, .png or .exr", &o->output},
           {"--lightmap", "EXR to write: E in W/m² per texel, A, area", &o->lightmap},
           {"--lights", "lights.json that replaces the level's lights", &o->lights},
           {"--rig", "which rig of --lights", &o->rig},
           {"--bounces", "frames of feedback; each adds a bounce", &o->bounces},
           {"--camera", "by name; empty: the first", &o->camera},
           {"--width", "pixels across", &o->width},
           {"--samples", "rays per pixel", &o->samples},
           {"--layer", "full, direct, indirect or E", &o->layer},
           {"--exposure", "factor before the tone map; 0: from the picture", &o->exposure},
           {"--direct-samples", "points per texel where direct light is taken", &o->direct_samples},
           {"--device", "vulkan, or cpu: the slow reference decoder", &o->device},
           {"--validation", "run under the Vulkan validation layers", &o->validation},
           {"--threads", "0: one per hardware thread", &o->threads},
           {"--json", "print the result as JSON", &o->json}},
          [o] { return run(*o); }};
}

}  // namespace lightloom
