// Keeps resident what the camera needs most, within a budget: reads chunks through the caller's function, hands them to
// the backend a piece at a time, and drops what is worth less.
#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <vector>

#include "runtime/asset_source.h"
#include "runtime/backend.h"
#include "runtime/streaming/plan.h"
#include "runtime/streaming/sight.h"

namespace lightloom {

struct StreamView {
  Vec3 position;
  Vec3 velocity;  ///< metres per second: where the camera will be soon is looked at too

  bool operator==(const StreamView&) const = default;
};

struct StreamOptions {
  /// Device memory of cells and relight sets, about (StreamCosts); the backend's own budget is kept exactly.
  uint64_t budget = UINT64_MAX;
  /// Nothing is read while the backend has more than this that waits to be uploaded.
  uint64_t queue_bytes = 8 << 20;
  /// Hears of chunks that cannot be read; each is tried again later. On the thread of step().
  std::function<void(const absl::Status&)> report;
};

struct StreamState {
  uint32_t base_cells = 0, some_cells = 0, all_cells = 0;  ///< at exactly that level
  uint32_t base_probes = 0, all_probes = 0;
  uint32_t failing = 0;  ///< chunks that could not be had the last time
  uint64_t bytes = 0;
  uint64_t read_bytes = 0, read_chunks = 0, drops = 0;  ///< so far
  bool done = false;  ///< all that this view needs and the budget holds is there, or was put off
};

/// step() is for one thread at a time; the rest is for any.
class Streamer {
 public:
  enum class Progress {
    kStep,  ///< something was loaded or dropped; go on
    kWait,  ///< uploads or memory have to come first: record a frame
    kDone   ///< until the view changes
  };

  /// Keeps a reference to the backend, which has a manifest and must keep it. `read` is called by step().
  Streamer(Backend* backend, ReadChunk read, StreamOptions options);

  void set_view(const StreamView& view);
  /// Cells that touch the box are kept at full detail first of all; replaces the boxes of before.
  void pin(std::vector<Aabb> boxes);
  /// Reads and loads one chunk, or drops what makes room for one.
  Progress step();
  StreamState state() const;
  /// Per cell of the manifest.
  std::vector<CellLevel> cell_levels() const;

 private:
  struct Failure {
    uint32_t times = 0;
    uint64_t retry = 0;  ///< the view from which on it is tried again
  };
  struct Wish {
    AssetIndex::Target target;
    uint8_t level;
  };

  void look();
  bool looks_again() const;
  std::optional<Wish> next_base();
  std::optional<Wish> next_step();
  bool make_room(uint64_t bytes);
  void drop(const AssetIndex::Target& target);
  Progress load(const Wish& wish);
  /// `moving`: uploads were on their way before.
  Progress no_room(const AssetIndex::Target& target, const absl::Status& status, bool moving);
  Progress put_off(const AssetIndex::Target& target, const absl::Status& status);
  void note_failure(const AssetIndex::Target& target, Failure failure);
  bool waits(const AssetIndex::Target& target) const;
  size_t number_of(const AssetIndex::Target& target) const;
  uint8_t wanted(const AssetIndex::Target& target) const;
  const ChunkRef& ref_of(const AssetIndex::Target& target) const;
  uint8_t level_of(const AssetIndex::Target& target) const;
  uint64_t bytes_of(const AssetIndex::Target& target, uint8_t level) const;
  void set_level(const AssetIndex::Target& target, uint8_t level);

  Backend* const backend_;
  const ReadChunk read_;
  const StreamOptions options_;
  const AssetIndex& index_;
  const StreamCosts costs_;

  // Of step() alone.
  Sight sight_;
  StreamLevels want_;
  std::vector<StreamStep> steps_;
  std::vector<float> importance_;
  std::vector<uint32_t> base_order_;                         ///< cells, the most important first
  size_t next_surface_ = 0, next_base_ = 0, next_step_ = 0;  ///< all before are there or wait
  std::vector<uint8_t> chunk_;                               ///< what is read
  std::vector<Failure> failures_;                            ///< per surface, probe and cell, one after another
  std::vector<bool> surfaces_;
  uint32_t unseen_ = 1;  ///< what sight_ has learnt since the last look
  uint64_t seen_view_ = UINT64_MAX;
  StreamView seen_;                         ///< of the last look
  uint64_t budget_;                         ///< less than the options' if the backend has no room for that
  std::optional<uint64_t> squeezed_until_;  ///< a view
  uint64_t looked_view_ = 0;

  mutable std::mutex mutex_;  ///< guards all below; taken after nothing else
  StreamView view_;
  std::vector<Aabb> pins_;
  bool pins_are_new_ = false;
  uint64_t views_ = 0;  ///< how often the view was set
  StreamLevels now_;
  StreamState state_;
};

}  // namespace lightloom
