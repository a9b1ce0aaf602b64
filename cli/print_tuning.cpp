#include "cli/print_tuning.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/progress.h"

namespace lightloom {
namespace {

nlohmann::json to_json(const TunedModel& m) {
  return {{"spacing", m.params.spacing},
          {"near_field", m.params.near_field},
          {"order", m.params.order},
          {"rays", m.params.rays},
          {"relight_rays", m.params.relight_rays},
          {"max_rank", m.params.max_rank},
          {"average", m.params.average},
          {"threshold", m.params.threshold},
          {"probes", m.probes},
          {"bytes", m.bytes},
          {"error",
           {{"total", m.parts.total()},
            {"bandlimit", m.parts.bandlimit},
            {"unseen", m.parts.unseen},
            {"noise", m.parts.noise},
            {"relight", m.parts.relight},
            {"truncation", m.parts.truncation},
            {"fp16", m.parts.fp16}}}};
}

}  // namespace

nlohmann::json to_json(const Tuning& t) {
  nlohmann::json out = to_json(t.chosen);
  out["met"] = t.met;
  out["plans"] = t.plans;
  out["seconds"] = t.seconds;
  if (t.next) out["next"] = to_json(*t.next);
  return out;
}

void print(const Tuning& t) {
  const TunedModel& m = t.chosen;
  const BakeParams& p = m.params;
  std::printf(
      "chosen in %s: spacing %.3g m (%llu probes), near field %.3g m, order %d, %d rays, %d relight rays, rank %d, "
      "average %.3g texels, threshold %.3g\n",
      human_seconds(t.seconds).c_str(), static_cast<double>(p.spacing), static_cast<unsigned long long>(m.probes),
      static_cast<double>(p.near_field), p.order, p.rays, p.relight_rays, p.max_rank, static_cast<double>(p.average),
      static_cast<double>(p.threshold));
  std::printf(
      "  estimated error %.4f: bandlimit %.4f (unseen %.4f), noise %.4f, relight rays %.4f, truncation %.4f, fp16 "
      "%.5f; "
      "about %s\n",
      m.parts.total(), m.parts.bandlimit, m.parts.unseen, m.parts.noise, m.parts.relight, m.parts.truncation,
      m.parts.fp16, human_bytes(m.bytes).c_str());
  if (!t.met) {
    std::printf("  the target is out of reach: a finer model would cost more and more for less and less\n");
  }
  if (t.next) {
    std::printf("  the next finer spacing, %.3g m: about %.4f with %s\n", static_cast<double>(t.next->params.spacing),
                t.next->parts.total(), human_bytes(t.next->bytes).c_str());
  }
}

}  // namespace lightloom
