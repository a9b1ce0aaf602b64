#include "cli/eval/expected_error.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "cli/eval/rank_correlation.h"
#include "cli/eval/run.h"
#include "core/reference/compare.h"
#include "core/relight/lightmap.h"
#include "core/tuning/operator_norm.h"
#include "core/tuning/receiver_sample.h"

namespace lightloom::eval {
namespace {

constexpr size_t kReceivers = 1024;
constexpr uint64_t kSeed = 0x5b1;
constexpr size_t kTenths = 10;

double mean(Vec3 v) { return static_cast<double>(v.x + v.y + v.z) / 3; }
Vec3 abs(Vec3 v) { return {std::abs(v.x), std::abs(v.y), std::abs(v.z)}; }

double mean_over_area(const Image& image) {
  const std::vector<float>*valid = image.channel("A"), *area = image.channel("area");
  double sum = 0, weights = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const size_t i = image.index(x, y);
      if (!((*valid)[i] > 0.5f)) continue;
      const double weight = area == nullptr ? 1 : static_cast<double>((*area)[i]);
      sum += weight * mean(image.rgb(x, y));
      weights += weight;
    }
  }
  return weights > 0 ? sum / weights : 0;
}

}  // namespace

double ExpectedError::correlation() const { return rank_correlation(norm, error); }
double ExpectedError::own_correlation() const { return rank_correlation(norm, own_error); }

std::vector<ExpectedError::Tenth> ExpectedError::tenths() const {
  std::vector<size_t> by_norm(norm.size());
  std::iota(by_norm.begin(), by_norm.end(), size_t{0});
  std::stable_sort(by_norm.begin(), by_norm.end(), [&](size_t a, size_t b) { return norm[a] < norm[b]; });
  std::vector<Tenth> out;
  for (size_t t = 0; t < kTenths; ++t) {
    std::vector<double> norms, errors;
    for (size_t i = t * norm.size() / kTenths; i < (t + 1) * norm.size() / kTenths; ++i) {
      norms.push_back(norm[by_norm[i]]);
      errors.push_back(own_error[by_norm[i]]);
    }
    if (!norms.empty()) out.push_back({median(norms), median(errors)});
  }
  return out;
}

absl::StatusOr<ExpectedError> expected_error(LitLevel* level, const std::vector<Truth>& truths,
                                             const std::vector<Image>& lightmaps) {
  const Plan& plan = level->plan();
  const std::vector<uint32_t> sample = stratified(front_receivers(plan.receivers), kReceivers, kSeed);
  ExpectedError out;
  LL_ASSIGN_OR_RETURN(out.norm, operator_norms(level->tracer(), plan, sample,
                                               level->bar()->parallel("operator norm", level->threads())));
  out.error.assign(sample.size(), 0);
  out.own_error.assign(sample.size(), 0);
  std::vector<double> e(sample.size());
  std::vector<bool> valid(sample.size(), true);
  double noise2 = 0, error2 = 0;
  for (size_t rig = 0; rig < truths.size(); ++rig) {
    const Image& truth = truths[rig].image;
    LL_ASSIGN_OR_RETURN(const Comparison c, compare(lightmaps[rig], truth, {}));  // of one size, or an error
    const double scale = mean_over_area(truth) * static_cast<double>(truths.size());
    for (size_t i = 0; i < sample.size(); ++i) {
      const auto [x, y] = pixel_of(level->elements(), plan.receivers.all[sample[i]]);
      valid[i] = valid[i] && (*truth.channel("A"))[truth.index(x, y)] > 0.5f;
      const double error = mean(abs(lightmaps[rig].rgb(x, y) - truth.rgb(x, y)));
      out.error[i] += error / scale;
      out.own_error[i] += error;
      e[i] += mean(truth.rgb(x, y));
    }
    noise2 += truths[rig].noise * truths[rig].noise;
    error2 += c.rel_rmse * c.rel_rmse;
  }
  out.noise = error2 > 0 ? std::min(1.0, noise2 / error2) : 1;
  size_t kept = 0;
  for (size_t i = 0; i < sample.size(); ++i) {
    if (!valid[i] || !(e[i] > 0)) continue;
    out.norm[kept] = out.norm[i];
    out.error[kept] = out.error[i];
    out.own_error[kept++] = out.own_error[i] / e[i];
  }
  out.norm.resize(kept);
  out.error.resize(kept);
  out.own_error.resize(kept);
  return out;
}

}  // namespace lightloom::eval
