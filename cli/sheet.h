// Four pictures in one: what the indirect light adds, and how far it is from the truth.
#pragma once

#include "cli/stage.h"
#include "core/reference/path_tracer.h"

namespace lightloom {

struct SheetOptions {
  int width = 480;    ///< of one picture
  int samples = 4;    ///< points per pixel, rounded down to a square number
  int bounces = 16;   ///< of the path tracer
  int paths = 256;    ///< of the path tracer, per pixel
  Parallel parallel;  ///< of the path tracer
};

/// Top: direct light only, with indirect light. Bottom: path traced, and the difference of the two right of and below
/// it as the eye sees them, eight times. All with one exposure (`*exposure` 0: from the path-traced picture; returned).
/// Ready for write_png.
absl::StatusOr<Image> make_sheet(Stage* stage, const Level& level, const Camera& camera, const SheetOptions& options,
                                 float* exposure);

}  // namespace lightloom
