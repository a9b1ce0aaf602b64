// A row of the stability table: what may not go beyond a bound, measured. Each test of this folder checks one or more.
#pragma once

#include <functional>
#include <string>

#include "core/scene/image.h"

namespace lightloom::stability {

/// The rows of docs/failure-modes.md, in its order.
enum class Case {
  kSealedRooms,
  kNearLights,
  kUnseen,
  kUnexpectedLights,
  kFeedback,
  kDefects,
  kTransforms,
  kHdr,
  kMovingLight,
  kClusterBorders,
  kDegenerate
};

struct Row {
  Case of;
  std::string what;  ///< in words: quantity, level
  double measured = 0;
  double bound = 0;     ///< the row holds if measured ≤ bound
  double no_worse = 0;  ///< > 0: the row is known not to hold, and this is what `measured` may not exceed
};

/// Fails the test if the row does not hold (or, of one known not to hold: if it is worse than that, or holds now).
/// Where the environment names a folder LIGHTLOOM_STABILITY_OUT, writes row and picture there: a line of JSON in
/// NN-TEST.jsonl (NN: the case), {case, what, measured, bound, holds, picture}, and NN-TEST-N.png. `picture` is called
/// only then; null: none.
void check(const Row& row, const std::function<Image()>& picture = nullptr);

}  // namespace lightloom::stability
