#include "cli/eval/evaluation.h"

#include <cctype>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "cli/interrupt.h"
#include "core/base/file.h"
#include "core/base/random_id.h"
#include "core/base/version.h"
#include "core/reference/compare.h"
#include "core/reference/path_tracer.h"

namespace lightloom::eval {
namespace {

std::string file_name(const std::string& label) {
  std::string name;
  for (const char c : label) name += std::isalnum(static_cast<unsigned char>(c)) || c == '.' ? c : '_';
  return name;
}

/// All that a run's errors depend on, and how its times were taken; not on which machine, which the run itself says.
std::string key_of(const LitLevel& level, const Request& request, const Method& method, const Variant& variant) {
  Hasher h;
  h.string("run").string(kMethodVersion).string(kReferenceVersion).string(method.version());
  h.digest(level.digest()).string(method.name()).string(variant.label);
  for (const auto& [name, value] : variant.settings) h.string(name).value(value);
  const TruthOptions& t = request.truth;
  h.value(request.bounces).value(t.samples).value(t.most_samples).value(t.noise);
  h.value(level.plan().params.seed).value(level.threads());
  h.value(level.plan().params.texels_per_metre).value(level.plan().params.lightmap_size);
  h.value(level.elements().layout.width).value(level.elements().layout.height);
  if (method.has_frames()) h.value(request.frames);
  for (size_t i = 0; i < level.rigs(); ++i) h.string(level.name(i));
  return h.finish().hex();
}

/// Processor and threads.
std::string machine(int threads) {
  const std::string on = ", " + std::to_string(thread_count(threads)) + " threads";
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2) + on;
  }
  return "unknown processor" + on;
}

/// Pictures are made of them.
bool lightmaps_missing(const Request& request, const Method& method, size_t rigs) {
  std::error_code unknown;
  for (size_t i = 0; i < rigs; ++i) {
    if (!std::filesystem::exists(lightmap_path(request.folder, method.name(), i), unknown)) return true;
  }
  return false;
}

/// One round: prepares the variant once more, and the first time lights and judges it.
absl::Status measure(LitLevel* level, const Request& request, const Method& method, const Variant& variant,
                     const std::vector<Truth>& truths, bool keep_lightmaps, const std::filesystem::path& path,
                     Run* run) {
  const std::filesystem::path scratch = std::filesystem::path(request.folder) / ("scratch-" + random_id());
  struct Remove {
    const std::filesystem::path& path;
    ~Remove() {
      std::error_code unheard;
      std::filesystem::remove_all(path, unheard);
    }
  } const remove{scratch};
  LL_ASSIGN_OR_RETURN(const std::unique_ptr<Model> model, method.prepare(level, variant.settings, scratch));
  LL_RETURN_IF_ERROR(not_interrupted());

  if (run->rigs.empty()) {
    std::error_code none;
    std::filesystem::remove(path, none);  // its lightmaps go one by one: those of two runs must not pass for one's
    for (size_t i = 0; i < level->rigs(); ++i) {
      LL_ASSIGN_OR_RETURN(const Image e, model->light(i, request.bounces));
      LL_RETURN_IF_ERROR(not_interrupted());
      LL_ASSIGN_OR_RETURN(const Comparison c, compare(e, truths[i].image, {}));
      run->rigs.push_back({level->name(i), c.rel_rmse, truths[i].noise, c.bias, c.p50, c.p95, c.p99});
      if (keep_lightmaps) LL_RETURN_IF_ERROR(write_exr(e, lightmap_path(request.folder, method.name(), i)));
    }
  } else if (model->facts().seconds == 0) {
    for (size_t i = 0; i < level->rigs(); ++i) LL_RETURN_IF_ERROR(model->light(i, request.bounces).status());
  }
  LL_ASSIGN_OR_RETURN(const std::vector<double> ms, model->frame_ms(request.frames));
  run->frame_ms.insert(run->frame_ms.end(), ms.begin(), ms.end());
  run->facts = model->facts();
  run->add_times(model->facts());
  run->machines.insert(machine(level->threads()));
  return absl::OkStatus();
}

}  // namespace

std::filesystem::path lightmap_path(const std::string& folder, const std::string& method, size_t rig) {
  return std::filesystem::path(folder) / "lightmaps" / method / (std::to_string(rig) + ".exr");
}

std::filesystem::path truth_path(const std::string& folder, size_t rig) {
  return std::filesystem::path(folder) / "truth" / (std::to_string(rig) + ".exr");
}

const Run* default_run(const Evaluation& evaluation, const std::string& method) {
  for (const Run& run : evaluation.runs) {
    if (run.method == method) return &run;
  }
  return nullptr;
}

absl::StatusOr<Evaluation> evaluate(LitLevel* level, const std::string& name, const Request& request) {
  Evaluation out;
  out.level = name;
  out.machine = machine(level->threads());
  out.receivers = level->elements().receivers.all.size();
  for (const Object& o : level->scene().objects) out.triangles += o.triangles.size();
  out.bounces = request.bounces;

  std::vector<Truth> truths;
  for (size_t i = 0; i < level->rigs(); ++i) {
    LL_ASSIGN_OR_RETURN(truths.emplace_back(),
                        level->truth(i, request.truth, std::filesystem::path(request.folder) / "truth"));
    out.rigs.push_back({level->name(i), truths.back().noise, truths.back().samples});
  }

  struct Job {
    const Method* method;
    Variant variant;
    bool first;  ///< its method's default
    std::filesystem::path path;
    Run run;
  };
  std::vector<Job> jobs;
  for (const Method* method : request.methods) {
    out.methods.push_back({method->name(), method->title(), method->about()});
    bool first = true;
    for (Variant& variant : method->sweep(*level, request.quick)) {
      Job job{method, std::move(variant), first, {}, {}};
      first = false;
      job.run.key = key_of(*level, request, *method, job.variant);
      job.run.method = method->name();
      job.run.label = job.variant.label;
      job.run.settings = job.variant.settings;
      job.path = std::filesystem::path(request.folder) / "runs" /
                 (method->name() + "-" + file_name(job.variant.label) + ".json");
      auto run = load_run(job.path, job.run.key);
      if (run && !(job.first && lightmaps_missing(request, *method, level->rigs()))) job.run = *std::move(run);
      jobs.push_back(std::move(job));
    }
  }
  // Rounds, so that a machine that slows down for a while slows down all of them.
  for (size_t round = 0; round < static_cast<size_t>(request.repeats); ++round) {
    for (size_t i = 0; i < jobs.size(); ++i) {
      Job& job = jobs[i];
      if (job.run.seconds.size() > round) continue;
      LL_RETURN_IF_ERROR(measure(level, request, *job.method, job.variant, truths, job.first, job.path, &job.run));
      LL_RETURN_IF_ERROR(save(job.run, job.path));
      level->bar()->finish();
      std::fprintf(stderr, "%zu of %zu: %s, %s: error %.4f, %.1f s, %s, %.2f ms a frame\n", i + 1, jobs.size(),
                   job.run.method.c_str(), job.run.label.c_str(), job.run.error(), job.run.facts.seconds,
                   human_bytes(static_cast<double>(job.run.facts.bytes)).c_str(), job.run.frame());
    }
  }
  for (Job& job : jobs) out.runs.push_back(std::move(job.run));
  if (default_run(out, kDefaultMethod) != nullptr) {
    std::vector<Image> lightmaps;
    for (size_t i = 0; i < level->rigs(); ++i) {
      LL_ASSIGN_OR_RETURN(lightmaps.emplace_back(), read_exr(lightmap_path(request.folder, kDefaultMethod, i)));
    }
    LL_ASSIGN_OR_RETURN(out.expected, expected_error(level, truths, lightmaps));
    level->bar()->finish();
  }
  return out;
}

absl::Status save(const Evaluation& e, const std::filesystem::path& path) {
  nlohmann::json rigs = nlohmann::json::array(), methods = nlohmann::json::array(), runs = nlohmann::json::array();
  for (const auto& r : e.rigs) rigs.push_back({{"name", r.name}, {"noise", r.noise}, {"samples", r.samples}});
  for (const auto& m : e.methods) methods.push_back({{"name", m.name}, {"title", m.title}, {"about", m.about}});
  for (const Run& r : e.runs) runs.push_back(to_json(r));
  nlohmann::json json = {{"level", e.level},         {"machine", e.machine}, {"receivers", e.receivers},
                         {"triangles", e.triangles}, {"bounces", e.bounces}, {"rigs", rigs},
                         {"methods", methods},       {"runs", runs}};
  if (e.expected) {
    json["expected_error"] = {{"rank_correlation", e.expected->correlation()},
                              {"noise", e.expected->noise},
                              {"norm", e.expected->norm},
                              {"error", e.expected->error},
                              {"own_rank_correlation", e.expected->own_correlation()},
                              {"own_error", e.expected->own_error}};
  }
  return write_file_atomic(path, json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

absl::StatusOr<Evaluation> load_evaluation(const std::filesystem::path& path) {
  LL_ASSIGN_OR_RETURN(const auto bytes, read_file(path));
  try {
    const auto json = nlohmann::json::parse(bytes.begin(), bytes.end());
    Evaluation e;
    e.level = json.at("level");
    e.machine = json.at("machine");
    e.receivers = json.at("receivers");
    e.triangles = json.at("triangles");
    e.bounces = json.at("bounces");
    for (const auto& r : json.at("rigs")) e.rigs.push_back({r.at("name"), r.at("noise"), r.at("samples")});
    for (const auto& m : json.at("methods")) e.methods.push_back({m.at("name"), m.at("title"), m.at("about")});
    for (const auto& r : json.at("runs")) e.runs.push_back(run_from_json(r));
    if (json.contains("expected_error")) {
      const auto& x = json.at("expected_error");
      e.expected = ExpectedError{x.at("norm"), x.at("error"), x.at("own_error"), x.at("noise")};
    }
    return e;
  } catch (const nlohmann::json::exception& error) {
    return absl::InvalidArgumentError(path.string() + " is no evaluation: make it again with lightloom eval");
  }
}

}  // namespace lightloom::eval
