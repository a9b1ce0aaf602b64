// Silvennoinen & Lehtinen, "Real-time Global Illumination by Precomputed Local Reconstruction from Sparse Radiance
// Probes", SIGGRAPH Asia 2017, Sec. 4.1: relighting.
#include "runtime/simd/probes.h"

#include <algorithm>
#include <cstring>

#include "core/base/check.h"
#include "core/base/sh.h"

namespace lightloom::simd {
namespace {

/// Probes that one task of select() looks at.
constexpr uint32_t kSelectProbes = 256;

uint32_t lambda_stride_of(int order) {
  return (static_cast<uint32_t>(sh_count(order)) + kLambdaAlign - 1) / kLambdaAlign * kLambdaAlign;
}

/// RelightJob::sh.
Array<float> sh_table(std::pmr::memory_resource* memory, int order, uint32_t rays) {
  const uint32_t J = static_cast<uint32_t>(sh_count(order));
  Array<float> table(memory, size_t{lambda_stride_of(order)} * rays);
  float y[kMaxShCount];
  for (uint32_t r = 0; r < rays; ++r) {
    sh_evaluate(order, sphere_direction(r, rays), y);
    for (uint32_t j = 0; j < J; ++j) {
      table[(size_t{j} / kLambdaAlign * rays + r) * kLambdaAlign + j % kLambdaAlign] = y[j];
    }
  }
  return table;
}

bool intersect(const Array<uint64_t>& a, const Array<uint64_t>& b) {
  for (size_t i = 0; i < a.size(); ++i) {
    if ((a[i] & b[i]) != 0) return true;
  }
  return false;
}

}  // namespace

Probes::Probes(std::pmr::memory_resource* memory, const AssetIndex& index)
    : rays_(index.rays()),
      lambda_stride_(lambda_stride_of(static_cast<int>(index.order()))),
      packed_(index.probes().size(), memory),
      sh_(sh_table(memory, static_cast<int>(index.order()), index.probes().empty() ? 0 : rays_)),
      lambda_(memory, index.probes().size() * 3 * lambda_stride_),
      flags_(memory, index.probes().size()),
      turns_(memory, static_cast<uint32_t>(index.probes().size())) {
  LL_CHECK(rays_ > 0 && index.surface_elements() <= 1u << 31);
  bytes_ = sh_.bytes() + lambda_.bytes();
}

void Probes::load(uint32_t probe, PackedProbe packed) {
  LL_CHECK(!resident(probe) && packed.elements.size() == rays_);
  bytes_ += packed.bytes();
  packed_[probe] = std::move(packed);
  ++resident_;
  turns_.add(probe);
}

void Probes::unload(uint32_t probe) {
  if (!resident(probe)) return;
  bytes_ -= packed_[probe].bytes();
  packed_[probe] = {};
  --resident_;
  turns_.remove(probe);
}

void Probes::reset() {
  lambda_.fill(0);
  for (uint32_t p = 0; p < packed_.size(); ++p) {
    if (resident(p)) turns_.add(p);
  }
}

void Probes::select(const Surface& surface, WorkerPool* pool) {
  if (surface.changed_tile_count() == 0 && !surface.sky_changed()) return;
  const uint32_t count = static_cast<uint32_t>(packed_.size());
  pool->run((count + kSelectProbes - 1) / kSelectProbes, [&](uint32_t task) {
    for (uint32_t p = task * kSelectProbes; p < std::min(count, (task + 1) * kSelectProbes); ++p) {
      flags_[p] = resident(p) && ((packed_[p].sees_sky && surface.sky_changed()) ||
                                  intersect(packed_[p].tiles, surface.changed_tiles()));
    }
  });
  for (uint32_t p = 0; p < count; ++p) {
    if (flags_[p] != 0) turns_.add(p);
  }
}

std::span<const uint32_t> Probes::relight(const Kernels& kernels, WorkerPool* pool, const float* radiosity,
                                          uint32_t most) {
  const std::span<const uint32_t> chosen = turns_.take(most);
  const uint32_t groups = (static_cast<uint32_t>(chosen.size()) + kRelightProbes - 1) / kRelightProbes;
  pool->run(groups, [&](uint32_t group) {
    const size_t first = size_t{group} * kRelightProbes;
    relight_group(kernels, radiosity, chosen.subspan(first, std::min<size_t>(kRelightProbes, chosen.size() - first)));
  });
  return chosen;
}

void Probes::relight_group(const Kernels& kernels, const float* radiosity, std::span<const uint32_t> probes) {
  alignas(64) float fresh[kRelightColumns * (kMaxShCount + kLambdaAlign)];
  RelightJob job;
  job.sh = sh_.data();
  job.radiosity = radiosity;
  for (uint32_t i = 0; i < kRelightProbes; ++i) {
    job.elements[i] = i < probes.size() ? packed_[probes[i]].elements.data() : nullptr;
  }
  job.rays = rays_;
  job.lambda_stride = lambda_stride_;
  job.scale = static_cast<float>(4 * 3.14159265358979323846 / rays_);
  kernels.relight(job, fresh);

  const size_t floats = size_t{3} * lambda_stride_;
  for (size_t i = 0; i < probes.size(); ++i) {
    float* const to = lambda_.data() + probes[i] * floats;
    const bool changed = std::memcmp(to, fresh + i * floats, floats * sizeof(float)) != 0;
    flags_[probes[i]] = changed;
    if (changed) std::memcpy(to, fresh + i * floats, floats * sizeof(float));
  }
}

}  // namespace lightloom::simd
