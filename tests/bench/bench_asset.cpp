#include "tests/bench/bench_asset.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>

#include "core/asset/asset.h"
#include "core/base/file.h"
#include "tests/bench/or_exit.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom::bench {
namespace {

absl::Status copy_chunk(std::span<const uint8_t> bytes, std::span<uint8_t> out) {
  if (bytes.size() != out.size()) return absl::DataLossError("a chunk has another size than the manifest says");
  std::copy(bytes.begin(), bytes.end(), out.begin());
  return absl::OkStatus();
}

}  // namespace

AssetSource BenchAsset::open() const { return or_exit(AssetSource::open(manifest, read)); }

int BenchAsset::read_chunk(void* user, const uint8_t digest[32], uint64_t size, void* out) {
  ChunkRef ref;
  std::memcpy(ref.digest.bytes.data(), digest, ref.digest.bytes.size());
  ref.size = size;
  return static_cast<const BenchAsset*>(user)->read(ref, {static_cast<uint8_t*>(out), size}).ok() ? 0 : 1;
}

BenchAsset bench_asset() {
  if (const char* const loom = std::getenv("LIGHTLOOM_BENCH_ASSET")) {
    const ChunkStore store = chunk_store(loom);
    return {or_exit(read_file(std::filesystem::path(loom) / "manifest")),
            [store](const ChunkRef& ref, std::span<uint8_t> out) -> absl::Status {
              const auto bytes = store.get(ref);
              return bytes.ok() ? copy_chunk(*bytes, out) : bytes.status();
            }};
  }
  testing::RandomAssetOptions options;
  options.order = 7;
  options.relight_rays = 2048;
  options.objects = 40;
  options.side = 64;
  options.probes = 200;
  options.cells = 200;
  options.max_clusters = 8;
  options.max_cluster_probes = 20;
  const auto asset = std::make_shared<const testing::SyntheticAsset>(testing::random_asset(options));
  return {encode_manifest(asset->manifest), [asset](const ChunkRef& ref, std::span<uint8_t> out) {
            return copy_chunk(asset->chunks.at(ref.digest), out);
          }};
}

Spread spread(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return {values[values.size() / 2], values.front(), values.back()};
}

void print_pass_header() {
  std::printf(
      "| path | pass | MB | CPU ms (least … most) | GB per CPU-s | bare | ratio | bare, 3 columns | ratio |\n"
      "|---|---|---|---|---|---|---|---|---|\n");
}

void print_pass(const PassSamples& samples) {
  const Spread ms = spread(samples.cpu_ms);
  const auto rate = [&](double cpu_ms) { return 1e-6 * static_cast<double>(samples.bytes) / cpu_ms; };
  std::printf("| %s | %s | %.2f | %.2f (%.2f … %.2f) | %.2f |", samples.path, samples.pass,
              1e-6 * static_cast<double>(samples.bytes), ms.median, ms.least, ms.most, rate(ms.median));
  for (const std::vector<double>& bare : {samples.bare_gb_per_s, samples.bare_rgb_gb_per_s}) {
    if (bare.empty()) {
      std::printf(" | |");
      continue;
    }
    std::vector<double> ratios;
    for (size_t i = 0; i < bare.size(); ++i) ratios.push_back(rate(samples.cpu_ms[i]) / bare[i]);
    std::printf(" %.2f | %.2f |", spread(bare).median, spread(ratios).median);
  }
  std::printf("\n");
}

void print_frame_header() {
  std::printf(
      "| path | surface elements that changed | set ms | frame ms | tiles | probes | cells |\n"
      "|---|---|---|---|---|---|---|\n");
}

void print_frame(const FrameRow& row) {
  std::printf("| %s | %g %% | %.2f | %.2f | %u | %u | %u |\n", row.path, 100 * row.share, row.set_ms, row.frame_ms,
              row.tiles, row.probes, row.cells);
}

}  // namespace lightloom::bench
