// Silvennoinen & Lehtinen, "Real-time Global Illumination by Precomputed Local Reconstruction from Sparse Radiance
// Probes", SIGGRAPH Asia 2017, Sec. 4.1: relighting.
#include "runtime/simd/probes.h"

#include <algorithm>
#include <cstring>
#include <iterator>

#include "core/base/check.h"
#include "core/base/sh.h"
#include "runtime/detail.h"

namespace lightloom::simd {
namespace {

/// Probes that one task of select() looks at.
constexpr uint32_t kSelectProbes = 256;

uint32_t lambda_stride_of(int order) {
  return (static_cast<uint32_t>(sh_count(order)) + kLambdaAlign - 1) / kLambdaAlign * kLambdaAlign;
}

/// RelightJob::sh of the chosen of `rays` directions.
Array<float> sh_table(std::pmr::memory_resource* memory, int order, uint32_t rays, std::span<const uint32_t> chosen) {
  const uint32_t J = static_cast<uint32_t>(sh_count(order));
  Array<float> table(memory, lambda_stride_of(order) * chosen.size());
  float y[kMaxShCount];
  for (size_t r = 0; r < chosen.size(); ++r) {
    sh_evaluate(order, sphere_direction(chosen[r], rays), y);
    for (uint32_t j = 0; j < J; ++j) {
      table[(size_t{j} / kLambdaAlign * chosen.size() + r) * kLambdaAlign + j % kLambdaAlign] = y[j];
    }
  }
  return table;
}

}  // namespace

Probes::Probes(std::pmr::memory_resource* memory, const AssetIndex& index)
    : lambda_stride_(lambda_stride_of(static_cast<int>(index.order()))),
      packed_(index.probes().size(), memory),
      base_(index.probes().size(), memory),
      lambda_(memory, index.probes().size() * 3 * lambda_stride_),
      grouped_(memory, index.probes().size()),
      flags_(memory, index.probes().size()),
      turns_(memory, static_cast<uint32_t>(index.probes().size())) {
  const uint32_t rays = index.rays();
  LL_CHECK(rays > 0 && index.surface_elements() <= 1u << 31);
  const auto make = [&](const std::vector<uint32_t>& chosen) {
    const std::span<const uint32_t> used = index.probes().empty() ? std::span<const uint32_t>() : chosen;
    return Rays{static_cast<uint32_t>(chosen.size()), sh_table(memory, static_cast<int>(index.order()), rays, used)};
  };
  all_ = make(every_ray(rays));
  coarse_ = make(coarse_rays(rays));
  bytes_ = all_.sh.bytes() + coarse_.sh.bytes() + lambda_.bytes();
}

void Probes::load(uint32_t probe, PackedProbe packed, bool over_base) {
  LL_CHECK(packed.elements.size() == all_.count || packed.elements.size() == coarse_.count);
  LL_CHECK(!over_base || (resident(probe) && base_[probe].elements.size() == 0));
  resident_ += !resident(probe);
  if (over_base) {
    base_[probe] = std::move(packed_[probe]);
  } else {
    bytes_ -= packed_[probe].bytes();
  }
  bytes_ += packed.bytes();
  packed_[probe] = std::move(packed);
  turns_.add(probe);
}

bool Probes::drop_detail(uint32_t probe) {
  if (base_[probe].elements.size() == 0) return false;
  bytes_ -= packed_[probe].bytes();
  packed_[probe] = std::move(base_[probe]);
  base_[probe] = {};
  turns_.add(probe);
  return true;
}

void Probes::unload(uint32_t probe) {
  if (!resident(probe)) return;
  bytes_ -= packed_[probe].bytes() + base_[probe].bytes();
  packed_[probe] = {};
  base_[probe] = {};
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
  // Probes of a group have as many rays.
  const auto last = std::partition_copy(chosen.begin(), chosen.end(), grouped_.data(),
                                        std::make_reverse_iterator(grouped_.data() + chosen.size()),
                                        [this](uint32_t p) { return &rays_of(p) == &all_; });
  const uint32_t with_all = static_cast<uint32_t>(last.first - grouped_.data());
  const uint32_t with_few = static_cast<uint32_t>(chosen.size()) - with_all;
  relit_rays_ = uint64_t{with_all} * all_.count + uint64_t{with_few} * coarse_.count;
  const auto groups_of = [](uint32_t probes) { return (probes + kRelightProbes - 1) / kRelightProbes; };
  pool->run(groups_of(with_all) + groups_of(with_few), [&](uint32_t group) {
    const bool few = group >= groups_of(with_all);
    const uint32_t first = few ? with_all + (group - groups_of(with_all)) * kRelightProbes : group * kRelightProbes;
    const uint32_t end = few ? static_cast<uint32_t>(chosen.size()) : with_all;
    relight_group(kernels, radiosity, {grouped_.data() + first, std::min(kRelightProbes, end - first)});
  });
  return chosen;
}

void Probes::relight_group(const Kernels& kernels, const float* radiosity, std::span<const uint32_t> probes) {
  alignas(64) float fresh[kRelightColumns * (kMaxShCount + kLambdaAlign)];
  const Rays& rays = rays_of(probes[0]);
  RelightJob job;
  job.sh = rays.sh.data();
  job.radiosity = radiosity;
  for (uint32_t i = 0; i < kRelightProbes; ++i) {
    job.elements[i] = i < probes.size() ? packed_[probes[i]].elements.data() : nullptr;
  }
  job.rays = rays.count;
  job.lambda_stride = lambda_stride_;
  job.scale = static_cast<float>(4 * 3.14159265358979323846 / rays.count);
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
