// lightloom bake: a level becomes a .loom asset.
#include <sys/resource.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "cli/command.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "cli/level.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/bake/bake.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

struct Options {
  std::string scene, output, method = "default";
  BakeParams params;
  int links = -1, relight_rays = -1;  // −1: the method's
  float threshold = -1;
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

absl::Status check(Options* options) {
  const Options& o = *options;
  if (o.method != "default" && o.method != "sl17") {
    return absl::InvalidArgumentError("--method must be default or sl17");
  }
  const BakeParams of_method = o.method == "sl17" ? sl17_params() : BakeParams{};
  BakeParams& p = options->params;
  p.method = of_method.method;
  p.links = o.links == -1 ? of_method.links : o.links;
  p.relight_rays = o.relight_rays == -1 ? of_method.relight_rays : o.relight_rays;
  p.threshold = o.threshold == -1 ? of_method.threshold : o.threshold;
  LL_RETURN_IF_ERROR(check_params(o.params));
  LL_RETURN_IF_ERROR(check_threads(o.threads));
  LL_RETURN_IF_ERROR(check_input(o.scene));
  return OutputCheck({o.scene}).loom("-o", o.output);
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
  LL_ASSIGN_OR_RETURN(const BakeReport report, bake(*level.tracer, o.params, o.output, control));
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
  BakeParams& p = o->params;
  return {"bake",
          "Bake a level into a .loom asset",
          {{"SCENE", "level, .glb or .gltf", &o->scene, true},
           {"-o,--output", "OUT.loom, a folder", &o->output, true},
           {"--method", "default, or sl17: Silvennoinen & Lehtinen 2017 as published, to compare with", &o->method},
           {"--spacing", "side of a probe cell, metres; 0: chosen from the level", &p.spacing},
           {"--order", "spherical harmonics order of the probes, 0 to 9", &p.order},
           {"--probes", "sl17: how many, instead of by --spacing; 0: by --spacing", &p.probes},
           {"--links", "probes that each receiver reads; −1: 6 (sl17: 10 on average)", &o->links},
           {"--rays", "gather rays per receiver, rounded up to a × b with a ≤ b ≤ 2a", &p.rays},
           {"--relight-rays", "rays of each probe at run time; −1: 4096 (sl17: 8000)", &o->relight_rays},
           {"--max-rank", "most coefficients of a cluster", &p.max_rank},
           {"--threshold", "relative error at which a cluster's rank ends; −1: 0.02 (sl17: 0.005)", &o->threshold},
           {"--cell-receivers", "a bake cell holds fewer receivers than this", &p.cell_receivers},
           {"--texels-per-metre", "lightmap density; 0: chosen from the level", &p.texels_per_metre},
           {"--lightmap-size", "side of the scene atlas, texels; 0: from the density", &p.lightmap_size},
           {"--seed", "of all random numbers", &p.seed},
           {"--threads", "0: one per hardware thread", &o->threads},
           {"--json", "print the report as JSON", &o->json}},
          [o] { return check(o.get()); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
