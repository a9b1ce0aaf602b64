#include "cli/eval/pool.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "core/base/text.h"

namespace lightloom::eval {
namespace {

const Run* find(const Evaluation& level, const std::string& method, const std::string& label) {
  for (const Run& run : level.runs) {
    if (run.method == method && run.label == label) return &run;
  }
  return nullptr;
}

double geometric_mean(const std::vector<const Run*>& runs, const std::function<double(const Run&)>& of) {
  double sum = 0;
  for (const Run* run : runs) {
    if (!(of(*run) > 0)) return 0;
    sum += std::log(of(*run));
  }
  return std::exp(sum / static_cast<double>(runs.size()));
}

Run pooled(const std::vector<const Run*>& runs, const std::vector<Evaluation>& levels) {
  Run out;
  out.method = runs.front()->method;
  out.label = runs.front()->label;
  const auto whole = [&](uint64_t Facts::*member) {
    return static_cast<uint64_t>(
        std::llround(geometric_mean(runs, [&](const Run& r) { return static_cast<double>(r.facts.*member); })));
  };
  out.facts.bytes = whole(&Facts::bytes);
  out.facts.frame_bytes = whole(&Facts::frame_bytes);
  out.facts.probes = whole(&Facts::probes);
  Facts times;
  times.seconds = geometric_mean(runs, [](const Run& r) { return r.facts.seconds; });
  times.core_seconds = geometric_mean(runs, [](const Run& r) { return r.facts.core_seconds; });
  out.add_times(times);
  const double frame = geometric_mean(runs, [](const Run& r) { return r.frame(); });
  if (frame > 0) out.frame_ms = {frame};
  for (size_t i = 0; i < runs.size(); ++i) out.rigs.push_back({levels[i].level, runs[i]->error(), 0, 0, 0, 0, 0});
  return out;
}

}  // namespace

absl::StatusOr<Evaluation> pool(const std::vector<Evaluation>& levels) {
  Evaluation out;
  if (levels.empty()) return absl::InvalidArgumentError("there is no level to pool");
  out.bounces = levels.front().bounces;
  std::set<std::string> machines;
  for (const Evaluation& e : levels) {
    const auto bad = [&](const std::string& what) {
      return absl::InvalidArgumentError("level '" + printable(e.level) + "' " + what);
    };
    if (std::find(out.pooled.begin(), out.pooled.end(), e.level) != out.pooled.end()) {
      return bad("is there twice; name levels by --name when they are evaluated");
    }
    if (e.bounces != out.bounces) {
      return bad("was judged by " + std::to_string(e.bounces) + " bounces, others by " + std::to_string(out.bounces));
    }
    if (default_run(e, kDefaultMethod) == nullptr) {
      return bad("has no run of our default, which others are compared with; evaluate it with --methods default,...");
    }
    out.pooled.push_back(e.level);
    out.rigs.push_back({e.level, 0, 0});
    out.receivers += e.receivers;
    out.triangles += e.triangles;
    machines.insert(e.machine);
  }
  out.level = std::to_string(levels.size()) + " levels";
  for (const std::string& machine : machines) out.machine += (out.machine.empty() ? "" : "; ") + machine;

  std::vector<Evaluation::MethodWords> methods = levels.front().methods;
  std::stable_partition(methods.begin(), methods.end(), [](const auto& m) { return m.name == kDefaultMethod; });
  for (const auto& method : methods) {
    const size_t before = out.runs.size();
    for (const Run& first : levels.front().runs) {
      if (first.method != method.name) continue;
      std::vector<const Run*> runs;
      for (const Evaluation& e : levels) runs.push_back(find(e, first.method, first.label));
      if (std::find(runs.begin(), runs.end(), nullptr) != runs.end()) continue;
      // Its method's default stands first, so a method without it on all levels is left out.
      if (out.runs.size() == before && &first != default_run(levels.front(), method.name)) break;
      out.runs.push_back(pooled(runs, levels));
    }
    if (out.runs.size() > before) out.methods.push_back(method);
  }
  return out;
}

}  // namespace lightloom::eval
