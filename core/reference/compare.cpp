#include "core/reference/compare.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace lightloom {
namespace {

struct Block {
  Vec3 a, b;
  double weight = 0;
};

bool valid(const Image& image, size_t i) {
  const auto* alpha = image.channel("A");
  return !alpha || (*alpha)[i] > 0.5f;
}

float area(const Image& a, const Image& b, size_t i) {
  if (const auto* c = b.channel("area")) return (*c)[i];
  if (const auto* c = a.channel("area")) return (*c)[i];
  return 1;
}

absl::Status check_image(const Image& image, const char* which) {
  for (const char* name : {"R", "G", "B"}) {
    if (!image.channel(name)) {
      return absl::InvalidArgumentError(std::string(which) + " image has no channel " + name + "; give an RGB EXR");
    }
  }
  return absl::OkStatus();
}

double percentile(std::vector<std::pair<double, double>>* values, double share) {
  std::sort(values->begin(), values->end());
  double total = 0;
  for (const auto& v : *values) total += v.second;
  double below = 0;
  for (const auto& v : *values) {
    below += v.second;
    if (below >= share * total) return v.first;
  }
  return values->empty() ? 0 : values->back().first;
}

}  // namespace

absl::StatusOr<Comparison> compare(const Image& a, const Image& b, const CompareOptions& options) {
  LL_RETURN_IF_ERROR(check_image(a, "first"));
  LL_RETURN_IF_ERROR(check_image(b, "second"));
  if (a.width != b.width || a.height != b.height) {
    return absl::InvalidArgumentError("images differ in size: " + std::to_string(a.width) + "x" +
                                      std::to_string(a.height) + " and " + std::to_string(b.width) + "x" +
                                      std::to_string(b.height));
  }
  Comparison result;
  std::vector<Block> blocks;
  for (int y0 = 0; y0 < a.height; y0 += options.block) {
    for (int x0 = 0; x0 < a.width; x0 += options.block) {
      Block block;
      for (int y = y0; y < std::min(y0 + options.block, a.height); ++y) {
        for (int x = x0; x < std::min(x0 + options.block, a.width); ++x) {
          const size_t i = a.index(x, y);
          if (!valid(a, i) || !valid(b, i)) continue;
          const Vec3 va = a.rgb(x, y), vb = b.rgb(x, y) * options.scale_b;
          if (!is_finite(va) || !is_finite(vb)) {
            return absl::InvalidArgumentError("value at (" + std::to_string(x) + ", " + std::to_string(y) +
                                              ") is not finite");
          }
          const float w = area(a, b, i);
          if (!(w >= 0) || !std::isfinite(w)) {
            return absl::InvalidArgumentError("area at (" + std::to_string(x) + ", " + std::to_string(y) +
                                              ") is not a finite number of square metres");
          }
          block.a += va * w;
          block.b += vb * w;
          block.weight += static_cast<double>(w);
          ++result.texels;
        }
      }
      if (block.weight > 0) {
        block.a *= static_cast<float>(1 / block.weight);
        block.b *= static_cast<float>(1 / block.weight);
        blocks.push_back(block);
      }
    }
  }
  if (blocks.empty()) return absl::InvalidArgumentError("no pixel is valid in both images");

  double weight = 0, error2 = 0, truth2 = 0, sum_a = 0, sum_b = 0, peak = 0;
  for (const Block& k : blocks) {
    const Vec3 d = k.a - k.b;
    weight += 3 * k.weight;
    error2 += k.weight * dot(d, d);
    truth2 += k.weight * dot(k.b, k.b);
    sum_a += k.weight * (k.a.x + k.a.y + k.a.z);
    sum_b += k.weight * (k.b.x + k.b.y + k.b.z);
    peak = std::max({peak, static_cast<double>(k.b.x), static_cast<double>(k.b.y), static_cast<double>(k.b.z)});
  }
  const double mean_b = sum_b / weight;
  const double infinity = std::numeric_limits<double>::infinity();
  result.rel_rmse = truth2 > 0 ? std::sqrt(error2 / truth2) : (error2 > 0 ? infinity : 0);
  const double rmse = std::sqrt(error2 / weight);
  result.psnr = rmse > 0 ? 20 * std::log10(peak / rmse) : infinity;
  result.bias = sum_b > 0 ? (sum_a - sum_b) / sum_b : 0;

  std::vector<std::pair<double, double>> errors;
  double bright_a = 0, bright_b = 0;
  std::vector<std::pair<double, double>> bright;
  for (const Block& k : blocks) {
    for (int c = 0; c < 3; ++c) {
      errors.emplace_back(mean_b > 0 ? std::abs(static_cast<double>(k.a[c]) - k.b[c]) / mean_b : 0, k.weight);
    }
    const double block_b = (k.b.x + k.b.y + k.b.z), block_a = (k.a.x + k.a.y + k.a.z);
    if (block_b > 0.1 * 3 * mean_b) {
      bright_a += k.weight * block_a;
      bright_b += k.weight * block_b;
      bright.emplace_back(k.weight * block_a, k.weight * block_b);
    }
  }
  result.p50 = percentile(&errors, 0.50);
  result.p95 = percentile(&errors, 0.95);
  result.p99 = percentile(&errors, 0.99);
  if (bright_b > 0) {
    // Ratio estimator: its variance is that of the residuals a − ratio·b.
    result.ratio = bright_a / bright_b;
    double residual2 = 0;
    for (const auto& [va, vb] : bright) residual2 += (va - result.ratio * vb) * (va - result.ratio * vb);
    result.ratio_error = std::sqrt(residual2) / bright_b;
  }
  return result;
}

Image difference_image(const Image& a, const Image& b, const CompareOptions& options, float gain) {
  Image out(a.width, a.height, {"R", "G", "B"});
  double sum = 0, count = 0;
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x) {
      if (!valid(a, a.index(x, y)) || !valid(b, a.index(x, y))) continue;
      const Vec3 v = b.rgb(x, y) * options.scale_b;
      sum += v.x + v.y + v.z;
      count += 3;
    }
  }
  // Twice the mean is white in the pictures beside it, so it is here.
  const float exposure = sum > 0 ? static_cast<float>(count / sum) / 2 : 1;
  const auto in_block = [&](int x0, int y0, const auto& visit) {
    for (int y = y0; y < std::min(y0 + options.block, a.height); ++y) {
      for (int x = x0; x < std::min(x0 + options.block, a.width); ++x) {
        if (valid(a, a.index(x, y)) && valid(b, a.index(x, y))) visit(x, y);
      }
    }
  };
  for (int y0 = 0; y0 < a.height; y0 += options.block) {
    for (int x0 = 0; x0 < a.width; x0 += options.block) {
      Vec3 d;
      float weight = 0;
      in_block(x0, y0, [&](int x, int y) {
        const float w = area(a, b, a.index(x, y));
        d += (a.rgb(x, y) - b.rgb(x, y) * options.scale_b) * w;
        weight += w;
      });
      if (!(weight > 0)) continue;
      d *= gain * exposure / weight;
      in_block(x0, y0, [&](int x, int y) { out.set_rgb(x, y, {std::abs(d.x), std::abs(d.y), std::abs(d.z)}); });
    }
  }
  return out;
}

}  // namespace lightloom
