// lightloom view: a window in which a baked level is lit live, looked at, edited and baked again.
#include "cli/view/viewer.h"

#include <memory>

#include "cli/command.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "core/base/file.h"

namespace lightloom {
namespace {

struct Options {
  view::ViewOptions view;
  std::string script;
  bool no_panel = false;
};

/// level.glb → level-edited.glb
std::string edited_name(const std::string& scene) {
  const std::filesystem::path path(scene);
  return (path.parent_path() / (path.stem().string() + "-edited.glb")).string();
}

/// What the script will write; a file that is written again is no mistake.
absl::Status check_outputs(const Options& o) {
  const view::LevelFiles& files = o.view.files;
  const auto check = [&](const std::string& option, const std::string& path, const char* suffix) {
    return OutputCheck({files.scene, files.lights, files.loom, o.script}).file(option, path, {suffix});
  };
  LL_RETURN_IF_ERROR(check("--save-as", o.view.save_as, ".glb"));
  if (!o.view.screenshot.empty()) LL_RETURN_IF_ERROR(check("--screenshot", o.view.screenshot, ".png"));
  for (const view::Action& action : o.view.script) {
    const std::string where = o.script + " line " + std::to_string(action.line) + ":";
    if (action.verb == view::Verb::kSave) LL_RETURN_IF_ERROR(check(where, action.name, ".glb"));
    if (action.verb == view::Verb::kScreenshot) LL_RETURN_IF_ERROR(check(where, action.name, ".png"));
  }
  return absl::OkStatus();
}

absl::Status check(Options* o) {
  const auto bad = [](const char* what) { return absl::InvalidArgumentError(what); };
  view::ViewOptions& v = o->view;
  if (v.width < 64 || v.width > 16384) return bad("--width must be 64 to 16384");
  if (v.height < 64 || v.height > 16384) return bad("--height must be 64 to 16384");
  if (!(v.exposure >= 0)) return bad("--exposure must be ≥ 0");
  if (!(v.budget >= 0) || v.budget > 1e9) return bad("--budget must be 0 to 1e9 MB");
  if (v.shadow_size != 0 && (v.shadow_size < 16 || v.shadow_size > 16384)) {
    return bad("--shadow-size must be 16 to 16384, or 0");
  }
  LL_RETURN_IF_ERROR(check_loom(v.files.loom));
  LL_RETURN_IF_ERROR(check_level(v.files.scene, v.files.lights, v.files.rig));
  if (v.save_as.empty()) v.save_as = edited_name(v.files.scene);
  v.panel = !o->no_panel;
  if (!o->script.empty()) {
    LL_RETURN_IF_ERROR(check_input(o->script));
    LL_ASSIGN_OR_RETURN(const std::vector<uint8_t> text, read_file(o->script));
    auto script = view::parse_script({reinterpret_cast<const char*>(text.data()), text.size()});
    if (!script.ok()) {
      return absl::InvalidArgumentError(o->script + " " + std::string(script.status().message()));
    }
    v.script = *std::move(script);
    v.script_name = o->script;
  }
  return check_outputs(*o);
}

absl::Status run(const Options& o) {
  cancel_on_interrupt();
  return view::run_viewer(o.view);
}

}  // namespace

Command view_command() {
  const auto o = std::make_shared<Options>();
  view::ViewOptions& v = o->view;
  return {"view",
          "Look at a baked level in a window: fly, move lights, paint, edit, bake again",
          {{"OUT", ".loom folder; rebakes go there", &v.files.loom, true},
           {"SCENE", "the level it was baked from", &v.files.scene, true},
           {"--lights", "lights.json that replaces the level's lights", &v.files.lights},
           {"--rig", "which rig of --lights", &v.files.rig},
           {"--camera", "to begin at, by name; empty: the first", &v.camera},
           {"--width", "pixels across", &v.width},
           {"--height", "pixels down", &v.height},
           {"--exposure", "factor before the tone map; 0: from the first pictures", &v.exposure},
           {"--budget", "MB of cells and relight sets in memory, streamed; 0: no limit", &v.budget},
           {"--shadow-size", "texels along a side of a shadow map; 0: by the number of lights", &v.shadow_size},
           {"--save-as", ".glb for the edited level; empty: SCENE-edited.glb", &v.save_as},
           {"--script", "file of commands, one a line (docs/view.md)", &o->script},
           {"--screenshot", "PNG of the window, taken when the script is done; then the viewer ends", &v.screenshot},
           {"--no-panel", "the picture alone, without panel and lamps", &o->no_panel},
           {"--validation", "run under the Vulkan validation layers", &v.validation}},
          [o] { return check(o.get()); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
