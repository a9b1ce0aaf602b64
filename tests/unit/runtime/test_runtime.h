// A runtime on a device of its own under the validation layers, for tests.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <mutex>
#include <string>
#include <vector>

#include "runtime/include/lightloom.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom::testing {

struct Received {
  std::vector<std::string> errors, validation;
  std::mutex mutex;
  static void add(void* user, lightloom_message_kind kind, const char* text) {
    auto* r = static_cast<Received*>(user);
    const std::lock_guard lock(r->mutex);
    (kind == LIGHTLOOM_MESSAGE_ERROR ? r->errors : r->validation).emplace_back(text);
  }
};

inline std::string joined(const std::vector<std::string>& lines) {
  std::string all;
  for (const std::string& l : lines) all += l + "\n";
  return all;
}

/// Destroys its runtime and then demands that validation said nothing.
class TestRuntime {
 public:
  explicit TestRuntime(uint32_t flags = 0, uint64_t page_bytes = 0, uint32_t max_workgroups = 0,
                       uint32_t workgroup_size = 0, uint64_t staging_bytes = 0) {
    lightloom_create_info info{};
    info.struct_size = sizeof info;
    const bool on_cpu = (flags & LIGHTLOOM_CREATE_CPU) != 0;
    info.flags = (on_cpu ? 0u : uint32_t{LIGHTLOOM_CREATE_VALIDATION}) | flags;
    if (!on_cpu && std::getenv("LIGHTLOOM_GPU_ASSISTED") != nullptr) info.flags |= LIGHTLOOM_CREATE_GPU_ASSISTED;
    info.message = Received::add;
    info.message_user = &received_;
    info.page_bytes = page_bytes;
    info.max_workgroups = max_workgroups;
    info.workgroup_size = workgroup_size;
    info.staging_bytes = staging_bytes;
    const lightloom_result result = lightloom_create(&info, &runtime_);
    EXPECT_EQ(result, LIGHTLOOM_OK) << joined(received_.errors);
  }
  ~TestRuntime() {
    lightloom_destroy(runtime_);
    EXPECT_TRUE(received_.validation.empty()) << joined(received_.validation);
  }
  lightloom_runtime* get() const { return runtime_; }
  const Received& received() const { return received_; }

  lightloom_result load(SyntheticAsset& asset) { return load(asset, encode_manifest(asset.manifest)); }
  lightloom_result load(SyntheticAsset& asset, const std::vector<uint8_t>& manifest) {
    lightloom_asset_info info{};
    info.struct_size = sizeof info;
    info.manifest = manifest.data();
    info.manifest_bytes = manifest.size();
    info.read_chunk = SyntheticAsset::read_chunk;
    info.read_user = &asset;
    return lightloom_load(runtime_, &info);
  }
  lightloom_result load_part(const SyntheticAsset& asset, const Digest& digest, uint32_t max_rank,
                             bool coarse_rays = false, bool base = false, uint32_t bands = 0) {
    const std::vector<uint8_t>& bytes = asset.chunks.at(digest);
    lightloom_detail detail{};
    detail.struct_size = sizeof detail;
    detail.max_rank = max_rank;
    detail.bands = bands == UINT32_MAX ? 0 : bands;
    if (coarse_rays) detail.flags |= LIGHTLOOM_DETAIL_COARSE_RAYS;
    if (base) detail.flags |= LIGHTLOOM_DETAIL_BASE;
    return lightloom_load_chunk_part(runtime_, digest.bytes.data(), bytes.data(), bytes.size(), &detail);
  }
  void light(const SurfaceLight& l) {
    ASSERT_EQ(lightloom_set_direct(runtime_, &l.direct[0].x, 0, l.direct.size()), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_set_albedo(runtime_, &l.albedo[0].x, 0, l.albedo.size()), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_set_emission(runtime_, &l.emission[0].x, 0, l.emission.size()), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_set_environment(runtime_, &l.environment.x), LIGHTLOOM_OK);
  }
  std::vector<Vec3> irradiance() {
    std::vector<Vec3> e(counts().surface_elements, Vec3{-1, -1, -1});
    EXPECT_EQ(lightloom_read_irradiance(runtime_, &e[0].x, e.size()), LIGHTLOOM_OK);
    return e;
  }
  /// Runs frames until nothing is left to do; returns how many it took.
  int settle(int at_most = 400) {
    for (int frame = 0; frame < at_most; ++frame) {
      EXPECT_EQ(lightloom_update(runtime_, 1), LIGHTLOOM_OK);
      if (stats().skipped == 1) return frame;
    }
    ADD_FAILURE() << "still working";
    return at_most;
  }
  lightloom_stats stats() const {
    lightloom_stats s{};
    s.struct_size = sizeof s;
    EXPECT_EQ(lightloom_get_stats(runtime_, &s), LIGHTLOOM_OK);
    return s;
  }
  void options(uint32_t max_probes, uint32_t max_cells, float epsilon = 0, float smoothing = 1, float fade = 1) {
    lightloom_update_options o{};
    o.struct_size = sizeof o;
    o.max_probes = max_probes;
    o.max_cells = max_cells;
    o.epsilon = epsilon;
    o.smoothing = smoothing;
    o.fade = fade;
    ASSERT_EQ(lightloom_set_update_options(runtime_, &o), LIGHTLOOM_OK);
  }
  lightloom_counts counts() const {
    lightloom_counts c{};
    c.struct_size = sizeof c;
    EXPECT_EQ(lightloom_get_counts(runtime_, &c), LIGHTLOOM_OK);
    return c;
  }

 private:
  Received received_;
  lightloom_runtime* runtime_ = nullptr;
};

/// 99.9th percentile of the difference, relative to the mean of `expected`.
inline double p999_error(const std::vector<Vec3>& actual, const std::vector<Vec3>& expected) {
  std::vector<double> error;
  double sum = 0;
  for (size_t s = 0; s < expected.size(); ++s) {
    for (int c = 0; c < 3; ++c) {
      error.push_back(std::abs(static_cast<double>(actual[s][c]) - static_cast<double>(expected[s][c])));
      sum += std::abs(static_cast<double>(expected[s][c]));
    }
  }
  EXPECT_GT(sum, 0);
  std::sort(error.begin(), error.end());
  return error[error.size() * 999 / 1000] / (sum / static_cast<double>(error.size()));
}

}  // namespace lightloom::testing
