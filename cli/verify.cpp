// lightloom verify: is an asset whole, and does it belong to this level?
#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "cli/command.h"
#include "core/asset/asset.h"
#include "core/bake/plan.h"
#include "core/base/version.h"
#include "core/scene/gltf.h"

namespace lightloom {
namespace {

struct Options {
  std::string loom, scene;
  bool json = false;
};

absl::Status check(const Options& o) {
  LL_RETURN_IF_ERROR(verify_asset(o.loom));
  LL_ASSIGN_OR_RETURN(const Manifest m, read_manifest(o.loom));
  if (m.method_version != kMethodVersion) {
    return absl::FailedPreconditionError(o.loom + " was baked by method version " + m.method_version + ", this is " +
                                         std::string(kMethodVersion) + "; bake again");
  }
  if (!o.scene.empty()) {
    LL_ASSIGN_OR_RETURN(const Scene scene, load_gltf(o.scene));
    if (scene_hash(scene) != m.scene_hash) {
      return absl::FailedPreconditionError(o.loom + " is stale: the geometry of " + o.scene +
                                           " has changed; bake again");
    }
  }
  return absl::OkStatus();
}

absl::Status run(const Options& o) {
  const absl::Status status = check(o);
  if (o.json) {
    const nlohmann::json out = {{"ok", status.ok()}, {"error", std::string(status.message())}};
    std::printf("%s\n", out.dump().c_str());
  } else if (status.ok()) {
    std::printf("%s: whole%s\n", o.loom.c_str(), o.scene.empty() ? "" : ", and baked from this level");
  }
  return status;
}

}  // namespace

Command verify_command() {
  const auto o = std::make_shared<Options>();
  return {"verify",
          "Check an asset's structure and hashes, and that it belongs to a level",
          {{"OUT", ".loom folder", &o->loom, true},
           {"--scene", "level to check against; stale is an error", &o->scene},
           {"--json", "print the result as JSON", &o->json}},
          [o] { return run(*o); }};
}

}  // namespace lightloom
