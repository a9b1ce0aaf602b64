#include "cli/eval/lit_level.h"

#include <nlohmann/json.hpp>

#include <algorithm>

#include "cli/files.h"
#include "cli/interrupt.h"
#include "core/base/file.h"
#include "core/base/text.h"
#include "core/base/version.h"
#include "core/reference/path_tracer.h"
#include "core/relight/lightmap.h"

namespace lightloom::eval {
namespace {

constexpr int kDirectSamples = 16;       // points per texel where direct light and colours are taken
constexpr size_t kRememberedInputs = 3;  // methods of one level have few sets of elements

/// `most` of them, the first and the last too.
std::vector<Rig> spread(std::vector<Rig> rigs, int most) {
  const size_t n = rigs.size(), m = static_cast<size_t>(most);
  if (m == 0 || m >= n) return rigs;
  std::vector<Rig> some;
  for (size_t i = 0; i < m; ++i) some.push_back(std::move(rigs[m == 1 ? 0 : i * (n - 1) / (m - 1)]));
  return some;
}

Digest digest_of(const SurfaceElements& elements) {
  Hasher h;
  for (const Receiver& r : elements.receivers.all) h.value(r.object).value(r.key);
  return h.finish();
}

/// What a stored truth is of.
std::string key_of(const LitLevel& level, const std::string& rig, const TruthOptions& o) {
  Hasher h;
  h.string("truth").digest(level.digest()).string(rig).value(o.bounces).value(o.samples).value(o.most_samples);
  h.string(kMethodVersion).string(kReferenceVersion);  // receivers follow from the one, E from the other
  h.value(level.plan().params.texels_per_metre).value(level.plan().params.lightmap_size);
  h.value(o.noise).value(level.elements().layout.width).value(level.elements().layout.height);
  return h.finish().hex();
}

}  // namespace

absl::StatusOr<LitLevel> LitLevel::create(const std::string& scene, const std::string& lights, int most,
                                          const BakeParams& params, int threads, ProgressBar* bar) {
  LitLevel level;
  level.threads_ = threads;
  level.bar_ = bar;
  LL_ASSIGN_OR_RETURN(level.level_, load_level(scene));
  Hasher h;
  LL_ASSIGN_OR_RETURN(const auto scene_bytes, read_file(scene));
  h.digest(scene_hash(level.scene())).digest(sha256(scene_bytes));
  for (const std::string& linked : linked_files(scene)) {
    LL_ASSIGN_OR_RETURN(const auto linked_bytes, read_file(linked));
    h.digest(sha256(linked_bytes));
  }
  level.lights_ = level.scene().lights;
  for (const Material& m : level.scene().materials) level.emission_.push_back(m.emission);
  level.environment_ = level.scene().environment;
  if (lights.empty()) {
    Rig own;
    own.name = "level";
    own.lights = level.lights_;
    level.rigs_.push_back(std::move(own));
  } else {
    LL_ASSIGN_OR_RETURN(auto rigs, load_rigs(lights));
    if (rigs.empty()) return absl::InvalidArgumentError(lights + " has no rigs; add one, or leave --lights out");
    level.rigs_ = spread(std::move(rigs), most);
    LL_ASSIGN_OR_RETURN(const auto light_bytes, read_file(lights));
    h.digest(sha256(light_bytes));
  }
  level.digest_ = h.finish();
  for (size_t i = 0; i < level.rigs(); ++i) LL_RETURN_IF_ERROR(level.select(i));  // they fit, or no work is done

  BakeControl control;
  control.threads = threads;
  control.cancel = &interrupted();
  LL_ASSIGN_OR_RETURN(level.plan_, make_plan(level.tracer(), params, control));
  level.elements_ = {level.plan_.layout, level.plan_.receivers};
  return level;
}

absl::Status LitLevel::select(size_t rig) {
  Scene& scene = *level_.scene;
  scene.lights = lights_;
  for (size_t i = 0; i < emission_.size(); ++i) scene.materials[i].emission = emission_[i];
  scene.environment = environment_;
  return apply_rig(rigs_[rig], &scene);
}

absl::StatusOr<const std::vector<SurfaceInputs>*> LitLevel::inputs(const SurfaceElements& elements) {
  const Digest digest = digest_of(elements);
  if (const auto known = inputs_.find(digest); known != inputs_.end()) return &known->second;
  if (inputs_.size() >= kRememberedInputs) inputs_.erase(inputs_.begin());
  std::vector<SurfaceInputs> all;
  for (size_t i = 0; i < rigs(); ++i) {
    LL_RETURN_IF_ERROR(select(i));
    LL_ASSIGN_OR_RETURN(auto inputs, light_surfaces(tracer(), elements, kDirectSamples,
                                                    bar_->parallel("direct light of " + name(i), threads_)));
    LL_RETURN_IF_ERROR(not_interrupted());
    all.push_back(std::move(inputs));
  }
  return &inputs_.emplace(digest, std::move(all)).first->second;
}

absl::StatusOr<Truth> LitLevel::truth(size_t rig, const TruthOptions& o, const std::filesystem::path& folder) {
  const std::filesystem::path image = folder / (std::to_string(rig) + ".exr"),
                              facts = folder / (std::to_string(rig) + ".json");
  const std::string key = key_of(*this, name(rig), o);
  Truth truth;
  if (const auto bytes = read_file(facts); bytes.ok()) {
    const auto json = nlohmann::json::parse(bytes->begin(), bytes->end(), nullptr, /*allow_exceptions=*/false);
    const auto is_number = [&](const char* name) { return json.contains(name) && json[name].is_number(); };
    if (json.is_object() && json.contains("key") && json["key"] == key && is_number("noise") && is_number("samples")) {
      auto stored = read_exr(image);
      if (stored.ok()) {
        truth.image = *std::move(stored);
        truth.noise = json.value("noise", 0.0);
        truth.samples = json.value("samples", 0);
        return truth;
      }
    }
  }

  LL_RETURN_IF_ERROR(select(rig));
  ReferenceOptions options;
  options.bounces = o.bounces;
  options.parallel = bar_->parallel("truth of " + name(rig), threads_);
  for (truth.samples = o.samples;; truth.samples = std::min(4 * truth.samples, o.most_samples)) {
    options.samples = truth.samples;
    LL_ASSIGN_OR_RETURN(ReferenceResult traced, reference_lightmap(tracer(), elements_.layout, options));
    LL_RETURN_IF_ERROR(not_interrupted());
    truth.image = std::move(traced.image);
    truth.noise = traced.noise;
    if (truth.noise <= o.noise || truth.samples >= o.most_samples) break;
  }
  const auto dark = [&](const char* channel) {
    const std::vector<float>& values = *truth.image.channel(channel);
    return std::all_of(values.begin(), values.end(), [](float v) { return v == 0; });
  };
  if (dark("R") && dark("G") && dark("B")) {
    return absl::InvalidArgumentError(
        "rig '" + printable(name(rig)) +
        "' lights nothing indirectly, so there is nothing to compare: leave it out, or give "
        "rigs by --lights");
  }
  // Methods are judged where all of them must have a value: at the receivers.
  const Image receivers = lightmap_image(elements_, std::vector<Vec3>(elements_.receivers.all.size()));
  std::vector<float>& valid = *truth.image.channel("A");
  for (size_t i = 0; i < valid.size(); ++i) valid[i] = std::min(valid[i], (*receivers.channel("A"))[i]);
  std::error_code none;
  std::filesystem::remove(facts, none);  // it speaks of the image before
  LL_RETURN_IF_ERROR(write_exr(truth.image, image));
  LL_RETURN_IF_ERROR(write_file_atomic(
      facts,
      nlohmann::json{{"key", key}, {"rig", name(rig)}, {"noise", truth.noise}, {"samples", truth.samples}}.dump()));
  return truth;
}

}  // namespace lightloom::eval
