// lightloom verify: is an asset whole, and does it belong to this level?
#include <nlohmann/json.hpp>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <system_error>

#include "cli/command.h"
#include "cli/files.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/asset/asset.h"
#include "core/bake/bake.h"
#include "core/base/text.h"
#include "core/base/version.h"
#include "core/scene/gltf.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string loom, scene;
  bool json = false;
};

/// What lies in the chunk folder without being part of the asset: left by earlier or cancelled bakes.
struct Orphans {
  uint64_t files = 0, bytes = 0;
};

Orphans find_orphans(const fs::path& loom, const Manifest& m) {
  std::set<fs::path> named;
  const ChunkStore store = chunk_store(loom);
  for (const ChunkRef& chunk : chunks_of(m)) named.insert(store.path(chunk.digest));
  Orphans orphans;
  std::error_code error;
  for (fs::recursive_directory_iterator it(loom / "chunks", error), end; !error && it != end; it.increment(error)) {
    std::error_code unknown;
    if (!it->is_regular_file(unknown) || named.contains(it->path())) continue;
    ++orphans.files;
    const uint64_t size = it->file_size(unknown);
    if (!unknown) orphans.bytes += size;
  }
  return orphans;
}

absl::Status verify(const Options& o, Orphans* orphans) {
  LL_RETURN_IF_ERROR(check_loom(o.loom));
  if (!o.scene.empty()) LL_RETURN_IF_ERROR(check_input(o.scene));
  LL_RETURN_IF_ERROR(verify_asset(o.loom));
  LL_ASSIGN_OR_RETURN(const Manifest m, read_manifest(o.loom));
  *orphans = find_orphans(o.loom, m);
  if (m.method_version != kMethodVersion) {
    return absl::FailedPreconditionError(o.loom + " was baked by method version " + printable(m.method_version) +
                                         ", this is " + std::string(kMethodVersion) + "; bake again");
  }
  if (const BakeReport report = report_of(m); report.cells_stale > 0) {
    char share[32];
    std::snprintf(share, sizeof share, "%.2g %%", 100 * report.stale);
    return absl::FailedPreconditionError(o.loom + " was baked with a tolerance: " + std::to_string(report.cells_stale) +
                                         " of its cells are stale, by an estimated " + share +
                                         " of their light at most; bake again without --tolerance");
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
  Orphans orphans;
  absl::Status status = verify(o, &orphans);
  if (o.json) {
    print_json({{"ok", status.ok()},
                {"error", std::string(status.message())},
                {"orphans", {{"files", orphans.files}, {"bytes", orphans.bytes}}}});
  } else if (status.ok()) {
    std::printf("%s: whole%s\n", escape_controls(o.loom).c_str(), o.scene.empty() ? "" : ", and baked from this level");
    if (orphans.files > 0) {
      std::printf("  %llu files (%s) in its chunks folder are of other bakes: the manifest does not name them\n",
                  static_cast<unsigned long long>(orphans.files),
                  human_bytes(static_cast<double>(orphans.bytes)).c_str());
    }
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
          [] { return absl::OkStatus(); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
