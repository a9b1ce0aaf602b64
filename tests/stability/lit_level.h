// A baked level under its lights beside the truth: numbers and pictures.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/reference/compare.h"
#include "core/reference/path_tracer.h"
#include "core/relight/lightmap.h"
#include "tests/support/baked_level.h"
#include "tests/support/test_scenes.h"

namespace lightloom::stability {

using test::bake_level;
using test::BakedLevel;
using test::Device;
using test::value_or_die;

constexpr Vec3 kGrey{0.5f, 0.5f, 0.5f};

/// With probes every `spacing` metres, else by default.
std::unique_ptr<BakedLevel> bake_at(Scene scene, float spacing, float texels_per_metre);

/// E per surface element, W/m².
using Field = std::vector<Vec3>;
/// Says which surface elements count.
using Keep = std::function<bool(const Receiver&)>;

/// As test::light, on the SIMD runtime; direct light is averaged over `samples` points of each texel.
Field relight(const BakedLevel& level, int bounces, int samples = 16, Device device = Device::kSimd);

struct Truth {
  Image image;   ///< of reference_lightmap
  double noise;  ///< its own, as rel_rmse
};
Truth trace_truth(const BakedLevel& level, int bounces, int samples, uint64_t seed = 1);
/// One bounce, where paths from the receivers would hardly ever find what the lamps light: by `rays` from each lamp, whose
/// ends light the texels as points (Keller, "Instant Radiosity", 1997). Of each texel, 16 points see a sixteenth of them
/// each. Noise: 0, as it is not known.
Truth trace_from_lamps(const BakedLevel& level, uint32_t rays);

/// The truth per surface element; where it has none (backs, texels whose centre nothing covers), that of `instead`.
Field truth_field(const BakedLevel& level, const Truth& truth, const Field& instead);

double area(const BakedLevel& level, size_t element);
/// Area-weighted mean, channels together.
double mean(const BakedLevel& level, const Field& e, const Keep& keep = nullptr);
/// Against the truth, over the elements that are kept.
Comparison error(const BakedLevel& level, const Field& e, const Truth& truth, const Keep& keep = nullptr);
/// ‖a − b‖₂ ÷ ‖b‖₂, area-weighted, of fields that need not be of the same bake but have the same elements.
double difference(const BakedLevel& level, const Field& a, const Field& b);

/// Surfaces seen from behind are looked through.
struct View {
  Vec3 direction{0.35f, 0.75f, 1};  ///< to a camera outside that has the whole level in view
  bool inside = false;              ///< instead: a camera at `from` that looks at `to`
  Vec3 from{}, to{};
};
/// E/π, 160 pixels wide. `exposure` 0: chosen, and returned.
Image picture(const BakedLevel& level, const Field& e, const View& view, float* exposure);
/// Side by side: `a`, `b` by the same exposure, and 8 times their difference as the eye sees it. b is the truth.
Image beside(const BakedLevel& level, const Field& a, const Field& b, const View& view = {});

}  // namespace lightloom::stability
