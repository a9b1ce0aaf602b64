// A way to light a level from what was computed before, as `lightloom eval` sees it: all are prepared, timed and judged alike.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cli/eval/lit_level.h"

namespace lightloom::eval {

/// By name; numbers all.
using Settings = std::map<std::string, double>;

/// One point of a method's sweep.
struct Variant {
  std::string label;  ///< relative to the method's default, so that levels can be pooled: "spacing ×0.5"
  Settings settings;
};

/// What preparing took and left.
struct Facts {
  double seconds = 0, core_seconds = 0;  ///< wall time, and of all threads
  std::map<std::string, double> stages;  ///< of the wall time; may be empty
  uint64_t bytes = 0;                    ///< stored
  uint64_t frame_bytes = 0;              ///< of these, what a frame reads in which all light changes
  uint64_t probes = 0;
};

/// That frames are timed on: how well work is spread over more is another question.
inline constexpr int kFrameThreads = 1;

/// A prepared method.
class Model {
 public:
  virtual ~Model() = default;
  virtual const Facts& facts() const = 0;
  /// E as lightmap_image() has it, under the level's rig `rig`, after `bounces` frames from darkness.
  virtual absl::StatusOr<Image> light(size_t rig, int bounces) = 0;
  /// Milliseconds of each of `frames` frames in which the light of every surface changes, on kFrameThreads. Empty: it has no
  /// frames, because its light cannot change.
  virtual absl::StatusOr<std::vector<double>> frame_ms(int frames) = 0;
};

class Method {
 public:
  virtual ~Method() = default;
  virtual std::string name() const = 0;   ///< as --methods has it
  virtual std::string title() const = 0;  ///< in a chart
  virtual std::string about() const = 0;  ///< how it is done here, and from what source
  /// Of what its results are computed by, besides the bake: remembered results of another one are measured again.
  virtual std::string version() const { return ""; }
  /// False: its light cannot change, so it has no frames.
  virtual bool has_frames() const { return true; }
  /// Its own default first.
  virtual std::vector<Variant> sweep(const LitLevel& level, bool quick) const = 0;
  /// `scratch`: a folder for it alone, while the model lives. It refers to the level.
  virtual absl::StatusOr<std::unique_ptr<Model>> prepare(LitLevel* level, const Settings& settings,
                                                         const std::filesystem::path& scratch) const = 0;
};

/// The name of our bake as it is by default.
inline constexpr const char* kDefaultMethod = "default";

/// All methods, ours first.
const std::vector<std::unique_ptr<Method>>& all_methods();

// One maker each, in files of their own.
std::unique_ptr<Method> loom_method(BakeMethod method);
std::unique_ptr<Method> tuned_method();
std::unique_ptr<Method> sh_method();
std::unique_ptr<Method> ddgi_method();
std::unique_ptr<Method> static_lightmap_method();

/// "0.5", "×0.5".
std::string plain(double number);
std::string times(double factor);

/// Processor seconds of this process so far, all threads.
double processor_seconds();

}  // namespace lightloom::eval
