// The runtime without a device: the passes of docs/runtime.md on the processor's vector units, with the amortised
// updates of lightloom.h. runtime/decoder.cpp is the same in plain double precision loops.
#pragma once

#include <memory>
#include <mutex>
#include <string>

#include "runtime/simd/cells.h"
#include "runtime/simd/probes.h"
#include "runtime/simd/surface.h"

namespace lightloom {

struct SimdOptions {
  int threads = 0;                              ///< 0: one per hardware thread
  bool smoothing = false;                       ///< makes room for SimdFrameOptions::smoothing, fade < 1
  std::pmr::memory_resource* memory = nullptr;  ///< all that stays allocated; null: new and delete. Must outlive it.
  const simd::Kernels* kernels = nullptr;       ///< null: the processor's best
  double (*milliseconds)() = nullptr;           ///< for SimdStats; null: a steady clock
};

/// How much one frame may do. By default everything that changed, exactly, at once.
struct SimdFrameOptions {
  uint32_t max_probes = 0;  ///< that are relit, in turn; 0: all that saw a change
  uint32_t max_cells = 0;   ///< whose E is computed, in turn; 0: all with a relit probe
  /// Relative change of a colour of a surface element's radiance that counts. Below `epsilon_floor` a change is compared
  /// with epsilon · epsilon_floor instead. Changes below kRounding (runtime/rounding.h) never count.
  float epsilon = 0, epsilon_floor = 0;
  float smoothing = 1;  ///< E goes this share of the way to its new value, (0, 1]
  float fade = 1;       ///< as smoothing, but only for what a cell or probe that was replaced changes
};

struct SimdStats {
  uint64_t frames = 0;
  /// Summed over the frames.
  double radiosity_ms = 0, select_ms = 0, relight_ms = 0, project_ms = 0, receive_ms = 0;
  /// Of the last frame.
  uint32_t radiosity_tiles = 0;  ///< whose B was computed
  uint32_t changed_tiles = 0;    ///< whose B changed
  uint32_t updated_probes = 0, updated_cells = 0;
  uint32_t waiting_probes = 0, waiting_cells = 0;
  bool skipped = false;  ///< nothing had changed, no pass ran
  /// Asset bytes that the passes of the last frame read.
  uint64_t relight_bytes = 0, project_bytes = 0, receive_bytes = 0;
};

struct SimdCounts {
  uint32_t surface_elements = 0;
  uint32_t resident_probes = 0, resident_cells = 0, active_cells = 0;
  uint64_t bytes = 0;  ///< allocated, but for a few bytes per cell and probe of the manifest
};

/// Any thread may call any function: calls wait for each other. Packing, the expensive part of loading, does not.
/// Memory that cannot be had throws std::bad_alloc and leaves everything as it was; update() allocates nothing.
class SimdRuntime {
 public:
  /// Nothing is resident, all inputs and E are 0. Keeps a reference to the index.
  SimdRuntime(const AssetIndex& index, const SimdOptions& options);

  /// REQUIRES: the cell and the rays are AssetSource's, of the same manifest; or what limit() and coarse_rays() left
  /// of them.
  simd::PackedCell pack_cell(const SourceCell& cell) const {
    return simd::pack_cell(cell, surface_.elements(), cell.chunk.order == order_, memory_);
  }
  simd::PackedProbe pack_probe(std::span<const uint32_t> rays) const {
    return simd::pack_probe(rays, surface_.elements(), memory_);
  }

  /// Takes over inputs and E of another asset's surface elements. Before the first frame.
  void inherit(const SimdRuntime& before, std::span<const AssetIndex::Kept> kept);

  /// Indices into the manifest. What is resident already is replaced, or `over_base`, kept beneath. A cell takes part once all its probes are
  /// resident; until then, and after it is unloaded, its E stays what it was. DataLoss: two resident receivers are the
  /// same surface element.
  absl::Status load_cell(uint32_t cell, simd::PackedCell packed, bool over_base = false);
  void unload_cell(uint32_t cell);
  void load_probe(uint32_t probe, simd::PackedProbe packed, bool over_base = false);
  /// Back to what something was loaded over.
  void drop_cell_detail(uint32_t cell);
  void drop_probe_detail(uint32_t probe);
  void unload_probe(uint32_t probe);

  /// Elements first … take the values, packed linear RGB; units as in lightloom.h. What is equal to what was set
  /// before is no change. REQUIRES: in range, finite, albedo not negative.
  void set_direct(uint32_t first, std::span<const float> rgb) { set(simd::Surface::kDirect, first, rgb); }
  void set_albedo(uint32_t first, std::span<const float> rgb) { set(simd::Surface::kAlbedo, first, rgb); }
  void set_emission(uint32_t first, std::span<const float> rgb) { set(simd::Surface::kEmission, first, rgb); }
  void set_environment(Vec3 radiance);

  /// One frame: a bounce more. The same numbers whatever the number of threads.
  SimdStats update(const SimdFrameOptions& options = {});
  /// E = 0: the next frame starts from the first bounce.
  void reset_feedback();
  /// E, S × 3 floats.
  void read_irradiance(std::span<float> rgb) const;

  SimdStats stats() const;
  SimdCounts counts() const;
  /// Of what is resident; 0: it is not.
  uint64_t cell_bytes(uint32_t cell) const;
  uint64_t probe_bytes(uint32_t probe) const;
  const char* kernels() const { return kernels_->name; }

 private:
  void set(simd::Surface::Input input, uint32_t first, std::span<const float> rgb);

  std::pmr::memory_resource* memory_;
  const simd::Kernels* kernels_;
  double (*milliseconds_)();
  bool smoothing_;
  uint32_t order_;
  mutable std::mutex mutex_;  ///< guards everything below
  simd::WorkerPool pool_;
  simd::Surface surface_;
  simd::Probes probes_;
  simd::Cells cells_;
  SimdStats stats_;
};

/// Makes every probe and cell of the asset resident.
inline absl::Status load_all(const AssetSource& source, SimdRuntime* runtime) {
  const Manifest& m = source.manifest();
  for (uint32_t p = 0; p < m.probes.size(); ++p) {
    LL_ASSIGN_OR_RETURN(const std::vector<uint32_t> rays, source.relight(p));
    runtime->load_probe(p, runtime->pack_probe(rays));
  }
  for (uint32_t c = 0; c < m.cells.size(); ++c) {
    LL_ASSIGN_OR_RETURN(const SourceCell cell, source.cell(c));
    LL_RETURN_IF_ERROR(runtime->load_cell(c, runtime->pack_cell(cell)));
  }
  return absl::OkStatus();
}

}  // namespace lightloom
