// lightloom eval: speed against accuracy, charted.
#include <absl/strings/str_split.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "cli/command.h"
#include "cli/eval/evaluation.h"
#include "cli/eval/pool.h"
#include "cli/eval/report.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/base/file.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

using namespace eval;

struct Options {
  std::string scene, lights, output, methods, curve, stability, name;
  std::vector<std::string> pool;
  bool quick = false, json = false;
  int bounces = 1, repeats = 1, frames = 9, rigs = 0, threads = 0, samples = 1024, most_samples = 4096,
      lightmap_size = 0;
  float texels_per_metre = 0, spacing = 0, noise = 0.02f;
  uint64_t seed = 0;

  BakeParams params() const {
    BakeParams p;
    p.spacing = spacing;
    p.texels_per_metre = texels_per_metre;
    p.lightmap_size = lightmap_size;
    p.seed = seed;
    return p;
  }
};

absl::StatusOr<std::vector<const Method*>> choose(const std::string& names) {
  std::vector<const Method*> chosen;
  std::string known;
  for (const auto& m : all_methods()) {
    known += (known.empty() ? "" : ", ") + m->name();
    if (names.empty()) chosen.push_back(m.get());
  }
  if (names.empty()) return chosen;
  for (const std::string& name : std::vector<std::string>(absl::StrSplit(names, ','))) {
    const Method* found = nullptr;
    for (const auto& m : all_methods()) found = m->name() == name ? m.get() : found;
    if (found == nullptr) {
      return absl::InvalidArgumentError("--methods has '" + printable(name) + "'; there are: " + known);
    }
    if (std::find(chosen.begin(), chosen.end(), found) == chosen.end()) chosen.push_back(found);
  }
  return chosen;
}

absl::Status check(const Options& o) {
  const auto bad = [](const std::string& what) { return absl::InvalidArgumentError(what); };
  if (!o.pool.empty()) {
    if (!o.scene.empty() || !o.lights.empty()) return bad("--pool goes without SCENE and --lights: leave them out");
    for (const std::string& folder : o.pool) {
      LL_RETURN_IF_ERROR(check_input(folder + "/evaluation.json"));
      std::error_code unknown;
      if (std::filesystem::equivalent(folder, o.output, unknown)) {
        return bad("-o is a folder of --pool, whose report it would replace: give another one");
      }
    }
    return OutputCheck(o.pool).file("-o", o.output + "/report.html", {".html"});
  }
  if (o.scene.empty()) return bad("SCENE is required, or --pool");
  LL_RETURN_IF_ERROR(check_level(o.scene, o.lights, ""));
  LL_RETURN_IF_ERROR(choose(o.methods).status());
  LL_RETURN_IF_ERROR(check_params(o.params()));
  LL_RETURN_IF_ERROR(check_threads(o.threads));
  if (o.bounces < 1 || o.bounces > 1000) return bad("--bounces must be 1 to 1000");
  if (o.repeats < 1 || o.repeats > 1000) return bad("--repeats must be 1 to 1000");
  if (o.frames < 1 || o.frames > 10000) return bad("--frames must be 1 to 10000");
  if (o.rigs < 0) return bad("--rigs must be 0 (all) or more");
  if (o.samples < 2) return bad("--samples must be ≥ 2");
  if (o.most_samples < o.samples) return bad("--most-samples must be at least --samples");
  if (!(o.noise > 0)) return bad("--noise must be above 0");
  if (!o.curve.empty()) LL_RETURN_IF_ERROR(read_curve(o.curve).status());
  if (!o.stability.empty()) LL_RETURN_IF_ERROR(read_stability(o.stability).status());
  return OutputCheck({o.scene, o.lights, o.curve}).file("-o", o.output + "/report.html", {".html"});
}

nlohmann::json at_equal(const Equals& e) {
  const auto or_null = [](std::optional<double> value) { return value ? nlohmann::json(*value) : nlohmann::json(); };
  return {{"error_in_bytes", or_null(e.error_in_bytes)},
          {"bytes_for_error", or_null(e.bytes_for_error)},
          {"error_in_core_seconds", or_null(e.error_in_core_seconds)},
          {"core_seconds_for_error", or_null(e.core_seconds_for_error)}};
}

nlohmann::json to_json(const Evaluation& e) {
  nlohmann::json methods = nlohmann::json::object();
  for (const auto& m : e.methods) {
    const Run* run = default_run(e, m.name);
    if (run == nullptr) continue;
    nlohmann::json beaten_in = nlohmann::json::array();
    for (const Beaten& b : beaten(e, *run)) beaten_in.push_back(b.cost);
    methods[m.name] = {{"title", m.title},
                       {"rel_rmse_geomean", run->error()},
                       {"rel_rmse_worst", run->worst()},
                       {"seconds", {{"total", run->facts.seconds}, {"core", run->facts.core_seconds}}},
                       {"bytes", {{"total", run->facts.bytes}, {"frame", run->facts.frame_bytes}}},
                       {"frame_ms", run->frame()},
                       {"probes", run->facts.probes},
                       {"order", methods.size()},
                       {"at_equal", at_equal(equals(e, m.name))},
                       {"beaten_in", beaten_in}};
  }
  nlohmann::json out = {{"level", e.level},         {"machine", e.machine},      {"rigs", e.rigs.size()},
                        {"receivers", e.receivers}, {"variants", e.runs.size()}, {"methods", methods}};
  if (e.expected) {
    out["operator_norm_rank_correlation"] = {{"relative_to_own_light", e.expected->own_correlation()},
                                             {"relative_to_mean", e.expected->correlation()}};
  }
  return out;
}

void print(const Options& o, const Evaluation& e) {
  std::printf("%-18s %8s %8s %8s %10s %10s  not on the front of\n", "method", "error", "worst", "bake, s", "MB",
              "frame, ms");
  for (const auto& m : e.methods) {
    const Run* run = default_run(e, m.name);
    std::string off;
    for (const Beaten& b : beaten(e, *run)) off += (off.empty() ? "" : "; ") + b.cost;
    std::printf("%-18s %8.4f %8.4f %8.1f %10.2f %10.2f  %s\n", m.title.c_str(), run->error(), run->worst(),
                run->facts.seconds, static_cast<double>(run->facts.bytes) / 1e6, run->frame(),
                off.empty() ? "-" : off.c_str());
  }
  std::printf("%s/report.html\n", escape_controls(o.output).c_str());
}

void show(const Options& o, const Evaluation& e) {
  if (o.json) {
    print_json(to_json(e));
  } else {
    print(o, e);
  }
}

absl::Status write_charts(const Options& o, const std::vector<NamedChart>& charts) {
  for (const NamedChart& c : charts) {
    LL_RETURN_IF_ERROR(write_file_atomic(std::filesystem::path(o.output) / (c.name + ".svg"), chart_svg(c.chart)));
  }
  return absl::OkStatus();
}

absl::Status run_pool(const Options& o) {
  std::vector<Evaluation> levels;
  std::string command = "lightloom eval --pool";
  for (const std::string& folder : o.pool) {
    LL_ASSIGN_OR_RETURN(levels.emplace_back(), load_evaluation(std::filesystem::path(folder) / "evaluation.json"));
    command += " " + std::filesystem::path(folder).lexically_normal().filename().string();
  }
  LL_ASSIGN_OR_RETURN(const Evaluation e, pool(levels));
  const auto charts = make_charts(e, nullptr);
  const std::filesystem::path out(o.output);
  LL_RETURN_IF_ERROR(write_charts(o, charts));
  LL_RETURN_IF_ERROR(write_file_atomic(out / "results.csv", results_csv(e.level, e.runs)));
  LL_RETURN_IF_ERROR(write_file_atomic(out / "levels.csv", rigs_csv(e.level, e.runs)));
  command += " -o " + out.lexically_normal().filename().string();
  LL_ASSIGN_OR_RETURN(const std::string html, report_html({e, charts, {}, nullptr, {}, command, levels}));
  LL_RETURN_IF_ERROR(write_file_atomic(out / "report.html", html));
  show(o, e);
  return absl::OkStatus();
}

/// As it would be typed again.
std::string command_of(const Options& o) {
  const std::filesystem::path scene(o.scene);
  std::string out = "lightloom eval " + scene.filename().string();
  if (!o.lights.empty()) out += " --lights " + std::filesystem::path(o.lights).filename().string();
  if (o.quick) out += " --quick";
  if (!o.methods.empty()) out += " --methods " + o.methods;
  if (o.bounces != 1) out += " --bounces " + std::to_string(o.bounces);
  if (o.rigs != 0) out += " --rigs " + std::to_string(o.rigs);
  if (o.lightmap_size != 0) out += " --lightmap-size " + std::to_string(o.lightmap_size);
  if (o.texels_per_metre > 0) out += " --texels-per-metre " + std::to_string(o.texels_per_metre);
  if (o.spacing > 0) out += " --spacing " + std::to_string(o.spacing);
  return out + " -o " + std::filesystem::path(o.output).filename().string();
}

absl::Status run(const Options& o) {
  if (!o.pool.empty()) return run_pool(o);
  cancel_on_interrupt();
  ProgressBar bar;
  Request request;
  request.folder = o.output;
  LL_ASSIGN_OR_RETURN(request.methods, choose(o.methods));
  request.quick = o.quick;
  request.bounces = o.bounces;
  request.frames = o.frames;
  request.repeats = o.repeats;
  request.truth = {o.bounces, o.samples, o.most_samples, static_cast<double>(o.noise)};
  std::optional<Curve> curve;
  if (!o.curve.empty()) {
    LL_ASSIGN_OR_RETURN(curve, read_curve(o.curve));
  }
  std::vector<StabilityRow> stability;
  if (!o.stability.empty()) {
    LL_ASSIGN_OR_RETURN(stability, read_stability(o.stability));
  }
  LL_ASSIGN_OR_RETURN(LitLevel level, LitLevel::create(o.scene, o.lights, o.rigs == 0 && o.quick ? 3 : o.rigs,
                                                       o.params(), o.threads, &bar));
  const std::string name = o.name.empty() ? std::filesystem::path(o.scene).stem().string() : o.name;
  LL_ASSIGN_OR_RETURN(const Evaluation e, evaluate(&level, name, request));
  LL_ASSIGN_OR_RETURN(const auto sheets, make_pictures(&level, e, o.output));
  bar.finish();

  const std::filesystem::path out(o.output);
  const auto charts = make_charts(e, curve ? &*curve : nullptr);
  LL_RETURN_IF_ERROR(write_charts(o, charts));
  LL_RETURN_IF_ERROR(write_file_atomic(out / "results.csv", results_csv(name, e.runs)));
  LL_RETURN_IF_ERROR(write_file_atomic(out / "rigs.csv", rigs_csv(name, e.runs)));
  LL_RETURN_IF_ERROR(save(e, out / "evaluation.json"));
  LL_ASSIGN_OR_RETURN(const std::string html,
                      report_html({e, charts, sheets, curve ? &*curve : nullptr, stability, command_of(o), {}}));
  LL_RETURN_IF_ERROR(write_file_atomic(out / "report.html", html));
  show(o, e);
  return absl::OkStatus();
}

}  // namespace

Command eval_command() {
  const auto o = std::make_shared<Options>();
  return {
      "eval",
      "Chart speed against accuracy: our bake, its settings, and other methods, judged by path tracing",
      {{"SCENE", "level, .glb or .gltf", &o->scene},
       {"-o,--output", "folder for report.html, charts, results.csv; what is there already is not measured again",
        &o->output, true},
       {"--pool", "folders of earlier evaluations, in place of SCENE: their levels as one", &o->pool},
       {"--lights", "lights.json with the rigs to judge by; empty: the level's own lights", &o->lights},
       {"--rigs", "use so many of them; 0: all, 3 with --quick", &o->rigs},
       {"--methods", "some of them, as a,b; the first is compared with the others; empty: all", &o->methods},
       {"--quick", "few settings of each method", &o->quick},
       {"--name", "of the level in the report; empty: the file's", &o->name},
       {"--bounces", "of the light that is compared", &o->bounces},
       {"--repeats", "bakes of each setting, in rounds: times are medians", &o->repeats},
       {"--frames", "timed per setting", &o->frames},
       {"--samples", "paths per texel of the truth to begin with; four times as many while it is too noisy",
        &o->samples},
       {"--most-samples", "and then as it is", &o->most_samples},
       {"--noise", "of the truth that is small enough, in units of rel_rmse", &o->noise},
       {"--spacing", "side of the default's probe cell, metres, around which the sweep goes; 0: chosen from the level",
        &o->spacing},
       {"--texels-per-metre", "lightmap density; 0: chosen from the level", &o->texels_per_metre},
       {"--lightmap-size", "side of the scene atlas, texels; 0: from the density", &o->lightmap_size},
       {"--curve", "CSV of another renderer's errors, core_seconds,error,words: drawn beside", &o->curve},
       {"--stability", "folder of tests/stability/report: its table goes into the report", &o->stability},
       {"--seed", "of the bakes", &o->seed},
       {"--threads", "0: one per hardware thread", &o->threads},
       {"--json", "print the result as JSON", &o->json}},
      [o] { return check(*o); },
      [o] { return run(*o); }};
}

}  // namespace lightloom
