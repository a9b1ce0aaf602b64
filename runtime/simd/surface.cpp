#include "runtime/simd/surface.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/base/check.h"
#include "core/base/sh.h"
#include "runtime/rounding.h"

namespace lightloom::simd {
namespace {

/// In [−limit, limit], also what a hostile asset has made NaN: std::clamp would keep that, and feedback for ever.
float bounded(float value, float limit) { return std::min(limit, std::max(-limit, value)); }

/// |a − b| > epsilon · max(|b|, floor) in any colour.
bool differs(Vec3 a, const float* b, float epsilon, float floor) {
  bool any = false;
  for (int c = 0; c < 3; ++c) any |= std::abs(a[c] - b[c]) > epsilon * std::max(std::abs(b[c]), floor);
  return any;
}

}  // namespace

Surface::Surface(std::pmr::memory_resource* memory, uint32_t elements, bool smoothing)
    : elements_(elements),
      smoothing_(smoothing),
      greatest_(memory, size_t{3} * tiles_of(elements)),
      dirty_(memory, tiles_of(elements)),
      moving_(memory, tiles_of(elements)),
      changed_tiles_(memory, tile_words(elements)) {
  const size_t floats = size_t{tiles_of(elements)} * kTileFloats;
  for (Array<float>& input : inputs_) input = Array<float>(memory, floats);
  irradiance_ = Array<float>(memory, floats);
  if (smoothing) target_ = Array<float>(memory, floats);
  // The dead element, the sky, and what kernels read behind it.
  radiosity_ = Array<float>(memory, floats + 7);
}

void Surface::mark(Array<uint8_t>* tiles, uint32_t tile, std::atomic<bool>* any) {
  std::atomic_ref((*tiles)[tile]).store(1, std::memory_order_relaxed);
  any->store(true, std::memory_order_relaxed);
}

void Surface::set(Input input, uint32_t first, std::span<const float> rgb) {
  size_t at = size_t{3} * first;
  const size_t end = at + rgb.size();
  while (at < end) {
    const size_t tile = at / kTileFloats;
    const size_t count = std::min(end, (tile + 1) * kTileFloats) - at;
    float values[kTileFloats];
    for (size_t i = 0; i < count; ++i) values[i] = input == kAlbedo ? std::min(rgb[i], kMaxAlbedo) : rgb[i];
    float* const to = inputs_[input].data() + at;
    if (std::memcmp(to, values, count * sizeof(float)) != 0) {
      std::memcpy(to, values, count * sizeof(float));
      mark(&dirty_, static_cast<uint32_t>(tile), &any_dirty_);
    }
    rgb = rgb.subspan(count);
    at += count;
  }
}

void Surface::inherit(const Surface& before, std::span<const AssetIndex::Kept> kept) {
  const auto copy = [&kept](const Array<float>& from, Array<float>* to) {
    for (const AssetIndex::Kept& k : kept) {
      std::copy_n(from.data() + size_t{3} * k.from, size_t{3} * k.count, to->data() + size_t{3} * k.to);
    }
  };
  for (size_t input = 0; input < 3; ++input) copy(before.inputs_[input], &inputs_[input]);
  copy(before.irradiance_, &irradiance_);
  if (smoothing_) std::copy(irradiance_.begin(), irradiance_.end(), target_.begin());
  environment_ = before.environment_;
  dirty_.fill(1);
  any_dirty_ = true;
}

void Surface::reset() {
  irradiance_.fill(0);
  target_.fill(0);
  moving_.fill(0);
  any_moving_ = false;
  radiosity_.fill(0);
  greatest_.fill(0);
  dirty_.fill(1);
  any_dirty_ = true;
}

bool Surface::changed() const {
  const float* const sky = radiosity_.data() + size_t{3} * sky_element(elements_);
  return any_dirty_.load(std::memory_order_relaxed) || any_moving_.load(std::memory_order_relaxed) ||
         environment_ != Vec3{sky[0], sky[1], sky[2]};
}

uint32_t Surface::radiosity(const Kernels& kernels, WorkerPool* pool, float epsilon, float floor) {
  float* const sky = radiosity_.data() + size_t{3} * sky_element(elements_);
  sky_changed_ = differs(environment_, sky, epsilon, floor);
  if (sky_changed_) std::memcpy(sky, &environment_, 3 * sizeof(float));

  changed_tile_count_.store(0, std::memory_order_relaxed);
  if (!any_dirty_.exchange(false, std::memory_order_relaxed)) {
    changed_tiles_.fill(0);
    if (sky_changed_) find_limit();
    return 0;
  }
  std::atomic<uint32_t> looked_at{0};
  // A task owns a word of changed_tiles_.
  pool->run(static_cast<uint32_t>(changed_tiles_.size()), [&](uint32_t word) {
    uint64_t changed = 0;
    uint32_t dirty = 0;
    const size_t last = std::min<size_t>(dirty_.size(), (word + 1) * size_t{64});
    for (size_t tile = word * size_t{64}; tile < last; ++tile) {
      if (dirty_[tile] == 0) continue;
      dirty_[tile] = 0;
      ++dirty;
      const size_t at = tile * kTileFloats;
      const RadiosityJob job = {inputs_[kDirect].data() + at, inputs_[kAlbedo].data() + at,
                                inputs_[kEmission].data() + at, irradiance_.data() + at};
      if (kernels.radiosity(job, epsilon, floor, radiosity_.data() + at, greatest_.data() + 3 * tile))
        changed |= uint64_t{1} << (tile % 64);
    }
    changed_tiles_[word] = changed;
    changed_tile_count_.fetch_add(static_cast<uint32_t>(std::popcount(changed)), std::memory_order_relaxed);
    looked_at.fetch_add(dirty, std::memory_order_relaxed);
  });
  if (sky_changed_ || changed_tile_count() > 0) find_limit();
  return looked_at.load();
}

void Surface::find_limit() {
  const float* const sky = radiosity_.data() + size_t{3} * sky_element(elements_);
  for (size_t c = 0; c < 3; ++c) {
    float greatest = std::abs(sky[c]);
    for (size_t i = c; i < greatest_.size(); i += 3) greatest = std::max(greatest, greatest_[i]);
    limit_[c] = kPi * greatest;
  }
}

void Surface::receive(const uint32_t* elements, uint32_t count, const float* block, bool stays) {
  LL_CHECK(smoothing_ || !stays);
  bool any_shown = false, any_left = false;
  for (uint32_t i = 0; i < count; ++i) {
    bool shown = false, left = false;
    for (uint32_t c = 0; c < 3; ++c) {
      float& e = irradiance_[size_t{3} * elements[i] + c];
      const float value = bounded(block[c * kReceiveBlock + i], limit_[c]);
      float next = value;
      if (smoothing_) {
        const float old = std::exchange(target_[size_t{3} * elements[i] + c], value);
        if (stays) next = e;
        if (!stays && e != old) next = bounded(e + (value - old), limit_[c]);
      }
      shown |= e != next;
      left |= next != value;
      e = next;
    }
    const uint32_t tile = elements[i] / kTile;
    if (shown) std::atomic_ref(dirty_[tile]).store(1, std::memory_order_relaxed);
    if (left) std::atomic_ref(moving_[tile]).store(1, std::memory_order_relaxed);
    any_shown |= shown;
    any_left |= left;
  }
  if (any_shown) any_dirty_.store(true, std::memory_order_relaxed);
  if (any_left) any_moving_.store(true, std::memory_order_relaxed);
}

void Surface::smooth(WorkerPool* pool, float share) {
  if (!any_moving_.exchange(false, std::memory_order_relaxed)) return;
  pool->run(static_cast<uint32_t>(changed_tiles_.size()), [&](uint32_t word) {
    const size_t last = std::min<size_t>(moving_.size(), (word + 1) * size_t{64});
    for (size_t tile = word * size_t{64}; tile < last; ++tile) {
      if (moving_[tile] == 0) continue;
      moving_[tile] = 0;
      mark(&dirty_, static_cast<uint32_t>(tile), &any_dirty_);
      if (smooth_tile(static_cast<uint32_t>(tile), share)) mark(&moving_, static_cast<uint32_t>(tile), &any_moving_);
    }
  });
}

/// Returns whether any E is still on its way.
bool Surface::smooth_tile(uint32_t tile, float share) {
  float* const e = irradiance_.data() + size_t{tile} * kTileFloats;
  const float* const target = target_.data() + size_t{tile} * kTileFloats;
  bool moving = false;
  for (uint32_t i = 0; i < kTileFloats; ++i) {
    const float left = target[i] - e[i];
    const bool arrives = share >= 1 || std::abs(left) <= kArrived * std::max(std::abs(target[i]), kArrivedBlack);
    e[i] = arrives ? target[i] : e[i] + share * left;
    moving |= !arrives;
  }
  return moving;
}

uint64_t Surface::bytes() const {
  uint64_t total = irradiance_.bytes() + target_.bytes() + radiosity_.bytes() + greatest_.bytes() + dirty_.bytes() +
                   moving_.bytes() + changed_tiles_.bytes();
  for (const Array<float>& input : inputs_) total += input.bytes();
  return total;
}

}  // namespace lightloom::simd
