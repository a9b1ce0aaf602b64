#include "core/tuning/tune.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "core/base/stopwatch.h"
#include "core/tuning/error_sample.h"
#include "core/tuning/sample_cells.h"

namespace lightloom {
namespace {

// Spacings: the level's default times 2^(−step/2).
constexpr int kCoarsest = -6, kFinest = 6;
constexpr uint64_t kMostProbes = 30000;
// Shares of the target. What probes miss is dear to mend, the rest cheap; and as estimates are a little low, a tenth is left.
constexpr double kBandlimit = 0.82, kRelight = 0.15, kCompression = 0.35;
// Where it is all that can be had, the rest is to add little to it.
constexpr double kOfBest = 0.92;
// The knee: a step that takes k times the probes must take the error down by k^-0.2 at least.
constexpr double kKnee = 0.2;
constexpr double kAlmost = 1.04;  // an order whose error is this near to the best one's
constexpr int kRelightRays[] = {512, 1024, 2048, 4096, 8192};
// Thresholds that are tried, times the target: loose ones first.
constexpr double kThresholds[] = {1.4, 1, 0.7, 0.5, 0.35, 0.25};
constexpr double kFalling = 0.95;
constexpr int kRanks[] = {32, 64};
constexpr double kSurfaceBytes = 24,
                 kProbeBytes = 200;  // beside the cells: per receiver, and per probe besides its rays

float spacing_of(float base, int step) {
  // Products of exact halves and one rounded root: the same everywhere.
  constexpr float kRoot = 1.41421354f;
  float s = std::ldexp(base, -(step - (step & 1)) / 2);
  return step & 1 ? s / kRoot : s;
}

template <size_t N>
int fewest(const int (&counts)[N], double of_one, double most) {
  for (const int n : counts) {
    if (of_one / std::sqrt(static_cast<double>(n)) <= most) return n;
  }
  return counts[N - 1];
}

/// A spacing that was tried.
struct Trial {
  Plan plan;
  ProbeErrors errors;

  double best() const { return *std::min_element(errors.bandlimit.begin() + 1, errors.bandlimit.end()); }
  uint64_t probes() const { return plan.placement.probes.size(); }
  /// The lowest order that errs no more than `most`; 0: none.
  int order(double most) const {
    for (int n = 1; n <= kMaxShOrder; ++n) {
      if (errors.bandlimit[static_cast<size_t>(n)] <= most) return n;
    }
    return 0;
  }
};

class Tuner {
 public:
  Tuner(const RayTracer& tracer, const BakeControl& control) : tracer_(tracer), control_(control) {}

  absl::Status prepare(const BakeParams& request) {
    LL_ASSIGN_OR_RETURN(ground_, find_ground(tracer_, request, control_));
    base_ = ground_.params.spacing;
    LL_ASSIGN_OR_RETURN(sample_, ErrorSample::create(tracer_, ground_, control_.stage("parameters: truth")));
    return absl::OkStatus();
  }

  /// The knee if no model errs as little as `error`.
  absl::StatusOr<Tuning> for_error(double error) {
    const double most = kBandlimit * error;
    Tuning out;
    int step = 0;
    LL_ASSIGN_OR_RETURN(const Trial* at, trial(step));
    while (at->best() > most) {
      if (!can_go(step + 1)) return at_knee(step);
      LL_ASSIGN_OR_RETURN(const Trial* finer, trial(step + 1));
      if (is_knee(*at, *finer)) return at_knee(step);
      at = finer;
      ++step;
    }
    // Coarser with higher orders, or finer with lower ones, as long as that is smaller.
    LL_ASSIGN_OR_RETURN(out.chosen, model(step, at->order(most), error));
    const int start = step;
    for (const int direction : {-1, 1}) {
      if (direction == 1 && step < start) break;
      for (int s = start + direction; s >= kCoarsest && can_go(s); s += direction) {
        LL_ASSIGN_OR_RETURN(const Trial* other, trial(s));
        const int order = other->order(most);
        if (order == 0) break;
        LL_ASSIGN_OR_RETURN(const TunedModel candidate, model(s, order, error));
        if (candidate.bytes >= out.chosen.bytes) break;
        out.chosen = candidate;
        step = s;
      }
    }
    out.met = out.chosen.parts.total() <= error;
    LL_RETURN_IF_ERROR(look_ahead(step, &out));
    return out;
  }

  absl::StatusOr<Tuning> for_bytes(uint64_t bytes) {
    Tuning out;
    double least = 0;
    int step = kCoarsest;
    bool any = false;
    for (int s = kCoarsest; can_go(s); ++s) {
      LL_ASSIGN_OR_RETURN(const Trial* at, trial(s));
      bool fits = false;
      for (int order = 1; order <= kMaxShOrder; ++order) {
        const double error = at->errors.bandlimit[static_cast<size_t>(order)] / kOfBest;
        if (any && error > 1.02 * out.chosen.parts.total()) continue;  // no better, whatever it takes
        LL_ASSIGN_OR_RETURN(const TunedModel candidate, model(s, order, error));
        least = least > 0 ? std::min(least, candidate.bytes) : candidate.bytes;
        if (candidate.bytes > static_cast<double>(bytes)) break;  // higher orders take more
        fits = true;
        if (!any || candidate.parts.total() < out.chosen.parts.total()) out.chosen = candidate, step = s;
        any = true;
      }
      if (!fits && s > step + 1) break;  // finer ones take more
    }
    if (!any) {
      return absl::InvalidArgumentError("--budget is too small: the least model of this level takes about " +
                                        std::to_string(static_cast<uint64_t>(least)) +
                                        " bytes; give more, or a coarser lightmap by --texels-per-metre");
    }
    out.met = true;
    LL_RETURN_IF_ERROR(look_ahead(step, &out));
    return out;
  }

  int plans() const { return static_cast<int>(trials_.size()); }

 private:
  /// Finer than that is not tried: there would be too many probes, judging by the step before.
  bool can_go(int step) const {
    if (step < kCoarsest || step > kFinest) return false;
    const auto before = trials_.find(step - 1);
    return before == trials_.end() || 2 * before->second.probes() <= kMostProbes;
  }

  bool is_knee(const Trial& at, const Trial& finer) const {
    const double dearer = static_cast<double>(finer.probes()) / static_cast<double>(std::max<uint64_t>(1, at.probes()));
    return finer.best() > at.best() * std::pow(std::max(1.0, dearer), -kKnee);
  }

  absl::StatusOr<const Trial*> trial(int step) {
    const auto known = trials_.find(step);
    if (known != trials_.end()) return &known->second;
    Plan plan = ground_;
    plan.params.spacing = spacing_of(base_, step);
    Trial t;
    LL_ASSIGN_OR_RETURN(t.plan, finish_plan(tracer_, std::move(plan), control_));
    LL_ASSIGN_OR_RETURN(t.errors, sample_->measure(t.plan, control_.stage("parameters: probes")));
    return &trials_.emplace(step, std::move(t)).first->second;
  }

  /// All else for a spacing and an order, so that no part of the error exceeds its share of `error`.
  absl::StatusOr<TunedModel> model(int step, int order, double error) {
    LL_ASSIGN_OR_RETURN(const Trial* at, trial(step));
    TunedModel out;
    out.params = at->plan.params;
    out.params.order = order;
    // Fewer rays than coefficients cannot tell them apart.
    out.params.relight_rays = std::max(fewest(kRelightRays, at->errors.relight, kRelight * error), 8 * sh_count(order));
    out.probes = at->probes();
    out.parts.bandlimit = at->errors.bandlimit[static_cast<size_t>(order)];
    out.parts.unseen = at->errors.unseen;
    out.parts.relight = at->errors.relight / std::sqrt(static_cast<double>(out.params.relight_rays));

    LL_ASSIGN_OR_RETURN(const CompressionCost cost, choose_compression(step, kCompression * error, error, &out.params));
    out.parts.fp16 = cost.fp16;
    // With as many rays as were gathered, what is left is what the rank cuts off.
    CompressionChoice quiet = choice_of(out.params);
    quiet.rays = *std::rbegin(SampleCells::kRays);
    CompressionCost truncation = cost;
    if (quiet.rays != out.params.rays) {
      LL_ASSIGN_OR_RETURN(truncation, cells_.at(step).compress(quiet, control_.stage("parameters: rank")));
    }
    out.parts.truncation = std::min(truncation.error, cost.error);
    out.parts.noise = std::sqrt(cost.error * cost.error - out.parts.truncation * out.parts.truncation);
    const double receivers = static_cast<double>(at->plan.receivers.all.size());
    out.bytes = receivers * (cost.bytes_per_receiver + kSurfaceBytes) +
                static_cast<double>(out.probes) * (4.0 * out.params.relight_rays + kProbeBytes);
    return out;
  }

  static CompressionChoice choice_of(const BakeParams& p) {
    return {p.order, p.rays, p.relight_rays, p.max_rank, p.threshold};
  }

  /// The fewest rays, then the loosest threshold, whose noise and truncation together stay below `most`; the best there is if
  /// none do.
  absl::StatusOr<CompressionCost> choose_compression(int step, double most, double error, BakeParams* params) {
    const Parallel how = control_.stage("parameters: rank");
    if (!cells_.contains(step)) {
      LL_ASSIGN_OR_RETURN(SampleCells cells, SampleCells::create(tracer_, trials_.at(step).plan, *sample_, how));
      cells_.emplace(step, std::move(cells));
    }
    std::optional<std::pair<CompressionCost, CompressionChoice>> best;
    const auto enough = [&] { return best && best->first.error <= most; };
    for (const int rank : kRanks) {
      for (const int rays : SampleCells::kRays) {
        double before = std::numeric_limits<double>::infinity();
        for (const double threshold : kThresholds) {
          CompressionChoice choice = choice_of(*params);
          choice.rays = rays;
          choice.max_rank = rank;
          choice.threshold = static_cast<float>(std::clamp(threshold * error, 0.002, 0.5));
          LL_ASSIGN_OR_RETURN(const CompressionCost cost, cells_.at(step).compress(choice, how));
          if (!best || cost.error < best->first.error) best = {cost, choice};
          // Once it falls no more, what is left is noise: only more rays help.
          if (enough() || cost.error > kFalling * before) break;
          before = cost.error;
        }
        if (enough()) break;
      }
      if (enough()) break;
    }
    params->rays = best->second.rays;
    params->max_rank = best->second.max_rank;
    params->threshold = best->second.threshold;
    return best->first;
  }

  absl::StatusOr<Tuning> at_knee(int step) {
    LL_ASSIGN_OR_RETURN(const Trial* at, trial(step));
    const int order = at->order(kAlmost * at->best());
    Tuning out;
    LL_ASSIGN_OR_RETURN(out.chosen, model(step, order, at->errors.bandlimit[static_cast<size_t>(order)] / kOfBest));
    LL_RETURN_IF_ERROR(look_ahead(step, &out));
    return out;
  }

  absl::Status look_ahead(int step, Tuning* out) {
    if (!can_go(step + 1)) return absl::OkStatus();
    LL_ASSIGN_OR_RETURN(const Trial* finer, trial(step + 1));
    const int order = out->chosen.params.order;
    LL_ASSIGN_OR_RETURN(out->next,
                        model(step + 1, order, finer->errors.bandlimit[static_cast<size_t>(order)] / kOfBest));
    return absl::OkStatus();
  }

  const RayTracer& tracer_;
  const BakeControl& control_;
  Plan ground_;
  float base_ = 1;
  std::unique_ptr<ErrorSample> sample_;
  std::map<int, Trial> trials_;
  std::map<int, SampleCells> cells_;
};

}  // namespace

double ErrorParts::total() const {
  return std::sqrt(bandlimit * bandlimit + noise * noise + relight * relight + truncation * truncation + fp16 * fp16);
}

absl::StatusOr<Tuning> tune(const RayTracer& tracer, const BakeParams& request, const TuneTarget& target,
                            const BakeControl& control) {
  const Stopwatch watch;
  Tuner tuner(tracer, control);
  LL_RETURN_IF_ERROR(tuner.prepare(request));
  LL_ASSIGN_OR_RETURN(Tuning out, target.bytes > 0 ? tuner.for_bytes(target.bytes) : tuner.for_error(target.error));
  out.plans = tuner.plans();
  out.seconds = watch.seconds();
  return out;
}

}  // namespace lightloom
