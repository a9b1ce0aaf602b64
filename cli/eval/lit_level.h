// A level under several rigs of lights, one at a time, and the truth under each.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "cli/level.h"
#include "cli/progress.h"
#include "core/bake/plan.h"
#include "core/relight/surface_inputs.h"
#include "core/scene/image.h"
#include "core/scene/rig.h"

namespace lightloom::eval {

/// Path-traced E per texel.
struct Truth {
  Image image;       ///< A: 1 where methods are judged
  double noise = 0;  ///< its own, in units of rel_rmse
  int samples = 0;
};

struct TruthOptions {
  int bounces = 1;
  int samples = 1024;       ///< paths per texel to start from; four times as many as long as it is too noisy
  int most_samples = 4096;  ///< and then as it is
  double noise = 0.02;      ///< what is quiet enough, in units of rel_rmse
};

class LitLevel {
 public:
  /// The rigs of `lights`, `most` of them spread over the file's (0: all); without a file the level's own lights, as "level".
  /// Errors: files that cannot be read, rigs that do not fit the level, a level without receivers.
  static absl::StatusOr<LitLevel> create(const std::string& scene, const std::string& lights, int most,
                                         const BakeParams& params, int threads, ProgressBar* bar);

  const Scene& scene() const { return *level_.scene; }
  const RayTracer& tracer() const { return *level_.tracer; }
  /// Of the default method's parameters, nothing left to choose.
  const Plan& plan() const { return plan_; }
  /// The plan's receivers; their front sides are where methods are judged.
  const SurfaceElements& elements() const { return elements_; }
  size_t rigs() const { return rigs_.size(); }
  const std::string& name(size_t rig) const { return rigs_[rig].name; }
  /// All that results depend on but parameters: geometry, colours, rigs.
  const Digest& digest() const { return digest_; }

  /// The scene has the lights of this rig from now on.
  absl::Status select(size_t rig);

  /// Under each rig, of elements in their order. Remembered: methods have mostly the same elements.
  absl::StatusOr<const std::vector<SurfaceInputs>*> inputs(const SurfaceElements& elements);

  /// Kept in `folder`, and read from there when it fits. Errors: those of tracing and of files.
  absl::StatusOr<Truth> truth(size_t rig, const TruthOptions& options, const std::filesystem::path& folder);

  int threads() const { return threads_; }
  ProgressBar* bar() const { return bar_; }

 private:
  Level level_;
  std::vector<Light> lights_;  // the level's own, and what of its colours rigs replace
  std::vector<Vec3> emission_;
  Vec3 environment_;
  std::vector<Rig> rigs_;
  Digest digest_;
  Plan plan_;
  SurfaceElements elements_;
  std::map<Digest, std::vector<SurfaceInputs>> inputs_;
  int threads_ = 0;
  ProgressBar* bar_ = nullptr;
};

}  // namespace lightloom::eval
