// Our own asset, by the default method or SL17's, lit by the runtime on the processor.
#include <cmath>
#include <utility>

#include "cli/eval/method.h"
#include "cli/interrupt.h"
#include "cli/loom_runtime.h"
#include "core/asset/asset.h"
#include "core/bake/bake.h"
#include "core/base/stopwatch.h"
#include "core/relight/lightmap.h"
#include "core/tuning/tune.h"

namespace lightloom::eval {
namespace {

class LoomModel : public Model {
 public:
  static absl::StatusOr<std::unique_ptr<Model>> create(LitLevel* level, const BakeParams& params,
                                                       const std::filesystem::path& loom, double tuning_seconds = 0,
                                                       double tuning_core_seconds = 0) {
    auto model = std::make_unique<LoomModel>(level);
    LL_RETURN_IF_ERROR(model->bake_and_load(params, loom));
    model->facts_.seconds += tuning_seconds;
    model->facts_.core_seconds += tuning_core_seconds;
    if (tuning_seconds > 0) model->facts_.stages["tuning"] = tuning_seconds;
    return model;
  }
  explicit LoomModel(LitLevel* level) : level_(*level) {}
  ~LoomModel() override {
    if (runtime_ != nullptr) lightloom_destroy(runtime_);
  }

  const Facts& facts() const override { return facts_; }

  absl::StatusOr<Image> light(size_t rig, int bounces) override {
    LL_ASSIGN_OR_RETURN(const auto* inputs, level_.inputs(elements_));
    const SurfaceInputs& lit = (*inputs)[rig];
    LL_RETURN_IF_ERROR(level_.select(rig));
    const uint64_t n = elements_.receivers.all.size();
    LL_RETURN_IF_ERROR(messages_.status(lightloom_reset_feedback(runtime_)));
    LL_RETURN_IF_ERROR(messages_.status(lightloom_set_direct(runtime_, floats(lit.direct), 0, n)));
    LL_RETURN_IF_ERROR(set_albedo_emission_sky(lit, level_.scene().environment, messages_, runtime_));
    LL_RETURN_IF_ERROR(messages_.status(lightloom_update(runtime_, static_cast<uint32_t>(bounces))));
    std::vector<Vec3> e(n);
    LL_RETURN_IF_ERROR(messages_.status(lightloom_read_irradiance(runtime_, reinterpret_cast<float*>(e.data()), n)));
    return lightmap_image(elements_, e);
  }

  absl::StatusOr<std::vector<double>> frame_ms(int frames) override {
    const uint64_t n = elements_.receivers.all.size();
    const std::vector<Vec3> glow[] = {std::vector<Vec3>(n, Vec3{1, 1, 1}), std::vector<Vec3>(n, Vec3{2, 2, 2})};
    std::vector<double> ms;
    for (int i = 0; i < frames; ++i) {
      LL_RETURN_IF_ERROR(messages_.status(lightloom_set_emission(runtime_, floats(glow[i % 2]), 0, n)));
      const Stopwatch watch;
      LL_RETURN_IF_ERROR(messages_.status(lightloom_update(runtime_, 1)));
      ms.push_back(1e3 * watch.seconds());
    }
    lightloom_stats stats{};
    stats.struct_size = sizeof stats;
    LL_RETURN_IF_ERROR(messages_.status(lightloom_get_stats(runtime_, &stats)));
    facts_.frame_bytes = stats.relight_bytes + stats.project_bytes + stats.receive_bytes;
    return ms;
  }

 private:
  absl::Status bake_and_load(const BakeParams& params, const std::filesystem::path& loom) {
    BakeControl control;
    control.threads = level_.threads();
    control.cancel = &interrupted();
    control.progress = [&](const std::string& stage, uint64_t done, uint64_t total, uint64_t rays) {
      level_.bar()->update(stage, done, total, rays);
    };
    const double before = processor_seconds();
    LL_ASSIGN_OR_RETURN(const BakeReport report, bake(level_.tracer(), params, loom, control));
    facts_.core_seconds = processor_seconds() - before;
    facts_.seconds = report.seconds_total;
    facts_.stages = {{"plan", report.seconds_plan},
                     {"transport", report.seconds_transport},
                     {"compress", report.seconds_compress},
                     {"relight", report.seconds_relight},
                     {"write", report.seconds_write}};
    facts_.bytes = report.bytes_total;
    facts_.probes = report.probes;
    LL_ASSIGN_OR_RETURN(const Manifest manifest, read_manifest(loom));
    LL_ASSIGN_OR_RETURN(elements_, load_surface_elements(loom, manifest, level_.scene()));

    lightloom_create_info create{};
    create.struct_size = sizeof create;
    create.flags = LIGHTLOOM_CREATE_CPU;
    create.threads = kFrameThreads;
    create.message = RuntimeMessages::receive;
    create.message_user = &messages_;
    LL_RETURN_IF_ERROR(messages_.status(lightloom_create(&create, &runtime_)));
    return load_loom(loom, messages_, runtime_);
  }

  LitLevel& level_;
  Facts facts_;
  SurfaceElements elements_;
  RuntimeMessages messages_;
  lightloom_runtime* runtime_ = nullptr;
};

/// "spacing ×0.5, order 4".
std::string with(const std::string& label, const std::string& more) {
  return label.empty() ? more : label + ", " + more;
}

constexpr char kNear[] = "near_field";

class LoomMethod : public Method {
 public:
  explicit LoomMethod(BakeMethod method) : method_(method) {}

  std::string name() const override { return sl17() ? "sl17" : kDefaultMethod; }
  std::string title() const override { return sl17() ? "SL17 as published" : "lightloom"; }
  std::string about() const override {
    return sl17() ? "Silvennoinen & Lehtinen 2017 as published: candidates next to surfaces thinned by density, one "
                    "support "
                    "radius for all probes with 10 links on average, distance weights, visibility by a ray per hit and "
                    "probe, "
                    "rank by threshold 0.005, 8000 relight rays (lightloom bake --method sl17). Its probe counts are "
                    "multiples of "
                    "the default's."
                  : "lightloom bake with settings by hand: those that --help gives, or as said; lit by the runtime.";
  }

  std::vector<Variant> sweep(const LitLevel& level, bool quick) const override {
    std::vector<Variant> out;
    const auto add = [&](double fineness, Settings more) {
      Variant v;
      if (fineness != 1) v.label = (sl17() ? "probes " : "spacing ") + times(fineness);
      for (const auto& [setting, value] : more) {
        v.label = with(v.label, setting + " " + (setting == kNear ? times(value) : plain(value)));
      }
      if (sl17()) {
        more["probes"] = std::round(fineness * static_cast<double>(level.plan().placement.probes.size()));
      } else {
        more["spacing"] = fineness * static_cast<double>(level.plan().params.spacing);
        // It does not follow the spacing here.
        more.try_emplace(kNear, 1);
        more[kNear] *= static_cast<double>(level.plan().params.near_field);
      }
      if (v.label.empty()) v.label = "default";
      v.settings = std::move(more);
      out.push_back(std::move(v));
    };
    add(1, {});
    if (sl17()) {
      for (const double f : quick ? std::vector<double>{0.25} : std::vector<double>{0.125, 0.25, 0.5, 2, 4}) add(f, {});
      for (const int order : quick ? std::vector<int>{} : std::vector<int>{1, 3, 5}) add(1, {{"order", order}});
      return out;
    }
    for (const double f : quick ? std::vector<double>{2, 0.71} : std::vector<double>{4, 2.8, 2, 1.41, 0.71, 0.5})
      add(f, {});
    for (const int order : quick ? std::vector<int>{3} : std::vector<int>{2, 3, 5, 9}) add(1, {{"order", order}});
    add(1, {{kNear, 0.5}});
    if (quick) return out;
    for (const double near : {0.0, 2.0}) add(1, {{kNear, near}});
    for (const double f : {2.0, 1.41, 0.71, 0.5}) add(f, {{"order", 4}});
    for (const int links : {3, 4, 10}) add(1, {{"links", links}});
    for (const int rays : {64, 1024}) add(1, {{"rays", rays}});
    for (const int rank : {8, 16, 64}) add(1, {{"max_rank", rank}});
    for (const int rays : {512, 1024, 16384}) add(1, {{"relight_rays", rays}});
    // Along the front: everything a little cheaper, or finer, at once.
    for (const double f : {2.8, 2.0, 1.41}) add(f, {{kNear, 2}});
    add(2.8, {{kNear, 2}, {"order", 4}, {"rays", 64}, {"max_rank", 8}, {"relight_rays", 1024}});
    add(2.8, {{"order", 4}, {"rays", 64}, {"max_rank", 8}, {"relight_rays", 1024}});
    add(2, {{"order", 4}, {"rays", 128}, {"max_rank", 16}, {"relight_rays", 1024}});
    add(1.41, {{"order", 5}, {"rays", 128}, {"max_rank", 16}, {"relight_rays", 2048}});
    add(0.71, {{"rays", 512}, {"relight_rays", 2048}, {"max_rank", 48}});
    add(0.71, {{kNear, 2}, {"rays", 1024}, {"relight_rays", 2048}, {"max_rank", 48}});
    add(0.5, {{"rays", 512}, {"relight_rays", 1024}, {"max_rank", 64}});
    return out;
  }

  absl::StatusOr<std::unique_ptr<Model>> prepare(LitLevel* level, const Settings& settings,
                                                 const std::filesystem::path& scratch) const override {
    const BakeParams& chosen = level->plan().params;
    BakeParams params = sl17() ? sl17_params() : chosen;
    params.texels_per_metre = chosen.texels_per_metre;
    params.lightmap_size = chosen.lightmap_size;
    params.seed = chosen.seed;
    const auto set = [&]<typename T>(const char* name, T* value) {
      if (const auto it = settings.find(name); it != settings.end()) *value = static_cast<T>(it->second);
    };
    set("spacing", &params.spacing);
    set(kNear, &params.near_field);
    set("order", &params.order);
    set("probes", &params.probes);
    set("links", &params.links);
    set("rays", &params.rays);
    set("relight_rays", &params.relight_rays);
    set("max_rank", &params.max_rank);
    return LoomModel::create(level, params, scratch / "level.loom");
  }

 private:
  bool sl17() const { return method_ == BakeMethod::kSl17; }

  BakeMethod method_;
};

class TunedMethod : public Method {
 public:
  std::string name() const override { return "tuned"; }
  std::string title() const override { return "lightloom --error"; }
  std::string version() const override { return std::string(kTunerVersion); }
  std::string about() const override {
    return "lightloom bake, which is --error 0.05, and others: spacing, near field, order, rays and rank chosen for a "
           "target, by lights of the level's own space. Its seconds include the choice.";
  }
  std::vector<Variant> sweep(const LitLevel&, bool quick) const override {
    std::vector<Variant> out;
    for (const double error :
         quick ? std::vector<double>{0.05, 0.1} : std::vector<double>{0.05, 0.035, 0.07, 0.1, 0.14, 0.2}) {
      out.push_back({"error " + plain(error), {{"error", error}}});
    }
    return out;
  }
  absl::StatusOr<std::unique_ptr<Model>> prepare(LitLevel* level, const Settings& settings,
                                                 const std::filesystem::path& scratch) const override {
    BakeControl control;
    control.threads = level->threads();
    control.cancel = &interrupted();
    const double before = processor_seconds();
    LL_ASSIGN_OR_RETURN(const Tuning tuning,
                        tune(level->tracer(), level->plan().params, {settings.at("error"), 0}, control));
    return LoomModel::create(level, tuning.chosen.params, scratch / "level.loom", tuning.seconds,
                             processor_seconds() - before);
  }
};

}  // namespace

std::unique_ptr<Method> tuned_method() { return std::make_unique<TunedMethod>(); }
std::unique_ptr<Method> loom_method(BakeMethod method) { return std::make_unique<LoomMethod>(method); }

}  // namespace lightloom::eval
