// The bake cells: which are resident, which may be computed, and which wait for it.
#pragma once

#include <vector>

#include "runtime/simd/surface.h"
#include "runtime/simd/turns.h"

namespace lightloom::simd {

class Cells {
 public:
  /// No cell is resident.
  Cells(std::pmr::memory_resource* memory, const AssetIndex& index);

  bool resident(uint32_t cell) const { return packed_[cell].clusters.size() != 0; }
  uint32_t resident_count() const { return resident_; }
  uint32_t active_count() const { return active_; }
  uint32_t waiting() const { return turns_.waiting(); }

  /// Replaces the cell if it is resident, or `over_base`, puts it above the one that is: that one stays. DataLoss if a receiver is that of another resident cell, or twice in this one;
  /// then nothing has changed.
  absl::Status load(uint32_t cell, PackedCell packed, bool over_base);
  /// Back to the base, if there is one.
  void drop_detail(uint32_t cell);
  uint64_t bytes_of(uint32_t cell) const { return packed_[cell].bytes(); }
  bool has_base(uint32_t cell) const { return base_[cell].clusters.size() != 0; }
  /// The E of its receivers stays what it was.
  void unload(uint32_t cell);
  /// A cell is active while it is resident with all its probes.
  void probe_loaded(uint32_t probe);
  void probe_unloaded(uint32_t probe);
  /// The probe was resident and now has another relight set.
  void probe_replaced(uint32_t probe);
  void lambda_changed(uint32_t probe);
  /// Cells whose near fields lie in a tile that the last radiosity() changed wait.
  void radiosity_changed(const Surface& surface);
  /// Every active cell waits.
  void reset();
  /// E shows some light of every cell: that of an asset before.
  void set_lit() { lit_.fill(1); }

  /// Chooses at most `most` (0: all) of the cells that wait, for the next project() and receive().
  void choose(uint32_t most) { chosen_ = turns_.take(most); }
  uint32_t chosen_count() const { return static_cast<uint32_t>(chosen_.size()); }
  void project(const Kernels& kernels, WorkerPool* pool, const float* lambda, uint32_t lambda_stride);
  /// `stay`: as Surface::receive; of a cell with another model than before E stays in any case, if `may_fade`.
  void receive(const Kernels& kernels, WorkerPool* pool, Surface* surface, bool stay, bool may_fade);
  /// Bytes of the matrices of the chosen cells.
  uint64_t projection_bytes() const;
  uint64_t reconstruction_bytes() const;

  uint64_t bytes() const { return bytes_; }

 private:
  bool active(uint32_t cell) const { return resident(cell) && missing_probes_[cell] == 0; }
  /// Sets or clears the receivers' bits; false, and nothing is set, if one is set already.
  bool claim(const PackedCell& cell);
  void release(const PackedCell& cell);
  void computes_anew(uint32_t cell);

  const AssetIndex& index_;
  std::pmr::vector<PackedCell> packed_;
  std::pmr::vector<PackedCell> base_;  ///< beneath it
  Array<uint32_t> missing_probes_;     ///< per cell: entries of its probe list that are not resident
  Array<uint64_t> received_;           ///< bit per surface element: a receiver of a resident cell
  Turns turns_;
  std::span<const uint32_t> chosen_;
  Array<uint8_t> lit_;    ///< per cell: E shows some model of it
  Array<uint8_t> fades_;  ///< per cell: but not yet the one that is resident
  uint32_t resident_ = 0, active_ = 0;
  uint64_t bytes_ = 0;
};

}  // namespace lightloom::simd
