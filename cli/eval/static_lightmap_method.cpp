// What most engines ship: E path traced per texel, for one set of lights that may not change.
#include <cmath>

#include "cli/eval/method.h"
#include "cli/interrupt.h"
#include "core/base/half.h"
#include "core/base/stopwatch.h"
#include "core/reference/path_tracer.h"

namespace lightloom::eval {
namespace {

constexpr uint64_t kSeed = 1000;  // not that of the truth

class StaticLightmap : public Model {
 public:
  StaticLightmap(LitLevel* level, int samples) : level_(*level), samples_(samples) {
    facts_.bytes = level_.elements().receivers.all.size() * 3 * sizeof(Half);
  }

  const Facts& facts() const override { return facts_; }

  absl::StatusOr<Image> light(size_t rig, int bounces) override {
    LL_RETURN_IF_ERROR(level_.select(rig));
    ReferenceOptions options;
    options.bounces = bounces;
    options.samples = samples_;
    options.seed = kSeed;
    options.parallel = level_.bar()->parallel("static lightmap of " + level_.name(rig), level_.threads());
    const double before = processor_seconds();
    const Stopwatch watch;
    LL_ASSIGN_OR_RETURN(ReferenceResult traced, reference_lightmap(level_.tracer(), level_.elements().layout, options));
    LL_RETURN_IF_ERROR(not_interrupted());
    // Each rig is a bake of its own: what counts is the mean over those that were asked for.
    ++bakes_;
    facts_.seconds += (watch.seconds() - facts_.seconds) / bakes_;
    facts_.core_seconds += (processor_seconds() - before - facts_.core_seconds) / bakes_;
    return std::move(traced.image);
  }

  absl::StatusOr<std::vector<double>> frame_ms(int) override { return std::vector<double>{}; }

 private:
  LitLevel& level_;
  int samples_;
  Facts facts_;
  double bakes_ = 0;
};

class StaticLightmapMethod : public Method {
 public:
  std::string name() const override { return "static"; }
  std::string title() const override { return "static lightmap (1 rig)"; }
  std::string version() const override { return std::string(kReferenceVersion); }
  bool has_frames() const override { return false; }
  std::string about() const override {
    return "E path traced at every texel for one rig of lights (lightloom reference): nothing may move, and each rig "
           "is a bake "
           "of its own, whose seconds are given; the bytes are those of one rig, RGB as 16-bit floats.";
  }
  std::vector<Variant> sweep(const LitLevel&, bool quick) const override {
    std::vector<Variant> out;
    for (const int samples : quick ? std::vector<int>{256, 64} : std::vector<int>{256, 16, 64, 1024}) {
      out.push_back({std::to_string(samples) + " paths a texel", {{"samples", samples}}});
    }
    return out;
  }
  absl::StatusOr<std::unique_ptr<Model>> prepare(LitLevel* level, const Settings& settings,
                                                 const std::filesystem::path&) const override {
    return std::make_unique<StaticLightmap>(level, static_cast<int>(settings.at("samples")));
  }
};

}  // namespace

std::unique_ptr<Method> static_lightmap_method() { return std::make_unique<StaticLightmapMethod>(); }

}  // namespace lightloom::eval
