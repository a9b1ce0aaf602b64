// Silvennoinen & Lehtinen, "Real-time Global Illumination by Precomputed Local Reconstruction from Sparse Radiance
// Probes", SIGGRAPH Asia 2017: the compressed cluster transport of Eq. 11.
#include "runtime/simd/cells.h"

#include <algorithm>
#include <string>

#include "core/base/check.h"

namespace lightloom::simd {
namespace {

/// Calls body(element) for the receivers of the cell until one returns false; returns how many returned true.
template <class Body>
size_t each_receiver(const PackedCell& cell, size_t most, Body body) {
  size_t n = 0;
  for (const PackedCluster& c : cell.clusters) {
    for (uint32_t r = 0; r < c.receivers; ++r, ++n) {
      if (n == most || !body(cell.elements[c.first + r])) return n;
    }
  }
  return n;
}

/// E += Σ_i w_i·B_i of receivers first … first + count − 1; block[colour·kReceiveBlock + r].
void add_near_fields(const PackedCell& cell, uint32_t first, uint32_t count, const float* radiosity, float* block) {
  for (uint32_t r = 0; r < count; ++r) {
    float e[3] = {0, 0, 0};
    for (uint32_t i = cell.near_first[first + r]; i < cell.near_first[first + r + 1]; ++i) {
      const float* const b = radiosity + size_t{3} * cell.near_elements[i];
      for (uint32_t c = 0; c < 3; ++c) e[c] += cell.near_weights[i] * b[c];
    }
    for (uint32_t c = 0; c < 3; ++c) block[c * kReceiveBlock + r] += e[c];
  }
}

}  // namespace

Cells::Cells(std::pmr::memory_resource* memory, const AssetIndex& index)
    : index_(index),
      packed_(index.cells().size(), memory),
      base_(index.cells().size(), memory),
      missing_probes_(memory, index.cells().size()),
      received_(memory, (size_t{index.surface_elements()} + 63) / 64),
      turns_(memory, static_cast<uint32_t>(index.cells().size())),
      lit_(memory, index.cells().size()),
      fades_(memory, index.cells().size()) {
  for (uint32_t c = 0; c < index.cells().size(); ++c) missing_probes_[c] = index.cells()[c].probes;
}

bool Cells::claim(const PackedCell& cell) {
  size_t all = 0;
  for (const PackedCluster& c : cell.clusters) all += c.receivers;
  const size_t claimed = each_receiver(cell, all, [&](uint32_t element) {
    uint64_t& word = received_[element / 64];
    const uint64_t bit = uint64_t{1} << (element % 64);
    if ((word & bit) != 0) return false;
    word |= bit;
    return true;
  });
  if (claimed == all) return true;
  each_receiver(cell, claimed, [&](uint32_t element) {
    received_[element / 64] &= ~(uint64_t{1} << (element % 64));
    return true;
  });
  return false;
}

void Cells::release(const PackedCell& cell) {
  each_receiver(cell, SIZE_MAX, [&](uint32_t element) {
    received_[element / 64] &= ~(uint64_t{1} << (element % 64));
    return true;
  });
}

absl::Status Cells::load(uint32_t cell, PackedCell packed, bool over_base) {
  const bool replaces = resident(cell);
  LL_CHECK(!over_base || (replaces && !has_base(cell)));
  if (replaces) release(packed_[cell]);
  if (!claim(packed)) {
    if (replaces) LL_CHECK(claim(packed_[cell]));
    return absl::DataLossError("cell " + std::to_string(cell) +
                               " is corrupt: a receiver occurs twice; bake again or fetch it again");
  }
  if (!replaces) {
    ++resident_;
    active_ += missing_probes_[cell] == 0;
  }
  if (over_base) {
    base_[cell] = std::move(packed_[cell]);
  } else {
    bytes_ -= packed_[cell].bytes();
  }
  bytes_ += packed.bytes();
  packed_[cell] = std::move(packed);
  computes_anew(cell);
  return absl::OkStatus();
}

void Cells::drop_detail(uint32_t cell) {
  if (!has_base(cell)) return;
  bytes_ -= packed_[cell].bytes();
  packed_[cell] = std::move(base_[cell]);
  base_[cell] = {};
  computes_anew(cell);
}

void Cells::computes_anew(uint32_t cell) {
  fades_[cell] = lit_[cell];
  if (active(cell)) turns_.add(cell);
}

void Cells::unload(uint32_t cell) {
  if (!resident(cell)) return;
  active_ -= active(cell);
  turns_.remove(cell);
  release(packed_[cell]);
  bytes_ -= packed_[cell].bytes() + base_[cell].bytes();
  packed_[cell] = {};
  base_[cell] = {};
  --resident_;
}

void Cells::probe_loaded(uint32_t probe) {
  for (const uint32_t c : index_.cells_of(probe)) {
    --missing_probes_[c];
    if (!active(c)) continue;
    ++active_;
    turns_.add(c);
  }
}

void Cells::probe_unloaded(uint32_t probe) {
  for (const uint32_t c : index_.cells_of(probe)) {
    active_ -= active(c);
    turns_.remove(c);
    ++missing_probes_[c];
  }
}

void Cells::probe_replaced(uint32_t probe) {
  for (const uint32_t c : index_.cells_of(probe)) computes_anew(c);
}

void Cells::lambda_changed(uint32_t probe) {
  for (const uint32_t c : index_.cells_of(probe)) {
    if (active(c)) turns_.add(c);
  }
}

void Cells::radiosity_changed(const Surface& surface) {
  if (surface.changed_tile_count() == 0) return;
  for (uint32_t c = 0; c < packed_.size(); ++c) {
    if (active(c) && !turns_.contains(c) && intersect(packed_[c].near_tiles, surface.changed_tiles())) turns_.add(c);
  }
}

void Cells::reset() {
  lit_.fill(0);
  fades_.fill(0);
  for (uint32_t c = 0; c < packed_.size(); ++c) {
    if (active(c)) turns_.add(c);
  }
}

void Cells::project(const Kernels& kernels, WorkerPool* pool, const float* lambda, uint32_t lambda_stride) {
  pool->run(chosen_count(), [&](uint32_t i) {
    PackedCell& cell = packed_[chosen_[i]];
    for (const PackedCluster& c : cell.clusters) {
      kernels.project(cell.view(c), lambda, lambda_stride, cell.coefficients.data() + c.coefficients);
    }
  });
}

void Cells::receive(const Kernels& kernels, WorkerPool* pool, Surface* surface, bool stay, bool may_fade) {
  pool->run(chosen_count(), [&](uint32_t i) {
    alignas(64) float block[3 * kReceiveBlock];
    const float* const radiosity = surface->radiosity_values();
    const uint32_t index = chosen_[i];
    const PackedCell& cell = packed_[index];
    const bool stays = stay || (may_fade && fades_[index] != 0);
    for (const PackedCluster& c : cell.clusters) {
      const ClusterView view = cell.view(c);
      for (uint32_t first = 0; first < c.receivers; first += kReceiveBlock) {
        kernels.receive(view, cell.coefficients.data() + c.coefficients, first,
                        std::min(kReceiveBlock, c.padded - first), block);
        const uint32_t count = std::min(kReceiveBlock, c.receivers - first);
        add_near_fields(cell, c.first + first, count, radiosity, block);
        surface->receive(cell.elements.data() + c.first + first, count, block, stays);
      }
    }
    lit_[index] = 1;
    fades_[index] = 0;
  });
}

uint64_t Cells::projection_bytes() const {
  uint64_t sum = 0;
  for (const uint32_t c : chosen_) sum += packed_[c].projection_bytes;
  return sum;
}

uint64_t Cells::reconstruction_bytes() const {
  uint64_t sum = 0;
  for (const uint32_t c : chosen_) sum += packed_[c].reconstruction_bytes;
  return sum;
}

}  // namespace lightloom::simd
