#include "core/tuning/tune.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "core/asset/chunk.h"
#include "core/base/stopwatch.h"
#include "core/tuning/error_sample.h"
#include "core/tuning/sample_cells.h"

namespace lightloom {
namespace {

// Spacings: the level's default times 2^(−step/2).
constexpr int kCoarsest = -6, kFinest = 6;
constexpr uint64_t kMostProbes = 30000;
// Shares of the target. What probes miss is dear to mend, the rest cheap; and as estimates are a little low, a tenth is left.
// Compression may have what the others leave.
constexpr double kAll = 0.9, kBandlimit = 0.82, kRelight = 0.15, kCompression = 0.33;
// Where it is all that can be had, the rest is to add little to it.
constexpr double kOfBest = 0.92;
constexpr int kRelightRays[] = {512, 1024, 2048, 4096, 8192};
// Thresholds, times the error that compression may have. The middle one is tried first.
constexpr double kMiddle = 1, kTight = 0.5, kLoose[] = {2, 1.4};
constexpr double kFalling = 0.95;
constexpr int kRanks[] = {32, 64};
constexpr double kOfBudget = 0.95;  // few cells tell how well a level compresses
constexpr float kAverage = 1;       // texels
constexpr size_t kExact = 3;        // models that are looked at closely
constexpr size_t kKeptCells = 3;    // spacings whose sampled cells are kept
// Per receiver: its texel in the surface; its name, and how many near texels it has.
constexpr double kSurfaceBytes = 24, kReceiverBytes = 10;
constexpr double kProbeBytes = 200;  // besides its rays
constexpr int kTypicalOrder = 6;     // with which compression is tried before the order is known
constexpr double kInfinity = std::numeric_limits<double>::infinity();

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

double square_of_square(double x) { return x * x * x * x; }

/// A spacing that was tried.
struct Trial {
  Plan plan;
  ErrorsByReach errors;

  double bandlimit(size_t reach, int order) const { return errors[reach].bandlimit[static_cast<size_t>(order)]; }
  double best() const {
    double least = kInfinity;
    for (const ProbeErrors& e : errors) {
      least = std::min(least, *std::min_element(e.bandlimit.begin() + 1, e.bandlimit.end()));
    }
    return least;
  }
  uint64_t probes() const { return plan.placement.probes.size(); }
};

/// A spacing, a near field and an order; of `error` all that is left to choose is to take its share.
struct Choice {
  int step = 0;
  size_t reach = 0;
  int order = 0;
  double error = 0;

  /// What noise and truncation may add to probes that miss so much.
  double left(double bandlimit) const {
    const double others = bandlimit * bandlimit + kRelight * kRelight * error * error;
    return std::sqrt(std::max(kCompression * kCompression * error * error, kAll * kAll * error * error - others));
  }
};

struct Compressed {
  CompressionChoice choice;
  CompressionCost cost;
  double truncation = 0;
};

class Tuner {
 public:
  Tuner(const RayTracer& tracer, const BakeControl& control) : tracer_(tracer), control_(control) {}

  absl::Status prepare(BakeParams request) {
    request.spacing = 0;
    request.near_field = BakeParams::kFollows;
    request.average = kAverage;
    LL_ASSIGN_OR_RETURN(ground_, find_ground(tracer_, request, control_));
    base_ = ground_.params.spacing;
    LL_ASSIGN_OR_RETURN(sample_, ErrorSample::create(tracer_, ground_, control_.stage("parameters: truth")));
    return absl::OkStatus();
  }

  /// The knee if no model errs as little as `error`.
  absl::StatusOr<Tuning> for_error(double error) {
    int step = 0;
    bool in_reach = true;
    for (;; ++step) {
      LL_ASSIGN_OR_RETURN(const Trial* at, trial(step));
      if (at->best() <= kBandlimit * error) break;
      LL_ASSIGN_OR_RETURN(const double here, merit(step));
      LL_ASSIGN_OR_RETURN(const double finer, merit(step + 1));
      if (finer >= here) {
        in_reach = false;
        break;
      }
    }
    if (in_reach) target_ = error;
    LL_ASSIGN_OR_RETURN(Tuning out, finish_best(step, in_reach ? &Tuner::smallest : &Tuner::knee));
    out.met = out.chosen.parts.total() <= error;
    return out;
  }

  absl::StatusOr<Tuning> for_bytes(uint64_t bytes) {
    const double most = kOfBudget * static_cast<double>(bytes);
    struct Fitting {
      Choice choice;
      double total, bytes;  // as estimated
    };
    std::vector<Fitting> fitting;
    double least = kInfinity, best = kInfinity, of_coarser = kInfinity;
    for (int step = kCoarsest; can_go(step); ++step) {
      LL_ASSIGN_OR_RETURN(const Trial* at, trial(step));
      bool fits = false;
      double of_step = kInfinity;  // the least that was too much
      for (size_t reach = 0; reach < kReaches.size(); ++reach) {
        for (int order = 1; order <= kMaxShOrder; ++order) {
          const Choice choice{step, reach, order, at->bandlimit(reach, order) / kOfBest};
          if (choice.error > 1.02 * best) continue;  // no better, whatever it takes
          LL_ASSIGN_OR_RETURN(const TunedModel m, estimate(choice));
          least = std::min(least, m.bytes);
          if (m.bytes > most) {  // higher orders take more
            of_step = std::min(of_step, m.bytes);
            break;
          }
          fits = true;
          best = std::min(best, m.parts.total());
          fitting.push_back({choice, m.parts.total(), m.bytes});
        }
      }
      if (fits || of_step == kInfinity) continue;
      if (of_step > of_coarser) break;  // finer ones take more
      of_coarser = of_step;
    }
    std::stable_sort(fitting.begin(), fitting.end(), [](const auto& a, const auto& b) { return a.total < b.total; });
    double above = 1;  // how far estimates have been too low
    for (const Fitting& f : fitting) {
      if (f.bytes * above > most) continue;
      LL_ASSIGN_OR_RETURN(const TunedModel m, model(f.choice));
      if (m.bytes <= most) {
        LL_ASSIGN_OR_RETURN(Tuning out, finish(f.choice, m));
        out.met = true;
        return out;
      }
      above = std::max(above, m.bytes / f.bytes);
    }
    return absl::InvalidArgumentError("--budget is too small: the least model of this level takes about " +
                                      std::to_string(static_cast<uint64_t>(std::ceil(least * above / kOfBudget))) +
                                      " bytes; give more, or a coarser lightmap by --texels-per-metre");
  }

  int plans() const { return static_cast<int>(trials_.size()); }

 private:
  /// How good a model is: one that has target_ is better than one that has not, then less is better.
  struct Merit {
    bool missed = true;
    double value = kInfinity;
    auto operator<=>(const Merit&) const = default;
  };
  /// What is best of one spacing; infinity is none.
  struct Found {
    double merit = kInfinity;
    Choice choice;
  };

  /// Less is better: the fewest bytes for target_, if there is one, where missing it is as bad as at the knee; else the knee,
  /// where k times the bytes are worth k^-¼ times the error.
  double merit_of(const TunedModel& m) const {
    const double total = m.parts.total();
    return m.bytes * square_of_square(target_ > 0 ? std::max(1.0, total / target_) : total);
  }

  /// The best for target_.
  absl::StatusOr<Found> smallest(int step) {
    LL_ASSIGN_OR_RETURN(const Trial* at, trial(step));
    Found out;
    for (size_t reach = 0; reach < kReaches.size(); ++reach) {
      int order = 1;
      while (order <= kMaxShOrder && at->bandlimit(reach, order) > kBandlimit * target_) ++order;
      if (order > kMaxShOrder) continue;
      const Choice choice{step, reach, order, target_};
      LL_RETURN_IF_ERROR(consider(choice, &out));
    }
    return out;
  }

  absl::Status consider(const Choice& choice, Found* best) {
    LL_ASSIGN_OR_RETURN(const TunedModel m, estimate(choice));
    const Found found{merit_of(m), choice};
    considered_.push_back(found);
    if (found.merit < best->merit) *best = found;
    return absl::OkStatus();
  }

  /// The best trade.
  absl::StatusOr<Found> knee(int step) {
    LL_ASSIGN_OR_RETURN(const Trial* at, trial(step));
    constexpr double kWorthwhile = 1.5;  // errors above so much of the best one are not looked at
    Found out;
    for (size_t reach = 0; reach < kReaches.size(); ++reach) {
      for (int order = 1; order <= kMaxShOrder; ++order) {
        const double bandlimit = at->bandlimit(reach, order);
        if (bandlimit > kWorthwhile * at->best()) continue;
        const Choice choice{step, reach, order, bandlimit / kOfBest};
        LL_RETURN_IF_ERROR(consider(choice, &out));
      }
    }
    return out;
  }

  /// knee()'s, by its merit alone; infinity for a spacing that is not tried.
  absl::StatusOr<double> merit(int step) {
    if (!can_go(step)) return kInfinity;
    LL_ASSIGN_OR_RETURN(const Found found, knee(step));
    return found.merit;
  }

  /// Coarser spacings with higher orders, or finer ones with lower, as long as that is better.
  absl::StatusOr<Tuning> finish_best(int start, absl::StatusOr<Found> (Tuner::*best_of)(int)) {
    considered_.clear();
    LL_ASSIGN_OR_RETURN(Found best, (this->*best_of)(start));
    for (const int direction : {-1, 1}) {
      if (direction == 1 && best.choice.step < start) break;
      for (int step = start + direction; can_go(step); step += direction) {
        LL_ASSIGN_OR_RETURN(const Found other, (this->*best_of)(step));
        if (other.merit >= best.merit) break;
        best = other;
      }
    }
    // Estimates are rough: of the best of them, the one that is best in truth.
    std::stable_sort(considered_.begin(), considered_.end(),
                     [](const Found& a, const Found& b) { return a.merit < b.merit; });
    considered_.resize(std::min(considered_.size(), kExact));
    Merit best_merit;
    TunedModel chosen;
    for (const Found& found : considered_) {
      LL_ASSIGN_OR_RETURN(const TunedModel m, model(found.choice));
      const Merit merit{target_ > 0 && m.parts.total() > target_, merit_of(m)};
      if (!(merit < best_merit)) continue;
      best_merit = merit;
      best.choice = found.choice;
      chosen = m;
    }
    return finish(best.choice, chosen);
  }

  absl::StatusOr<Tuning> finish(const Choice& choice, const TunedModel& chosen) {
    Tuning out;
    out.chosen = chosen;
    Choice next = choice;
    ++next.step;
    if (!can_go(next.step)) return out;
    LL_ASSIGN_OR_RETURN(const Trial* finer, trial(next.step));
    next.error = finer->bandlimit(next.reach, next.order) / kOfBest;
    LL_ASSIGN_OR_RETURN(out.next, estimate(next));
    return out;
  }

  /// Finer than that is not tried: there would be too many probes, judging by the step before.
  bool can_go(int step) const {
    if (step < kCoarsest || step > kFinest) return false;
    const auto before = trials_.find(step - 1);
    return before == trials_.end() || 2 * before->second.probes() <= kMostProbes;
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

  /// All else for a choice, so that no part of the error exceeds its share.
  absl::StatusOr<TunedModel> model(const Choice& choice) {
    LL_ASSIGN_OR_RETURN(const double left, left_of(choice));
    LL_ASSIGN_OR_RETURN(const Compressed c, compressed(choice.step, choice.order, left));
    return model(choice, c);
  }

  /// The same, roughly: compression as it is for a typical order, and about so large an error.
  absl::StatusOr<TunedModel> estimate(const Choice& choice) {
    LL_ASSIGN_OR_RETURN(const double left, left_of(choice));
    double error = 0.5;
    while (error > left && error > 1e-3) error /= 1.41421356;
    const auto key = std::pair(choice.step, error);
    if (!typical_.contains(key)) {
      LL_ASSIGN_OR_RETURN(const Compressed c, compressed(choice.step, kTypicalOrder, error));
      typical_.emplace(key, c);
    }
    Compressed c = typical_.at(key);
    c.cost.projection *= static_cast<double>(sh_stride(choice.order)) / sh_stride(kTypicalOrder);
    return model(choice, c);
  }

  absl::StatusOr<double> left_of(const Choice& choice) {
    LL_ASSIGN_OR_RETURN(const Trial* at, trial(choice.step));
    return choice.left(at->bandlimit(choice.reach, choice.order));
  }

  absl::StatusOr<TunedModel> model(const Choice& choice, const Compressed& c) {
    LL_ASSIGN_OR_RETURN(const Trial* at, trial(choice.step));
    const ProbeErrors& errors = at->errors[choice.reach];
    TunedModel out;
    out.params = at->plan.params;
    out.params.near_field *= kReaches[choice.reach];
    out.params.order = choice.order;
    // Fewer rays than coefficients cannot tell them apart.
    out.params.relight_rays =
        std::max(fewest(kRelightRays, errors.relight, kRelight * choice.error), 8 * sh_count(choice.order));
    out.params.rays = c.choice.rays;
    out.params.max_rank = c.choice.max_rank;
    out.params.threshold = c.choice.threshold;
    out.probes = at->probes();
    out.parts.bandlimit = at->bandlimit(choice.reach, choice.order);
    out.parts.unseen = errors.unseen;
    out.parts.relight = errors.relight / std::sqrt(static_cast<double>(out.params.relight_rays));
    out.parts.fp16 = c.cost.fp16;
    out.parts.truncation = c.truncation;
    out.parts.noise = std::sqrt(c.cost.error * c.cost.error - c.truncation * c.truncation);
    out.bytes = static_cast<double>(at->plan.receivers.all.size()) *
                    (c.cost.projection + c.cost.other + kSurfaceBytes + kReceiverBytes +
                     static_cast<double>(kNearTexelBytes) * errors.near_texels_by(c.choice.rays)) +
                static_cast<double>(out.probes) * (4.0 * out.params.relight_rays + kProbeBytes);
    return out;
  }

  /// The lowest rank, the fewest rays and the loosest threshold whose noise and truncation together stay below `error`; the
  /// best there is if none do. The near field hardly matters, and is the plan's.
  absl::StatusOr<Compressed> compressed(int step, int order, double error) {
    const Parallel how = control_.stage("parameters: rank");
    LL_RETURN_IF_ERROR(trial(step).status());
    if (!cells_.contains(step)) {
      LL_ASSIGN_OR_RETURN(SampleCells made, SampleCells::create(tracer_, trials_.at(step).plan, *sample_, how));
      cells_.emplace(step, std::move(made));
      // They are large, and neighbours are asked for next.
      if (cells_.size() > kKeptCells) {
        const bool first_is_farther = step - cells_.begin()->first > cells_.rbegin()->first - step;
        cells_.erase(first_is_farther ? cells_.begin() : std::prev(cells_.end()));
      }
    }
    const SampleCells& cells = cells_.at(step);
    Compressed best;
    if (cells.dark()) {  // no light says how much is enough
      best.choice.order = order;
      LL_ASSIGN_OR_RETURN(best.cost, cells.compress(best.choice, how));
      return best;
    }
    best.cost.error = kInfinity;
    const auto enough = [&] { return best.cost.error <= error; };
    // Whether it is better, or enough.
    const auto attempt = [&](CompressionChoice choice, double threshold) -> absl::StatusOr<bool> {
      choice.threshold = static_cast<float>(std::clamp(threshold * error, 0.002, 0.5));
      LL_ASSIGN_OR_RETURN(const CompressionCost cost, cells.compress(choice, how));
      if (cost.error > error && !(cost.error < kFalling * best.cost.error)) return false;
      best.choice = choice;
      best.cost = cost;
      return true;
    };
    CompressionChoice choice;
    choice.order = order;
    constexpr size_t kLast = std::size(SampleCells::kRays) - 1;
    size_t rays = kLast / 2;
    for (const int rank : kRanks) {
      choice.max_rank = rank;
      choice.rays = SampleCells::kRays[rays];
      LL_ASSIGN_OR_RETURN(bool better, attempt(choice, kMiddle));
      // Fewer rays as long as they are enough, or more until they are.
      const bool fewer = enough();
      while (better && enough() == fewer && rays != (fewer ? 0 : kLast)) {
        choice.rays = SampleCells::kRays[fewer ? --rays : ++rays];
        LL_ASSIGN_OR_RETURN(better, attempt(choice, kMiddle));
      }
      if (enough()) break;
      if (best.choice.max_rank != rank) continue;  // more columns were no better
      LL_RETURN_IF_ERROR(attempt(best.choice, kTight).status());
      if (enough()) break;
    }
    const bool tight = best.choice.threshold < static_cast<float>(kMiddle * error);
    for (size_t i = 0; i < std::size(kLoose) && enough() && !tight; ++i) {
      LL_ASSIGN_OR_RETURN(const bool taken, attempt(best.choice, kLoose[i]));
      if (taken) break;
    }
    // With as many rays as were gathered, what is left is what the rank cuts off.
    CompressionChoice quiet = best.choice;
    quiet.rays = *std::rbegin(SampleCells::kRays);
    CompressionCost truncation = best.cost;
    if (quiet.rays != best.choice.rays) {
      LL_ASSIGN_OR_RETURN(truncation, cells.compress(quiet, how));
    }
    best.truncation = std::min(truncation.error, best.cost.error);
    return best;
  }

  const RayTracer& tracer_;
  const BakeControl& control_;
  Plan ground_;
  float base_ = 1;
  double target_ = 0;  // 0: none, or out of reach
  std::vector<Found> considered_;
  std::unique_ptr<ErrorSample> sample_;
  std::map<int, Trial> trials_;
  std::map<int, SampleCells> cells_;
  std::map<std::pair<int, double>, Compressed> typical_;  // by step and error
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
