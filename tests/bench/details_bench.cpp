// What cells of fewer columns and bands, and probes of fewer rays, do to E: the table of docs/results.md, "Streaming".
// LIGHTLOOM_BENCH_LEVEL: a built-in level, else the gallery.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "core/base/sh.h"
#include "core/scene/builtin.h"
#include "runtime/detail.h"
#include "runtime/simd/simd_runtime.h"
#include "tests/support/baked_level.h"

namespace lightloom {
namespace {

using test::value_or_die;

struct Result {
  std::vector<Vec3> e;
  uint64_t bytes = 0;  ///< of matrices and rays
};

TEST(DetailsBench, ErrorAgainstBytes) {
  const char* const name = std::getenv("LIGHTLOOM_BENCH_LEVEL");
  const auto level = test::bake_level(value_or_die(builtin_scene(name == nullptr ? "gallery" : name)), BakeParams{});
  const SurfaceInputs inputs = value_or_die(light_surfaces(*level->tracer, level->elements, 4, {}));
  const ChunkStore store = chunk_store(level->loom());
  const AssetSource source = value_or_die(AssetSource::open(
      encode_manifest(level->manifest), [&](const ChunkRef& ref, std::span<uint8_t> out) -> absl::Status {
        LL_ASSIGN_OR_RETURN(const auto bytes, store.get(ref));
        std::copy(bytes.begin(), bytes.end(), out.begin());
        return absl::OkStatus();
      }));
  const std::vector<uint32_t> coarse = coarse_rays(source.index().rays());
  const auto floats = [](const std::vector<Vec3>& v) { return std::span(&v[0].x, 3 * v.size()); };

  const auto lit = [&](const Detail& detail) {
    Result result;
    SimdRuntime runtime(source.index(), {});
    for (uint32_t p = 0; p < level->manifest.probes.size(); ++p) {
      std::vector<uint32_t> rays = value_or_die(source.relight(p)), few;
      for (const uint32_t r : coarse) few.push_back(rays[r]);
      const std::vector<uint32_t>& used = detail.all_rays ? rays : few;
      result.bytes += 4 * used.size();
      runtime.load_probe(p, runtime.pack_probe(used));
    }
    for (uint32_t c = 0; c < level->manifest.cells.size(); ++c) {
      SourceCell cell = value_or_die(source.cell(c));
      limit(&cell, detail);
      for (const auto& cluster : cell.chunk.clusters)
        result.bytes += 2 * (cluster.projection.size() + cluster.reconstruction.size());
      EXPECT_TRUE(runtime.load_cell(c, runtime.pack_cell(cell)).ok());
    }
    runtime.set_direct(0, floats(inputs.direct));
    runtime.set_albedo(0, floats(inputs.albedo));
    runtime.set_emission(0, floats(inputs.emission));
    runtime.set_environment(level->scene->environment);
    for (int frame = 0; frame < 30; ++frame) runtime.update();
    result.e.resize(inputs.direct.size());
    runtime.read_irradiance({&result.e[0].x, 3 * result.e.size()});
    return result;
  };
  const auto all = lit({});
  const auto row = [&](const Detail& detail) {
    const Result result = lit(detail);
    double difference = 0, squares = 0, sum = 0, all_sum = 0;
    for (size_t s = 0; s < all.e.size(); ++s) {
      const Vec3 d = result.e[s] - all.e[s];
      difference += static_cast<double>(dot(d, d));
      squares += static_cast<double>(dot(all.e[s], all.e[s]));
      sum += static_cast<double>(result.e[s].x + result.e[s].y + result.e[s].z);
      all_sum += static_cast<double>(all.e[s].x + all.e[s].y + all.e[s].z);
    }
    std::printf("| %u | %u | %s | %.2f | %.4f | %.3f |\n", std::min(detail.max_rank, 32u), std::min(detail.bands, 8u),
                detail.all_rays ? "4096" : "256", static_cast<double>(result.bytes) / 1e6,
                std::sqrt(difference / squares), sum / all_sum);
  };
  std::printf("| columns | bands | rays | MB | rel_rmse | energy |\n|---|---|---|---|---|---|\n");
  for (const uint32_t rank : {0u, 1u, 2u, 4u, 8u, 16u, 32u}) row({rank});
  for (const uint32_t bands : {6u, 4u, 3u, 2u}) {
    for (const uint32_t rank : {4u, 16u, 32u}) row({rank, bands});
  }
  row({4, 4, false});
  row({16, 4, false});
  row({32, 8, false});
}

}  // namespace
}  // namespace lightloom
