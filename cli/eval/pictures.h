// What the numbers of an evaluation look like: E by the truth and by each method, where it is off, and a closer look there.
#pragma once

#include <string>
#include <vector>

#include "cli/eval/evaluation.h"

namespace lightloom::eval {

/// PNG files in the evaluation's folder.
struct Picture {
  std::string title;  ///< the truth, or the method's
  std::string e, heat, crop, crop_heat;
};

struct Sheet {
  std::string rig, words;         ///< why this rig
  std::vector<Picture> pictures;  ///< the truth first, without heat maps
};

/// Where a heat map is at its end: |ΔE| ÷ mean of the truth.
inline constexpr float kHeatTop = 0.5f;

/// Of each method's default under the rig where ours has its median error, and under its worst. Through the level's first
/// camera; of the lightmap itself if it has none.
absl::StatusOr<std::vector<Sheet>> make_pictures(LitLevel* level, const Evaluation& evaluation,
                                                 const std::string& folder);

/// Black, violet, orange, yellow for 0..1, linear RGB.
Vec3 heat_colour(float t);

}  // namespace lightloom::eval
