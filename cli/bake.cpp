// lightloom bake: a level becomes a .loom asset.
#include <sys/resource.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "cli/bake_options.h"
#include "cli/command.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "cli/level.h"
#include "cli/local_bake.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/bake/bake.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

struct Options {
  std::string scene, output;
  BakeOptions how;
  int threads = 0;
  bool json = false;
};

/// Of this process, bytes.
uint64_t peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024 * static_cast<uint64_t>(usage.ru_maxrss);
}

nlohmann::json to_json(const BakeReport& r) {
  return {
      {"receivers", r.receivers},
      {"probes", r.probes},
      {"probes_repair", r.repairs},
      {"cells", r.cells},
      {"clusters", r.clusters},
      {"clusters_reused", r.clusters_reused},
      {"coefficients_per_receiver", r.coefficients},
      {"rays_gather", r.rays_gather},
      {"rays_visibility", r.rays_visibility},
      {"rays_relight", r.rays_relight},
      {"unseen_fraction", r.rays_gather > 0 ? static_cast<double>(r.unseen) / static_cast<double>(r.rays_gather) : 0.0},
      {"seconds",
       {{"total", r.seconds_total},
        {"plan", r.seconds_plan},
        {"receivers", r.seconds_receivers},
        {"probes", r.seconds_probes},
        {"transport", r.seconds_transport},
        {"compress", r.seconds_compress},
        {"relight", r.seconds_relight},
        {"write", r.seconds_write}}},
      {"bytes",
       {{"total", r.bytes_total},
        {"projection", r.bytes_projection},
        {"reconstruction", r.bytes_reconstruction},
        {"relight", r.bytes_relight},
        {"peak_memory", peak_memory()}}}};
}

void print(const std::string& output, const BakeReport& r) {
  std::printf("%s: %s\n", escape_controls(output).c_str(), human_bytes(static_cast<double>(r.bytes_total)).c_str());
  std::printf(
      "  %llu receivers, %llu probes (%llu of them repairs), %llu clusters in %llu cells, %.1f coefficients a "
      "receiver\n",
      static_cast<unsigned long long>(r.receivers), static_cast<unsigned long long>(r.probes),
      static_cast<unsigned long long>(r.repairs), static_cast<unsigned long long>(r.clusters),
      static_cast<unsigned long long>(r.cells), r.coefficients);
  const double rays = static_cast<double>(r.rays_gather + r.rays_visibility);
  std::printf("  %s: plan %s, transport %s (%srays, %srays/s), compression %s\n",
              human_seconds(r.seconds_total).c_str(), human_seconds(r.seconds_plan).c_str(),
              human_seconds(r.seconds_transport).c_str(), human_count(rays).c_str(),
              human_count(r.seconds_transport > 0 ? rays / r.seconds_transport : 0).c_str(),
              human_seconds(r.seconds_compress).c_str());
  std::printf("  unseen by any probe: %.4f %% of gather rays\n",
              r.rays_gather > 0 ? 100.0 * static_cast<double>(r.unseen) / static_cast<double>(r.rays_gather) : 0.0);
}

absl::Status check(Options* o) {
  LL_RETURN_IF_ERROR(o->how.check());
  LL_RETURN_IF_ERROR(check_threads(o->threads));
  LL_RETURN_IF_ERROR(check_input(o->scene));
  return OutputCheck({o->scene}).loom("-o", o->output);
}

absl::Status run(const Options& o) {
  cancel_on_interrupt();
  LL_ASSIGN_OR_RETURN(const Level level, load_level(o.scene));
  ProgressBar bar;
  BakeControl control;
  control.threads = o.threads;
  control.cancel = &interrupted();
  control.progress = [&](const std::string& stage, uint64_t done, uint64_t total, uint64_t rays) {
    bar.update(stage, done, total, rays);
  };
  LL_ASSIGN_OR_RETURN(const BakeReport report, local_bake(*level.tracer, o.how.params, o.output, control));
  bar.finish();
  if (o.json) {
    print_json(to_json(report));
  } else {
    print(o.output, report);
  }
  return absl::OkStatus();
}

}  // namespace

Command bake_command() {
  const auto o = std::make_shared<Options>();
  std::vector<Option> options = {{"SCENE", "level, .glb or .gltf", &o->scene, true},
                                 {"-o,--output", "OUT.loom, a folder", &o->output, true}};
  for (Option& option : o->how.options()) options.push_back(std::move(option));
  options.push_back({"--threads", "0: one per hardware thread", &o->threads});
  options.push_back({"--json", "print the report as JSON", &o->json});
  return {"bake", "Bake a level into a .loom asset", std::move(options), [o] { return check(o.get()); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
