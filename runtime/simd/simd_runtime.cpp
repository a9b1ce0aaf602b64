#include "runtime/simd/simd_runtime.h"

#include <algorithm>
#include <chrono>

#include "core/base/check.h"
#include "runtime/rounding.h"

namespace lightloom {
namespace {

double steady_milliseconds() {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

SimdRuntime::SimdRuntime(const AssetIndex& index, const SimdOptions& options)
    : memory_(options.memory != nullptr ? options.memory : std::pmr::new_delete_resource()),
      kernels_(options.kernels != nullptr ? options.kernels : &simd::best_kernels()),
      milliseconds_(options.milliseconds != nullptr ? options.milliseconds : steady_milliseconds),
      smoothing_(options.smoothing),
      order_(index.order()),
      pool_(options.threads),
      surface_(memory_, index.surface_elements(), options.smoothing),
      probes_(memory_, index),
      cells_(memory_, index) {}

void SimdRuntime::inherit(const SimdRuntime& before, std::span<const AssetIndex::Kept> kept) {
  const std::scoped_lock lock(mutex_, before.mutex_);
  surface_.inherit(before.surface_, kept);
  cells_.set_lit();
}

absl::Status SimdRuntime::load_cell(uint32_t cell, simd::PackedCell packed, bool over_base) {
  const std::lock_guard lock(mutex_);
  return cells_.load(cell, std::move(packed), over_base);
}

void SimdRuntime::unload_cell(uint32_t cell) {
  const std::lock_guard lock(mutex_);
  cells_.unload(cell);
}

void SimdRuntime::load_probe(uint32_t probe, simd::PackedProbe packed, bool over_base) {
  const std::lock_guard lock(mutex_);
  const bool replaces = probes_.resident(probe);
  probes_.load(probe, std::move(packed), over_base);
  if (replaces) {
    cells_.probe_replaced(probe);
  } else {
    cells_.probe_loaded(probe);
  }
}

void SimdRuntime::unload_probe(uint32_t probe) {
  const std::lock_guard lock(mutex_);
  if (!probes_.resident(probe)) return;
  probes_.unload(probe);
  cells_.probe_unloaded(probe);
}

void SimdRuntime::drop_cell_detail(uint32_t cell) {
  const std::lock_guard lock(mutex_);
  cells_.drop_detail(cell);
}

void SimdRuntime::drop_probe_detail(uint32_t probe) {
  const std::lock_guard lock(mutex_);
  if (probes_.drop_detail(probe)) cells_.probe_replaced(probe);
}

void SimdRuntime::set(simd::Surface::Input input, uint32_t first, std::span<const float> rgb) {
  LL_CHECK(rgb.size() % 3 == 0 && uint64_t{first} + rgb.size() / 3 <= surface_.elements());
  const std::lock_guard lock(mutex_);
  surface_.set(input, first, rgb);
}

void SimdRuntime::set_environment(Vec3 radiance) {
  const std::lock_guard lock(mutex_);
  surface_.set_environment(radiance);
}

SimdStats SimdRuntime::update(const SimdFrameOptions& options) {
  LL_CHECK(options.smoothing > 0 && options.smoothing <= 1 && (smoothing_ || options.smoothing == 1));
  LL_CHECK(options.fade > 0 && options.fade <= 1 && (smoothing_ || options.fade == 1));
  const std::lock_guard lock(mutex_);
  SimdStats& s = stats_;
  ++s.frames;
  s.skipped = !surface_.changed() && probes_.waiting() == 0 && cells_.waiting() == 0;
  s.radiosity_tiles = s.changed_tiles = s.updated_probes = s.updated_cells = 0;
  s.relight_bytes = s.project_bytes = s.receive_bytes = 0;
  if (s.skipped) return s;

  double now = milliseconds_();
  const auto lap = [&](double* sum) {
    const double then = std::exchange(now, milliseconds_());
    *sum += now - then;
  };
  s.radiosity_tiles =
      surface_.radiosity(*kernels_, &pool_, std::max(options.epsilon, kRounding), options.epsilon_floor);
  s.changed_tiles = surface_.changed_tile_count();
  lap(&s.radiosity_ms);

  probes_.select(surface_, &pool_);
  lap(&s.select_ms);

  const std::span<const uint32_t> relit =
      probes_.relight(*kernels_, &pool_, surface_.radiosity_values(), options.max_probes);
  s.updated_probes = static_cast<uint32_t>(relit.size());
  s.relight_bytes = probes_.relit_rays() * sizeof(uint32_t);
  lap(&s.relight_ms);

  for (const uint32_t p : relit) {
    if (probes_.changed(p)) cells_.lambda_changed(p);
  }
  cells_.radiosity_changed(surface_);
  cells_.choose(options.max_cells);
  s.updated_cells = cells_.chosen_count();
  s.project_bytes = cells_.projection_bytes();
  s.receive_bytes = cells_.reconstruction_bytes();
  lap(&s.select_ms);

  cells_.project(*kernels_, &pool_, probes_.lambda(), probes_.lambda_stride());
  lap(&s.project_ms);

  cells_.receive(*kernels_, &pool_, &surface_, options.smoothing < 1, options.fade < 1);
  if (smoothing_) surface_.smooth(&pool_, options.smoothing < 1 ? options.smoothing : options.fade);
  lap(&s.receive_ms);

  s.waiting_probes = probes_.waiting();
  s.waiting_cells = cells_.waiting();
  return s;
}

void SimdRuntime::reset_feedback() {
  const std::lock_guard lock(mutex_);
  surface_.reset();
  probes_.reset();
  cells_.reset();
}

void SimdRuntime::read_irradiance(std::span<float> rgb) const {
  const std::lock_guard lock(mutex_);
  const std::span<const float> e = surface_.irradiance();
  LL_CHECK(rgb.size() == e.size());
  std::copy(e.begin(), e.end(), rgb.begin());
}

SimdStats SimdRuntime::stats() const {
  const std::lock_guard lock(mutex_);
  return stats_;
}

uint64_t SimdRuntime::cell_bytes(uint32_t cell) const {
  const std::lock_guard lock(mutex_);
  return cells_.bytes_of(cell);
}

uint64_t SimdRuntime::probe_bytes(uint32_t probe) const {
  const std::lock_guard lock(mutex_);
  return probes_.bytes_of(probe);
}

SimdCounts SimdRuntime::counts() const {
  const std::lock_guard lock(mutex_);
  SimdCounts c;
  c.surface_elements = surface_.elements();
  c.resident_probes = probes_.resident_count();
  c.resident_cells = cells_.resident_count();
  c.active_cells = cells_.active_count();
  c.bytes = surface_.bytes() + probes_.bytes() + cells_.bytes();
  return c;
}

}  // namespace lightloom
