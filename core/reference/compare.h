// How far one irradiance image is from another.
#pragma once

#include "core/scene/image.h"

namespace lightloom {

struct CompareOptions {
  int block = 1;      ///< values are averaged over block × block pixels first, valid ones only
  float scale_b = 1;  ///< factor on the second image
};

/// All over pixels valid in both images (A > 0.5, or no A), weighted by the `area` channel of either, three colour
/// channels together. Image b is the truth.
struct Comparison {
  double rel_rmse = 0;               ///< ‖a − b‖₂ ÷ ‖b‖₂
  double psnr = 0;                   ///< dB, peak = largest value of b
  double bias = 0;                   ///< Σ(a − b) ÷ Σb
  double p50 = 0, p95 = 0, p99 = 0;  ///< percentiles of |a − b| ÷ mean b
  double ratio = 0;                  ///< Σa ÷ Σb over blocks above 10 % of the mean of b
  double ratio_error = 0;            ///< standard error of `ratio`, from the spread between blocks
  uint64_t texels = 0;               ///< valid pixels
};

/// Fails if sizes differ, nothing is valid in both, or a valid value is not finite.
absl::StatusOr<Comparison> compare(const Image& a, const Image& b, const CompareOptions& options);

/// |a − scale·b| times `gain`, per block, 0 where not valid in both; exposed by the truth's mean so that 1 is white.
Image difference_image(const Image& a, const Image& b, const CompareOptions& options, float gain);

}  // namespace lightloom
