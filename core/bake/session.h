// One level being baked by this process: what all its tasks share is made once and kept.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "core/bake/bake_traces.h"
#include "core/bake/cell_record.h"
#include "core/bake/plan.h"
#include "core/bake/relight_record.h"
#include "core/bake/reuse.h"
#include "core/bake/task_blobs.h"
#include "core/receivers/receiver_search.h"
#include "core/transport/visibility_cache.h"

namespace lightloom {

/// Stores a chunk; called from any thread.
using ChunkSink = std::function<absl::StatusOr<ChunkRef>(std::span<const uint8_t> bytes)>;

/// A finished cell, and what it cost this time: not the same in every run.
struct BakedCell {
  CellRecord record;
  uint64_t visibility_rays = 0;
};

/// Thread-safe after construction. What it returns and stores is a pure function of scene and parameters.
/// Errors of all methods: an index that is not planned (OutOfRange), cancellation, and those of the sink.
class BakeSession {
 public:
  /// Plans the bake. Errors: make_plan's. The tracer and its scene must outlive the session unchanged.
  static absl::StatusOr<std::unique_ptr<BakeSession>> create(const RayTracer& tracer, const BakeParams& params,
                                                             const BakeControl& control);
  /// The session owns the scene.
  static absl::StatusOr<std::unique_ptr<BakeSession>> create(Scene scene, const BakeParams& params,
                                                             const BakeControl& control);
  BakeSession(const BakeSession&) = delete;
  BakeSession& operator=(const BakeSession&) = delete;

  const Plan& plan() const { return plan_; }
  const Scene& scene() const { return tracer_.scene(); }
  /// About what it keeps in memory, the scene too; grows with what it remembers between cells.
  uint64_t bytes() const;
  /// Two sessions with equal digests give the same bytes for the same task.
  const Digest& plan_digest() const { return plan_digest_; }

  /// Bakes plan().cells[index] and stores its chunk. `cancel` may be null, here and below.
  absl::StatusOr<BakedCell> cell(size_t index, const ChunkSink& sink, const CancelFlag* cancel = nullptr) const;
  /// Relight sets of the plan's probes first … first + count − 1, in order.
  absl::StatusOr<std::vector<RelightRecord>> relight(size_t first, size_t count, const ChunkSink& sink,
                                                     const CancelFlag* cancel = nullptr) const;
  /// The receivers of an object; size 0 and nothing stored if it has none.
  absl::StatusOr<ChunkRef> surface(size_t object, const ChunkSink& sink) const;
  /// Of all calls so far, also those whose chunk could not be stored.
  struct Spent {
    uint64_t gather_rays = 0, visibility_rays = 0;
    double transport_seconds = 0, compress_seconds = 0, relight_seconds = 0;  ///< thread time
    uint64_t cell_rays() const { return gather_rays + visibility_rays; }
  };
  Spent spent() const;
  /// What the level's cells of the world hold: what traces are compared by.
  const WorldContents& world() const;
  /// What of an earlier bake holds: see find_reuse(). `load` gives its traces. The last answer is remembered. Errors: those
  /// of `load`, cancellation.
  absl::StatusOr<std::shared_ptr<const Reuse>> reuse(const EarlierResults& earlier,
                                                     const std::function<absl::StatusOr<BakeTraces>()>& load,
                                                     const Parallel& parallel) const;
  struct Finished {
    Manifest manifest;
    BakeTraces traces;
  };
  /// See assemble(). `relight`: by probes of the plan, those without a chunk are absent.
  absl::StatusOr<Finished> finish(std::vector<CellRecord> cells, std::vector<RelightRecord> relight,
                                  const std::vector<ChunkRef>& surfaces) const;

 private:
  /// What a session keeps alive; empty around a borrowed tracer.
  struct Owned {
    std::unique_ptr<const Scene> scene;
    std::unique_ptr<const RayTracer> tracer;
  };
  BakeSession(const RayTracer& tracer, Plan plan);

  Owned owned_;
  const RayTracer& tracer_;
  const Plan plan_;
  const Digest plan_digest_;
  std::vector<Vec3> probes_;                // the plan's; the cache refers to them
  std::unique_ptr<VisibilityCache> cache_;  // none for SL17, as published
  ReceiverSearch search_;
  const uint64_t bytes_;  // without what grows
  mutable std::once_flag world_known_;
  mutable WorldContents world_;  // once it is known
  mutable std::mutex mutex_;
  mutable Spent spent_;                                                    // guarded by mutex_
  mutable std::pair<EarlierResults, std::shared_ptr<const Reuse>> reuse_;  // guarded by mutex_
};

}  // namespace lightloom
