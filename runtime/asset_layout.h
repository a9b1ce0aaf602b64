// A .loom asset as the GPU reads it: bake cells packed into pages, each one buffer of typed sections
// (shaders/layout.h).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/asset_source.h"
#include "runtime/shaders/layout.h"

namespace lightloom {

/// Sections of a page's buffer, in this order.
enum class PageSection { kClusters, kJobs, kProbes, kCorrections, kOctets, kElements, kUniforms, kMatrix };
inline constexpr size_t kPageSections = 8;
/// Start of each section: a multiple of every minStorageBufferOffsetAlignment that Vulkan allows.
inline constexpr uint64_t kSectionAlignment = 256;

struct PageLayout {
  struct Section {
    uint64_t offset = 0, size = 0;  ///< bytes; size ≥ 16
  };
  std::array<Section, kPageSections> sections;
  uint64_t bytes = 0;
  uint32_t jobs = 0, octets = 0;
  uint32_t coefficients = 0;  ///< vec4 that the project pass writes
  uint64_t projection_bytes = 0, reconstruction_bytes = 0;

  const Section& operator[](PageSection s) const { return sections[static_cast<size_t>(s)]; }
};

/// Collects cells until a page is full. A cell is never split.
class PageBuilder {
 public:
  explicit PageBuilder(uint64_t max_bytes) : max_bytes_(max_bytes) {}

  /// Bytes that a page with only this cell would have.
  static uint64_t bytes_alone(const SourceCell& cell);
  bool empty() const { return clusters_.empty(); }
  /// Whether the cell can be added without the page exceeding max_bytes.
  bool fits(const SourceCell& cell) const;
  void add(const SourceCell& cell);
  /// The page's bytes, ready for upload; the builder is empty again.
  std::vector<uint8_t> take(PageLayout* layout);

 private:
  /// Elements of each section.
  using Sizes = std::array<uint64_t, kPageSections>;
  static Sizes sizes_of(const SourceCell& cell);
  Sizes sizes() const;
  static uint64_t total_bytes(const Sizes& sizes);

  uint64_t max_bytes_;
  std::vector<gpu::Cluster> clusters_;
  std::vector<gpu::Job> jobs_;
  std::vector<uint32_t> probes_;
  std::vector<float> corrections_;
  std::vector<gpu::Octet> octets_;
  std::vector<uint32_t> elements_;
  std::vector<uint16_t> uniforms_;
  std::vector<Half> matrix_;
  uint32_t coefficients_ = 0;
  uint64_t projection_bytes_ = 0, reconstruction_bytes_ = 0;
};

/// Y_j(ω_r) for the relight pass: [r/4][j][r%4], j < sh_stride(order), r up to a multiple of gpu::kRayTile;
/// padding 0.
std::vector<float> sh_table(uint32_t order, uint32_t rays);

}  // namespace lightloom
