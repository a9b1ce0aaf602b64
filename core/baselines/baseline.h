// Probe methods in use today, to compare lightloom with. A frame is lightloom's own (docs/pipeline.md, Runtime): light
// leaves every surface element, every probe gathers it along its fixed relight rays, and E is reconstructed at every
// receiver. The methods differ in what a probe keeps and in how a receiver reads it.
//
// What probes keep is held as floats here and counted in the bytes of the formats that the papers store. So the errors
// measured leave out those of the formats.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/parallel.h"
#include "core/baselines/relight_rays.h"
#include "core/relight/surface_inputs.h"

namespace lightloom {

/// Changes with any change of a baseline's E, bytes or work per frame: what is remembered of them does not hold then.
inline constexpr std::string_view kBaselinesVersion = "2";

/// Milliseconds of a frame's passes, summed over the frames.
struct FrameTimes {
  double radiosity = 0, relight = 0, receive = 0;
  double total() const { return radiosity + relight + receive; }
};

/// A way to light a level from probes, without an asset. Thread-safe: nothing changes after construction.
class Baseline {
 public:
  virtual ~Baseline() = default;
  Baseline(const Baseline&) = delete;
  Baseline& operator=(const Baseline&) = delete;

  /// E per receiver of the plan (Receivers::all order), W/m², after `frames` frames from darkness: each adds a bounce.
  /// `environment`: radiance of the sky. Adds to `times`, if any. The same bits for any number of threads.
  /// REQUIRES: three values of `inputs` per receiver, not negative; frames ≥ 0; `how` without cancellation.
  std::vector<Vec3> light(const SurfaceInputs& inputs, Vec3 environment, int frames, const Parallel& how,
                          FrameTimes* times = nullptr) const;

  /// Probes that are lit in every frame.
  uint64_t probes() const { return rays_.probes(); }
  /// Of all that stays in memory between frames, in the formats of the papers.
  virtual uint64_t bytes() const = 0;
  /// That a frame reads and writes of it: all once, and what probes keep once more. Arrays per surface element, which all
  /// methods share, are left out.
  virtual uint64_t bytes_per_frame() const = 0;

 protected:
  /// `kept`: floats that a probe keeps of its light.
  Baseline(RelightRays rays, size_t receivers, size_t kept)
      : rays_(std::move(rays)), receivers_(receivers), kept_(kept) {}

  const RelightRays& rays() const { return rays_; }
  size_t receivers() const { return receivers_; }

 private:
  /// What the probe keeps of the light along its rays.
  virtual void relight(uint32_t probe, std::span<const Vec3> radiance, std::span<float> kept) const = 0;
  /// E of receivers first, first + 1, …; `kept` is that of all probes.
  virtual void receive(size_t first, std::span<const float> kept, std::span<Vec3> irradiance) const = 0;

  RelightRays rays_;
  size_t receivers_;
  size_t kept_;
};

}  // namespace lightloom
