// lightloom render: lights an asset in the runtime, headless, and writes pictures and lightmaps.
#include <nlohmann/json.hpp>

#include <cstdio>
#include <map>
#include <memory>
#include <optional>

#include "cli/command.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "cli/level.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "cli/scene_edit.h"
#include "cli/sheet.h"
#include "cli/stage.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

constexpr const char* kSheet = "sheet";

struct Options {
  std::string scene, output, lightmap, lights, rig, camera, layer = "full", device = "vulkan", direct;
  std::string albedo, emission, moving_light, light_path;
  StageOptions stage;
  int width = 960, samples = 4, frames = 1, reference_samples = 256;
  float exposure = 0;
  bool json = false;
};

absl::StatusOr<Layer> parse_layer(const std::string& name) {
  static const std::map<std::string, Layer> kLayers = {{"full", Layer::kFull},
                                                       {"direct", Layer::kDirect},
                                                       {"indirect", Layer::kIndirect},
                                                       {"E", Layer::kE},
                                                       {"albedo", Layer::kAlbedo}};
  const auto layer = kLayers.find(name);
  if (layer == kLayers.end()) {
    return absl::InvalidArgumentError("--layer must be full, direct, indirect, E, albedo or sheet");
  }
  return layer->second;
}

absl::StatusOr<Player> parse_device(const std::string& name) {
  if (name == "vulkan") return Player::kVulkan;
  if (name == "simd") return Player::kSimd;
  if (name == "cpu") return Player::kDecoder;
  return absl::InvalidArgumentError("--device must be vulkan, simd or cpu");
}

/// F.png → F_0007.png
std::string numbered(const std::string& path, int frame) {
  const size_t dot = path.rfind('.');
  char number[8];
  std::snprintf(number, sizeof number, "_%04d", frame);
  return path.substr(0, dot) + number + path.substr(dot);
}

absl::Status check_files(const Options& o) {
  LL_RETURN_IF_ERROR(check_loom(o.stage.loom));
  LL_RETURN_IF_ERROR(check_level(o.scene, o.lights, o.rig));
  OutputCheck outputs({o.scene, o.lights, o.stage.loom});
  for (int frame = 0; frame < o.frames; ++frame) {
    const auto name = [&](const std::string& file) { return o.frames > 1 ? numbered(file, frame) : file; };
    if (!o.output.empty()) LL_RETURN_IF_ERROR(outputs.file("-o", name(o.output), {".png", ".exr"}));
    if (!o.lightmap.empty()) LL_RETURN_IF_ERROR(outputs.file("--lightmap", name(o.lightmap), {".exr"}));
  }
  return absl::OkStatus();
}

absl::Status check(const Options& o) {
  const auto bad = [](const char* what) { return absl::InvalidArgumentError(what); };
  if (o.output.empty() && o.lightmap.empty()) return bad("give -o PICTURE or --lightmap E.exr, or both");
  if (!o.output.empty() && !o.output.ends_with(".png") && !o.output.ends_with(".exr")) {
    return bad("-o must end in .png or .exr");
  }
  if (!o.lightmap.empty() && !o.lightmap.ends_with(".exr")) return bad("--lightmap must end in .exr");
  if (o.layer == kSheet) {
    if (!o.output.ends_with(".png")) return bad("--layer sheet is for eyes: -o must end in .png");
  } else {
    LL_RETURN_IF_ERROR(parse_layer(o.layer).status());
  }
  if (o.stage.bounces < 0 || o.stage.bounces > 1000) return bad("--bounces must be 0 to 1000");
  if (o.width < 1 || o.width > 16384) return bad("--width must be 1 to 16384");
  if (o.samples < 1 || o.samples > 1024) return bad("--samples must be 1 to 1024");
  if (o.stage.direct_samples < 1 || o.stage.direct_samples > 65536) return bad("--direct-samples must be 1 to 65536");
  if (o.stage.shadow_size != 0 && (o.stage.shadow_size < 16 || o.stage.shadow_size > 16384)) {
    return bad("--shadow-size must be 16 to 16384, or 0");
  }
  if (o.reference_samples < 2) return bad("--reference-samples must be ≥ 2");
  if (o.frames < 1 || o.frames > 9999) return bad("--frames must be 1 to 9999");
  if (o.light_path.empty() != (o.frames == 1)) return bad("--frames N and --light-path x,y,z;x,y,z go together");
  if (!(o.exposure >= 0)) return bad("--exposure must be ≥ 0");
  if (!o.direct.empty() && o.direct != "shadows" && o.direct != "rays") return bad("--direct must be shadows or rays");
  LL_RETURN_IF_ERROR(parse_device(o.device).status());
  if (o.direct == "shadows" && o.device != "vulkan") return bad("--direct shadows needs --device vulkan");
  if (o.stage.validation && o.device != "vulkan") return bad("--validation needs --device vulkan");
  LL_RETURN_IF_ERROR(check_threads(o.stage.threads));
  return check_files(o);
}

/// `exposure` 0: chosen from this picture, and kept for those that follow.
absl::Status write_picture(const Options& o, const Level& level, const Camera& camera, Stage* stage,
                           const std::string& path, float* exposure, ProgressBar* bar) {
  Image image;
  if (o.layer == kSheet) {
    const SheetOptions sheet{o.width, o.samples, o.stage.bounces, o.reference_samples,
                             bar->parallel("reference", o.stage.threads)};
    LL_ASSIGN_OR_RETURN(image, make_sheet(stage, level, camera, sheet, exposure));
    bar->finish();
  } else {
    LL_ASSIGN_OR_RETURN(const Layer layer, parse_layer(o.layer));
    LL_ASSIGN_OR_RETURN(image, stage->picture(camera, {layer, o.width, o.samples}));
    if (path.ends_with(".exr")) return write_exr(image, path);
    if (layer != Layer::kAlbedo) *exposure = expose(&image, *exposure);
  }
  if (!o.json) std::printf("%s: exposure %.4g\n", escape_controls(path).c_str(), static_cast<double>(*exposure));
  return write_png(image, path);
}

void report(const Options& o, const Stage& stage) {
  const PlayTimes& times = stage.times();
  const double frames = std::max(1, o.stage.bounces) * o.frames;
  const bool timed = o.stage.player != Player::kDecoder;
  if (o.json) {
    nlohmann::json out = {
        {"receivers", stage.receivers()}, {"frames", o.stage.bounces * o.frames}, {"seconds", stage.seconds()}};
    if (timed) {
      out["frame_ms"] = {{"radiosity", times.radiosity / frames},
                         {"relight", times.relight / frames},
                         {"project", times.project / frames},
                         {"receive", times.receive / frames}};
    }
    print_json(out);
    return;
  }
  std::printf("%s: %d frames on %s in %s", escape_controls(o.stage.loom).c_str(), o.stage.bounces * o.frames,
              o.device.c_str(), human_seconds(stage.seconds()).c_str());
  if (timed) {
    std::printf("; a frame: radiosity %.2f + relight %.2f + project %.2f + receive %.2f ms", times.radiosity / frames,
                times.relight / frames, times.project / frames, times.receive / frames);
  }
  std::printf("\n");
}

absl::Status run(Options o) {
  cancel_on_interrupt();
  LL_ASSIGN_OR_RETURN(o.stage.player, parse_device(o.device));
  const bool rays = o.direct.empty() ? !o.lightmap.empty() : o.direct == "rays";
  o.stage.direct = rays ? DirectSource::kRays : DirectSource::kShadowMaps;
  LL_ASSIGN_OR_RETURN(const Level level, load_level(o.scene, o.lights, o.rig, [&](Scene* scene) -> absl::Status {
                        LL_RETURN_IF_ERROR(set_albedo(o.albedo, scene));
                        return set_emission(o.emission, scene);
                      }));
  Camera camera;
  if (!o.output.empty()) {
    LL_ASSIGN_OR_RETURN(camera, find_camera(*level.scene, o.camera, o.scene, o.width));
  }
  std::optional<LightPath> path;
  if (!o.light_path.empty()) {
    LL_ASSIGN_OR_RETURN(path, LightPath::parse(o.moving_light, o.light_path, *level.scene));
  }
  ProgressBar bar;
  LL_ASSIGN_OR_RETURN(const auto stage, Stage::create(level, o.stage, &bar));
  float exposure = o.exposure;
  for (int frame = 0; frame < o.frames; ++frame) {
    LL_RETURN_IF_ERROR(not_interrupted());
    if (path) path->move(static_cast<float>(frame) / static_cast<float>(o.frames - 1), level.scene.get());
    LL_RETURN_IF_ERROR(stage->light());
    LL_RETURN_IF_ERROR(not_interrupted());
    const auto name = [&](const std::string& file) { return path ? numbered(file, frame) : file; };
    if (!o.lightmap.empty()) {
      LL_ASSIGN_OR_RETURN(const Image e, stage->lightmap());
      LL_RETURN_IF_ERROR(write_exr(e, name(o.lightmap)));
    }
    if (!o.output.empty()) {
      LL_RETURN_IF_ERROR(write_picture(o, level, camera, stage.get(), name(o.output), &exposure, &bar));
    }
  }
  report(o, *stage);
  return absl::OkStatus();
}

}  // namespace

Command render_command() {
  const auto o = std::make_shared<Options>();
  return {
      "render",
      "Light an asset in the runtime and write pictures and lightmaps",
      {{"OUT", ".loom folder", &o->stage.loom, true},
       {"SCENE", "the level it was baked from", &o->scene, true},
       {"-o,--output", "picture to write, .png or .exr", &o->output},
       {"--lightmap", "EXR to write: E in W/m² per texel, A, area", &o->lightmap},
       {"--lights", "lights.json that replaces the level's lights", &o->lights},
       {"--rig", "which rig of --lights", &o->rig},
       {"--set-albedo", "OBJECT:r,g,b;… new colours, no rebake", &o->albedo},
       {"--set-emission", "OBJECT:r,g,b;… emitted radiance, no rebake", &o->emission},
       {"--frames", "pictures of a moving light: F_0000.png, F_0001.png, …", &o->frames},
       {"--light", "which light moves; empty: the only one", &o->moving_light},
       {"--light-path", "its way over the frames, at constant speed: x,y,z;x,y,z;…", &o->light_path},
       {"--bounces", "frames of feedback; each adds a bounce", &o->stage.bounces},
       {"--camera", "by name; empty: the first", &o->camera},
       {"--width", "pixels across", &o->width},
       {"--samples", "samples per pixel, rounded down to a square number", &o->samples},
       {"--layer", "full, direct, indirect, E, albedo, or sheet: direct, full, path traced, 8 × difference", &o->layer},
       {"--exposure", "factor before the tone map; 0: from the (first) picture", &o->exposure},
       {"--shadow-size", "texels along a side of a shadow map; 0: by the number of lights", &o->stage.shadow_size},
       {"--direct", "direct light that bounces: shadows (maps) or rays; empty: rays with --lightmap, else shadows",
        &o->direct},
       {"--direct-samples", "points per texel where colour, and with --direct rays direct light, is taken",
        &o->stage.direct_samples},
       {"--reference-samples", "paths per pixel, for --layer sheet", &o->reference_samples},
       {"--device",
        "vulkan; simd: no device, the runtime on the processor; cpu: no device, the reference decoder. Without a "
        "device "
        "pictures are ray cast",
        &o->device},
       {"--validation", "run under the Vulkan validation layers", &o->stage.validation},
       {"--threads", "0: one per hardware thread", &o->stage.threads},
       {"--json", "print the result as JSON", &o->json}},
      [o] { return check(*o); },
      [o] { return run(*o); }};
}

}  // namespace lightloom
