// lightloom bake: a level becomes a .loom asset.
#include <sys/resource.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <system_error>

#include "cli/bake_options.h"
#include "cli/command.h"
#include "cli/farm_command.h"
#include "cli/farm_print.h"
#include "cli/farm_steps.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "cli/level.h"
#include "cli/local_bake.h"
#include "cli/outlook.h"
#include "cli/print_json.h"
#include "cli/print_tuning.h"
#include "cli/progress.h"
#include "core/bake/bake.h"
#include "core/base/stopwatch.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

struct Options {
  std::string scene, output;
  BakeOptions how;
  bool fresh = false, explain = false, dry_run = false, progress = false;
  float tolerance = 0;
  int threads = 0;
  FarmOptions farm;  // its server empty: on this machine
};

/// Of this process, bytes.
uint64_t peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024 * static_cast<uint64_t>(usage.ru_maxrss);
}

double percent(uint64_t part, uint64_t of) {
  return of > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(of) : 0;
}

/// What the asset says.
nlohmann::json asset_json(const BakeReport& r) {
  return {
      {"receivers", r.receivers},
      {"probes", r.probes},
      {"probes_repair", r.repairs},
      {"cells", r.cells},
      {"clusters", r.clusters},
      {"coefficients_per_receiver", r.coefficients},
      {"rays_gather", r.rays_gather},
      {"rays_relight", r.rays_relight},
      {"unseen_fraction", r.rays_gather > 0 ? static_cast<double>(r.unseen) / static_cast<double>(r.rays_gather) : 0.0},
      {"stale", {{"cells", r.cells_stale}, {"share", r.stale}}},
      {"seconds", {{"total", r.seconds_total}, {"write", r.seconds_write}}},
      {"bytes",
       {{"total", r.bytes_total},
        {"projection", r.bytes_projection},
        {"reconstruction", r.bytes_reconstruction},
        {"relight", r.bytes_relight}}}};
}

nlohmann::json to_json(const BakeReport& r) {
  nlohmann::json out = asset_json(r);
  out.update({{"clusters_reused", r.clusters_reused},
              {"cells_reused", r.cells_reused},
              {"probes_reused", r.probes_reused},
              {"rays_visibility", r.rays_visibility},
              {"seconds",
               {{"plan", r.seconds_plan},
                {"receivers", r.seconds_receivers},
                {"probes", r.seconds_probes},
                {"transport", r.seconds_transport},
                {"compress", r.seconds_compress},
                {"relight", r.seconds_relight}}},
              {"bytes", {{"peak_memory", peak_memory()}}}},
             /*merge_objects=*/true);
  return out;
}

/// How long the stages took on which worker is not known here.
nlohmann::json to_json(const FarmBake& baked) {
  nlohmann::json out = asset_json(baked.report);
  out["job"] = baked.job.id;
  out["tasks"] = baked.job.tasks;
  out["tasks_reused"] = baked.job.reused;
  return out;
}

void print_asset(const std::string& output, const BakeReport& r) {
  std::printf("%s: %s\n", escape_controls(output).c_str(), human_bytes(static_cast<double>(r.bytes_total)).c_str());
  std::printf(
      "  %llu receivers, %llu probes (%llu of them repairs), %llu clusters in %llu cells, %.1f coefficients a "
      "receiver\n",
      static_cast<unsigned long long>(r.receivers), static_cast<unsigned long long>(r.probes),
      static_cast<unsigned long long>(r.repairs), static_cast<unsigned long long>(r.clusters),
      static_cast<unsigned long long>(r.cells), r.coefficients);
}

void print_quality(const BakeReport& r) {
  if (r.stale > 0) {
    std::printf(
        "  %llu of the cells are stale, by an estimated %.2g %% of their light at most: bake without --tolerance to "
        "finish\n",
        static_cast<unsigned long long>(r.cells_stale), 100 * r.stale);
  }
  std::printf("  unseen by any probe: %.4f %% of gather rays\n", percent(r.unseen, r.rays_gather));
}

void print(const std::string& output, const BakeReport& r) {
  print_asset(output, r);
  if (r.cells_reused > 0) {
    std::printf("  %llu of the cells and %llu of the relight sets are the earlier bake's\n",
                static_cast<unsigned long long>(r.cells_reused), static_cast<unsigned long long>(r.probes_reused));
  }
  const double rays = static_cast<double>(r.rays_gather - r.rays_gather_reused + r.rays_visibility);
  std::printf("  %s: plan %s, transport %s (%srays, %srays/s), compression %s\n",
              human_seconds(r.seconds_total).c_str(), human_seconds(r.seconds_plan).c_str(),
              human_seconds(r.seconds_transport).c_str(), human_count(rays).c_str(),
              human_count(r.seconds_transport > 0 ? rays / r.seconds_transport : 0).c_str(),
              human_seconds(r.seconds_compress).c_str());
  print_quality(r);
}

void print(const std::string& output, const FarmBake& baked) {
  print_asset(output, baked.report);
  std::printf("  %s as job %llu: %s, %srays, fetched in %s\n", human_seconds(baked.report.seconds_total).c_str(),
              static_cast<unsigned long long>(baked.job.id), progress_line(baked.job).c_str(),
              human_count(static_cast<double>(baked.job.rays)).c_str(),
              human_seconds(baked.report.seconds_write).c_str());
  print_quality(baked.report);
}

absl::Status check(Options* o) {
  LL_RETURN_IF_ERROR(o->how.check());
  LL_RETURN_IF_ERROR(check_threads(o->threads));
  if (!(o->tolerance >= 0 && o->tolerance < 1)) {
    return absl::InvalidArgumentError("--tolerance must be at least 0 and less than 1");
  }
  if (o->farm.server.empty()) {
    LL_RETURN_IF_ERROR(check_input(o->scene));
  } else {
    LL_RETURN_IF_ERROR(o->farm.check());
    LL_RETURN_IF_ERROR(check_farm_level(o->scene));
    if (o->threads != 0) {
      return absl::InvalidArgumentError("--threads is for bakes on this machine; each worker of a farm has its own");
    }
    if (o->explain || o->dry_run) {
      return absl::InvalidArgumentError("--explain and --dry-run are for bakes on this machine: leave out --server");
    }
  }
  return OutputCheck({o->scene}).loom("-o", o->output);
}

absl::Status run_on_farm(const Options& o, const BakeParams& params, const EarlierBake* earlier,
                         const std::optional<Tuning>& tuning) {
  FarmClient farm = o.farm.connect();
  LL_ASSIGN_OR_RETURN(const FarmBake baked, farm_bake(&farm, o.farm.server, o.scene, params, earlier, o.output));
  if (o.farm.json) {
    nlohmann::json out = to_json(baked);
    if (tuning) out["tuning"] = to_json(*tuning);
    print_json(out);
  } else {
    print(o.output, baked);
  }
  return absl::OkStatus();
}

absl::Status print_report(const Options& o, const BakeReport& report, const std::optional<Tuning>& tuning) {
  if (o.farm.json) {
    nlohmann::json out = to_json(report);
    if (tuning) out["tuning"] = to_json(*tuning);
    print_json(out);
  } else {
    print(o.output, report);
  }
  return absl::OkStatus();
}

absl::Status run(const Options& o) {
  cancel_on_interrupt();
  const Stopwatch watch;
  LL_ASSIGN_OR_RETURN(const Level level, load_level(o.scene));
  std::optional<EarlierBake> earlier;
  if (!o.fresh) earlier = find_earlier_bake(o.output);
  ProgressBar bar;
  if (o.progress) bar.print_lines();
  BakeControl control;
  control.threads = o.threads;
  control.cancel = &interrupted();
  control.progress = [&](const std::string& stage, uint64_t done, uint64_t total, uint64_t rays) {
    bar.update(stage, done, total, rays);
  };
  const BakeParams* of_earlier = earlier ? &earlier->manifest.params : nullptr;
  if (!o.farm.server.empty() && o.how.target(of_earlier)) {
    LL_RETURN_IF_ERROR(o.farm.connect().check_server());  // before time is spent on parameters
  }
  std::optional<Tuning> tuning;
  LL_ASSIGN_OR_RETURN(const BakeParams params, o.how.tuned(*level.tracer, of_earlier, control, &tuning));
  bar.finish();
  if (tuning && !o.farm.json) print(*tuning);
  std::string anew;
  if (earlier) {
    earlier->tolerance = static_cast<double>(o.tolerance);
    anew = earlier->why_not;
  } else if (std::error_code unknown; !o.fresh && std::filesystem::exists(o.output + "/manifest", unknown)) {
    anew = "its manifest cannot be read, nor the parameters there";
  }
  if (!anew.empty()) {
    std::fprintf(stderr, "lightloom: %s is baked anew: %s\n", escape_controls(o.output).c_str(), anew.c_str());
  }
  if (earlier && !earlier->traces.empty() && !o.dry_run && is_up_to_date(*earlier, *level.scene, params)) {
    BakeReport report = report_of(earlier->manifest);
    report.cells_reused = report.cells;
    report.clusters_reused = report.clusters;
    report.probes_reused = report.probes;
    report.rays_gather_reused = report.rays_gather;
    report.seconds_total = watch.seconds();
    return print_report(o, report, tuning);
  }
  if (!o.farm.server.empty()) return run_on_farm(o, params, earlier ? &*earlier : nullptr, tuning);

  LocalBake bake{params, o.output, earlier ? &*earlier : nullptr, nullptr};
  bake.planned = [&](const BakeSession& session, const Reuse& reuse) {
    if (!o.explain && !o.dry_run) return true;
    bar.finish();
    const Outlook outlook(session.plan(), reuse);
    if (o.farm.json && o.dry_run) {
      nlohmann::json out = outlook.to_json(o.explain);
      if (tuning) out["tuning"] = to_json(*tuning);
      print_json(out);
    } else if (!o.farm.json) {
      outlook.print(o.explain);
    }
    return !o.dry_run;
  };
  LL_ASSIGN_OR_RETURN(const BakeReport report, local_bake(*level.tracer, bake, control));
  bar.finish();
  return o.dry_run ? absl::OkStatus() : print_report(o, report, tuning);
}

}  // namespace

Command bake_command() {
  const auto o = std::make_shared<Options>();
  std::vector<Option> options = {{"SCENE", "level, .glb or .gltf", &o->scene, true},
                                 {"-o,--output", "OUT.loom, a folder", &o->output, true}};
  for (Option& option : o->how.options()) options.push_back(std::move(option));
  options.push_back({"--fresh", "bake everything, by the parameters given here, whatever OUT.loom holds", &o->fresh});
  options.push_back({"--tolerance",
                     "keep cells of the earlier bake of whose light an estimated share up to this has changed; 0: none",
                     &o->tolerance});
  options.push_back({"--dry-run", "bake nothing: print what there is to bake", &o->dry_run});
  options.push_back({"--explain", "print why each cell is baked", &o->explain});
  options.push_back({"--progress", "print lines 'progress STAGE DONE TOTAL' on stderr, for programs", &o->progress});
  options.push_back({"--threads", "0: one per hardware thread", &o->threads});
  Option server = o->farm.server_option(/*required=*/false);
  server.help += ", which bakes it; empty: this machine does";
  options.push_back(std::move(server));
  options.push_back(o->farm.timeout_option());
  options.push_back({"--json", "print the report as JSON", &o->farm.json});
  return {"bake", "Bake a level into a .loom asset; if that is there, by its parameters, and only what has changed",
          std::move(options), [o] { return check(o.get()); }, [o] { return run(*o); }};
}

}  // namespace lightloom
