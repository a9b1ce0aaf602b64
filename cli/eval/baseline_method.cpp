// Probe methods in use today, by core/baselines.
#include <utility>

#include "cli/eval/method.h"
#include "cli/interrupt.h"
#include "core/base/stopwatch.h"
#include "core/baselines/ddgi.h"
#include "core/baselines/sh_interpolation.h"
#include "core/relight/lightmap.h"

namespace lightloom::eval {
namespace {

class BaselineModel : public Model {
 public:
  BaselineModel(LitLevel* level, SurfaceElements elements, std::unique_ptr<Baseline> baseline, double seconds,
                double core_seconds)
      : level_(*level), elements_(std::move(elements)), baseline_(std::move(baseline)) {
    facts_.seconds = seconds;
    facts_.core_seconds = core_seconds;
    facts_.bytes = baseline_->bytes();
    facts_.frame_bytes = baseline_->bytes_per_frame();
    facts_.probes = baseline_->probes();
  }

  const Facts& facts() const override { return facts_; }

  absl::StatusOr<Image> light(size_t rig, int bounces) override {
    LL_ASSIGN_OR_RETURN(const auto* inputs, level_.inputs(elements_));
    LL_RETURN_IF_ERROR(level_.select(rig));
    Parallel how;
    how.threads = level_.threads();
    return lightmap_image(elements_, baseline_->light((*inputs)[rig], level_.scene().environment, bounces, how));
  }

  absl::StatusOr<std::vector<double>> frame_ms(int frames) override {
    LL_ASSIGN_OR_RETURN(const auto* inputs, level_.inputs(elements_));
    Parallel how;
    how.threads = kFrameThreads;
    std::vector<double> ms;
    for (int i = 0; i < frames; ++i) {
      FrameTimes times;
      baseline_->light((*inputs)[0], level_.scene().environment, 1, how, &times);
      ms.push_back(times.total());
    }
    return ms;
  }

 private:
  LitLevel& level_;
  SurfaceElements elements_;
  std::unique_ptr<Baseline> baseline_;
  Facts facts_;
};

/// The plan that a method's probes come from, timed with them.
class Preparation {
 public:
  Preparation(LitLevel* level) : level_(*level) {
    control_.threads = level->threads();
    control_.cancel = &interrupted();
  }

  absl::StatusOr<Plan> plan(const BakeParams& params) { return make_plan(level_.tracer(), params, control_); }
  /// Without probes, for a method that places its own.
  absl::StatusOr<Plan> ground(const BakeParams& params) { return find_ground(level_.tracer(), params, control_); }
  const BakeControl& control() const { return control_; }

  std::unique_ptr<Model> model(const Plan& plan, std::unique_ptr<Baseline> baseline) const {
    return std::make_unique<BaselineModel>(&level_, SurfaceElements{plan.layout, plan.receivers}, std::move(baseline),
                                           watch_.seconds(), processor_seconds() - before_);
  }

 private:
  LitLevel& level_;
  BakeControl control_;
  const double before_ = processor_seconds();
  const Stopwatch watch_;
};

class ShMethod : public Method {
 public:
  std::string name() const override { return "sh"; }
  std::string title() const override { return "plain SH probes"; }
  std::string version() const override { return std::string(kBaselinesVersion); }
  std::string about() const override {
    return "Spatial interpolation alone, Silvennoinen & Lehtinen 2017, Eq. 1: radiance at a receiver is the weighted "
           "mean of "
           "its 6 nearest probes', without a word about what they see; order 2 (9 coefficients), lightloom's probes.";
  }
  std::vector<Variant> sweep(const LitLevel& level, bool quick) const override {
    const double spacing = static_cast<double>(level.plan().params.spacing);
    std::vector<Variant> out = {{"default", {{"spacing", spacing}, {"relight_rays", 1024}}}};
    for (const double f : quick ? std::vector<double>{0.5} : std::vector<double>{2, 1.41, 0.71, 0.5, 0.35}) {
      out.push_back({"spacing " + times(f), {{"spacing", f * spacing}, {"relight_rays", 1024}}});
    }
    if (!quick) out.push_back({"relight_rays 4096", {{"spacing", spacing}, {"relight_rays", 4096}}});
    return out;
  }
  absl::StatusOr<std::unique_ptr<Model>> prepare(LitLevel* level, const Settings& settings,
                                                 const std::filesystem::path&) const override {
    constexpr int kOrder = 2;  // irradiance has next to nothing above it (Ramamoorthi & Hanrahan 2001)
    Preparation preparation(level);
    BakeParams params = level->plan().params;
    params.spacing = static_cast<float>(settings.at("spacing"));
    params.relight_rays = static_cast<int32_t>(settings.at("relight_rays"));
    LL_ASSIGN_OR_RETURN(const Plan plan, preparation.plan(params));
    LL_ASSIGN_OR_RETURN(auto baseline, make_sh_interpolation(level->tracer(), plan, kOrder, preparation.control()));
    return preparation.model(plan, std::move(baseline));
  }
};

class DdgiMethod : public Method {
 public:
  std::string name() const override { return "ddgi"; }
  std::string title() const override { return "DDGI probes"; }
  std::string version() const override { return std::string(kBaselinesVersion); }
  std::string about() const override {
    return "Visibility-weighted irradiance probes, Majercik et al. 2019 and 2021, with the constants of NVIDIA's RTXGI "
           "SDK 1.2: a "
           "regular grid, octahedral irradiance, Chebyshev test of filtered distances, relocation, classification, "
           "biases along "
           "the normal. Rays are fixed and many, so there is no hysteresis. Its default here was best for the error of "
           "the Cornell "
           "box: a grid within the level, bias 0.1, clearance 0.1, perceptual encoding, weights of each receiver kept; "
           "as published: bias 0.225, "
           "clearance 0.2, distance maps.";
  }
  std::vector<Variant> sweep(const LitLevel& level, bool quick) const override {
    const double spacing = static_cast<double>(level.plan().params.spacing);
    const Settings base = {{"spacing", spacing}, {"bias", 0.1},       {"clearance", 0.1},
                           {"enclose", 0},       {"keep_weights", 1}, {"relight_rays", 1024}};
    std::vector<Variant> out = {{"default", base}};
    const auto add = [&](const std::string& label, const Settings& change) {
      Settings s = base;
      for (const auto& [name, value] : change) s[name] = value;
      out.push_back({label, std::move(s)});
    };
    for (const double f : quick ? std::vector<double>{0.5} : std::vector<double>{2, 1.41, 0.71, 0.5, 0.35}) {
      add("spacing " + times(f), {{"spacing", f * spacing}});
    }
    add("as published", {{"bias", 0.225}, {"clearance", 0.2}, {"enclose", 1}, {"keep_weights", 0}});
    if (quick) return out;
    add("as published, spacing ×0.5",
        {{"spacing", spacing / 2}, {"bias", 0.225}, {"clearance", 0.2}, {"enclose", 1}, {"keep_weights", 0}});
    add("bias 0", {{"bias", 0}});
    add("bias 0, spacing ×0.5", {{"bias", 0}, {"spacing", spacing / 2}});
    return out;
  }
  absl::StatusOr<std::unique_ptr<Model>> prepare(LitLevel* level, const Settings& settings,
                                                 const std::filesystem::path&) const override {
    Preparation preparation(level);
    BakeParams params = level->plan().params;
    params.relight_rays = static_cast<int32_t>(settings.at("relight_rays"));
    LL_ASSIGN_OR_RETURN(const Plan plan, preparation.ground(params));
    DdgiParams ddgi;
    ddgi.spacing = static_cast<float>(settings.at("spacing"));
    ddgi.bias = static_cast<float>(settings.at("bias"));
    ddgi.clearance = static_cast<float>(settings.at("clearance"));
    ddgi.enclose = settings.at("enclose") != 0;
    ddgi.keep_weights = settings.at("keep_weights") != 0;
    LL_ASSIGN_OR_RETURN(auto baseline, make_ddgi(level->tracer(), plan, ddgi, preparation.control()));
    return preparation.model(plan, std::move(baseline));
  }
};

}  // namespace

std::unique_ptr<Method> sh_method() { return std::make_unique<ShMethod>(); }
std::unique_ptr<Method> ddgi_method() { return std::make_unique<DdgiMethod>(); }

}  // namespace lightloom::eval
