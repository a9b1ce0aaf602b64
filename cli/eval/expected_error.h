// Whether the error that no light has to be chosen for, SL17's operator norm, says where the default settings err.
#pragma once

#include <vector>

#include "cli/eval/lit_level.h"

namespace lightloom::eval {

/// By receiver, for a sample of them spread over the level.
struct ExpectedError {
  std::vector<double> norm;   ///< core/tuning/operator_norm.h, of the default settings
  std::vector<double> error;  ///< |E − E_truth| ÷ the rig's mean E_truth, means over channels and rigs
  std::vector<double>
      own_error;  ///< Σ|E − E_truth| ÷ ΣE_truth of the receiver, sums over channels and rigs: dark ones count too
  double noise = 0;  ///< share of the squared errors that is the truth's own noise: it lowers correlations

  /// Spearman's, of the norm and the two kinds of error.
  double correlation() const;
  double own_correlation() const;
  /// Medians of norm and own_error over each tenth of the receivers, by norm.
  struct Tenth {
    double norm = 0, error = 0;
  };
  std::vector<Tenth> tenths() const;
};

/// `lightmaps`: E by the default settings, per rig. Errors: those of operator_norms.
absl::StatusOr<ExpectedError> expected_error(LitLevel* level, const std::vector<Truth>& truths,
                                             const std::vector<Image>& lightmaps);

}  // namespace lightloom::eval
