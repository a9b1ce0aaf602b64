#include "cli/eval/run.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/base/file.h"

namespace lightloom::eval {
namespace {

/// A field of a CSV, quoted where it must be.
std::string field(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? "\"\"" : std::string(1, c);
  return out + "\"";
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

}  // namespace

double RigError::error() const { return std::sqrt(std::max(rel_rmse * rel_rmse - noise * noise, noise * noise / 16)); }

double Run::error() const {
  double sum = 0;
  for (const RigError& r : rigs) sum += std::log(std::max(1e-12, r.error()));
  return rigs.empty() ? 0 : std::exp(sum / static_cast<double>(rigs.size()));
}

double Run::worst() const {
  double worst = 0;
  for (const RigError& r : rigs) worst = std::max(worst, r.error());
  return worst;
}

double Run::frame() const { return median(frame_ms); }

void Run::add_times(const Facts& of_one) {
  seconds.push_back(of_one.seconds);
  core_seconds.push_back(of_one.core_seconds);
  facts.seconds = median(seconds);
  facts.core_seconds = median(core_seconds);
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(values.begin(), middle)) / 2;
}

nlohmann::json to_json(const Run& run) {
  nlohmann::json rigs = nlohmann::json::array();
  for (const RigError& r : run.rigs) {
    rigs.push_back({{"rig", r.rig},
                    {"rel_rmse", r.rel_rmse},
                    {"noise", r.noise},
                    {"bias", r.bias},
                    {"p50", r.p50},
                    {"p95", r.p95},
                    {"p99", r.p99}});
  }
  return {{"key", run.key},
          {"method", run.method},
          {"label", run.label},
          {"settings", run.settings},
          {"seconds", run.seconds},
          {"core_seconds", run.core_seconds},
          {"stages", run.facts.stages},
          {"bytes", run.facts.bytes},
          {"frame_bytes", run.facts.frame_bytes},
          {"probes", run.facts.probes},
          {"frame_ms", run.frame_ms},
          {"rigs", rigs},
          {"machines", run.machines}};
}

Run run_from_json(const nlohmann::json& json) {
  Run run;
  run.key = json.at("key");
  run.method = json.at("method");
  run.label = json.at("label");
  run.settings = json.at("settings").get<Settings>();
  run.facts.stages = json.at("stages").get<std::map<std::string, double>>();
  run.facts.bytes = json.at("bytes");
  run.facts.frame_bytes = json.at("frame_bytes");
  run.facts.probes = json.at("probes");
  run.seconds = json.at("seconds").get<std::vector<double>>();
  run.core_seconds = json.at("core_seconds").get<std::vector<double>>();
  run.facts.seconds = median(run.seconds);
  run.facts.core_seconds = median(run.core_seconds);
  run.frame_ms = json.at("frame_ms").get<std::vector<double>>();
  run.machines = json.value("machines", std::set<std::string>());
  for (const auto& r : json.at("rigs")) {
    run.rigs.push_back(
        {r.at("rig"), r.at("rel_rmse"), r.at("noise"), r.at("bias"), r.at("p50"), r.at("p95"), r.at("p99")});
  }
  return run;
}

absl::Status save(const Run& run, const std::filesystem::path& path) {
  return write_file_atomic(path, to_json(run).dump(1) + "\n");
}

std::optional<Run> load_run(const std::filesystem::path& path, const std::string& key) {
  const auto bytes = read_file(path);
  if (!bytes.ok()) return std::nullopt;
  try {
    Run run = run_from_json(nlohmann::json::parse(bytes->begin(), bytes->end()));
    if (run.key == key) return run;
  } catch (const nlohmann::json::exception&) {  // damaged: it is measured again
  }
  return std::nullopt;
}

std::string results_csv(const std::string& level, const std::vector<Run>& runs) {
  std::string out =
      "level,method,variant,probes,bytes,frame_bytes,seconds,core_seconds,frame_ms,error_geomean,error_worst\n";
  for (const Run& r : runs) {
    out += field(level) + "," + field(r.method) + "," + field(r.label) + "," + std::to_string(r.facts.probes) + "," +
           std::to_string(r.facts.bytes) + "," + std::to_string(r.facts.frame_bytes) + "," + number(r.facts.seconds) +
           "," + number(r.facts.core_seconds) + "," + number(r.frame()) + "," + number(r.error()) + "," +
           number(r.worst()) + "\n";
  }
  return out;
}

std::string rigs_csv(const std::string& level, const std::vector<Run>& runs) {
  std::string out = "level,method,variant,rig,rel_rmse,truth_noise,error,bias,p50,p95,p99\n";
  for (const Run& r : runs) {
    for (const RigError& e : r.rigs) {
      out += field(level) + "," + field(r.method) + "," + field(r.label) + "," + field(e.rig) + "," +
             number(e.rel_rmse) + "," + number(e.noise) + "," + number(e.error()) + "," + number(e.bias) + "," +
             number(e.p50) + "," + number(e.p95) + "," + number(e.p99) + "\n";
    }
  }
  return out;
}

}  // namespace lightloom::eval
