#include "runtime/asset_layout.h"

#include <algorithm>
#include <cstring>

#include "core/base/check.h"
#include "core/base/sh.h"

namespace lightloom {
namespace {

static_assert(gpu::kDead == RelightChunk::kDead && gpu::kSky == RelightChunk::kSky);

/// Bytes of one element of each section.
constexpr std::array<uint64_t, kPageSections> kElementBytes = {
    sizeof(gpu::Cluster), sizeof(gpu::Job), sizeof(uint32_t), sizeof(float),
    sizeof(gpu::Octet),   sizeof(uint32_t), sizeof(uint16_t), sizeof(Half)};

uint32_t octets_of(uint32_t receivers) { return (receivers + gpu::kOctet - 1) / gpu::kOctet; }
/// At least one job, which computes c_0.
uint32_t jobs_of(uint32_t rank) { return std::max(1u, (rank + gpu::kJobColumns - 1) / gpu::kJobColumns); }
/// A bound descriptor must not be empty.
uint64_t section_bytes(size_t section, uint64_t elements) {
  return std::max<uint64_t>(16, elements * kElementBytes[section]);
}
uint64_t aligned(uint64_t bytes) { return (bytes + kSectionAlignment - 1) / kSectionAlignment * kSectionAlignment; }

template <class T>
void append(std::vector<T>* to, const std::vector<T>& from) {
  to->insert(to->end(), from.begin(), from.end());
}

}  // namespace

PageBuilder::Sizes PageBuilder::sizes_of(const SourceCell& cell) {
  Sizes n{};
  const auto at = [&n](PageSection s) -> uint64_t& { return n[static_cast<size_t>(s)]; };
  for (const CellChunk::Cluster& c : cell.chunk.clusters) {
    at(PageSection::kClusters) += 1;
    at(PageSection::kJobs) += jobs_of(c.rank());
    at(PageSection::kProbes) += c.probes.size();
    at(PageSection::kCorrections) += c.rank();
    at(PageSection::kOctets) += octets_of(c.receivers);
    at(PageSection::kElements) += uint64_t{gpu::kOctet} * octets_of(c.receivers);
    at(PageSection::kUniforms) += uint64_t{gpu::kOctet} * octets_of(c.receivers);
    at(PageSection::kMatrix) += c.projection.size() + c.reconstruction.size();
  }
  return n;
}

PageBuilder::Sizes PageBuilder::sizes() const {
  return {clusters_.size(), jobs_.size(),     probes_.size(),   corrections_.size(),
          octets_.size(),   elements_.size(), uniforms_.size(), matrix_.size()};
}

uint64_t PageBuilder::total_bytes(const Sizes& sizes) {
  uint64_t bytes = 0;
  for (size_t s = 0; s < kPageSections; ++s) bytes = aligned(bytes) + section_bytes(s, sizes[s]);
  return bytes;
}

uint64_t PageBuilder::bytes_alone(const SourceCell& cell) { return total_bytes(sizes_of(cell)); }

bool PageBuilder::fits(const SourceCell& cell) const {
  Sizes n = sizes();
  const Sizes more = sizes_of(cell);
  for (size_t s = 0; s < kPageSections; ++s) n[s] += more[s];
  return total_bytes(n) <= max_bytes_;
}

void PageBuilder::add(const SourceCell& cell) {
  for (const CellChunk::Cluster& c : cell.chunk.clusters) {
    const uint32_t index = static_cast<uint32_t>(clusters_.size());
    gpu::Cluster record;
    record.projection = static_cast<uint32_t>(matrix_.size() / 8);
    record.reconstruction = record.projection + static_cast<uint32_t>(c.projection.size() / 8);
    record.first_probe = static_cast<uint32_t>(probes_.size());
    record.probes = static_cast<uint32_t>(c.probes.size());
    record.first_correction = static_cast<uint32_t>(corrections_.size());
    record.rank = c.rank();
    record.first_coefficient = coefficients_;
    record.octets = octets_of(c.receivers);
    clusters_.push_back(record);
    coefficients_ += c.rank() + 1;

    for (uint32_t j = 0; j < jobs_of(c.rank()); ++j) jobs_.push_back({index, j * gpu::kJobColumns});
    for (const uint32_t p : c.probes) probes_.push_back(cell.probes[p]);
    append(&corrections_, c.correction);
    for (uint32_t o = 0; o < record.octets; ++o) octets_.push_back({index, o});
    const auto first = static_cast<int64_t>(c.first_receiver), last = first + static_cast<int64_t>(c.receivers);
    elements_.insert(elements_.end(), cell.elements.begin() + first, cell.elements.begin() + last);
    elements_.resize(octets_.size() * gpu::kOctet, gpu::kNoElement);
    uniforms_.insert(uniforms_.end(), cell.chunk.uniform.begin() + first, cell.chunk.uniform.begin() + last);
    uniforms_.resize(octets_.size() * gpu::kOctet);
    append(&matrix_, c.projection);
    append(&matrix_, c.reconstruction);
    projection_bytes_ += c.projection.size() * sizeof(Half);
    reconstruction_bytes_ += c.reconstruction.size() * sizeof(Half);
  }
}

std::vector<uint8_t> PageBuilder::take(PageLayout* layout) {
  *layout = {};
  const Sizes n = sizes();
  layout->bytes = total_bytes(n);
  layout->jobs = static_cast<uint32_t>(jobs_.size());
  layout->octets = static_cast<uint32_t>(octets_.size());
  layout->coefficients = coefficients_;
  layout->projection_bytes = projection_bytes_;
  layout->reconstruction_bytes = reconstruction_bytes_;

  const std::array<const void*, kPageSections> data = {clusters_.data(),    jobs_.data(),   probes_.data(),
                                                       corrections_.data(), octets_.data(), elements_.data(),
                                                       uniforms_.data(),    matrix_.data()};
  std::vector<uint8_t> bytes(layout->bytes);
  uint64_t at = 0;
  for (size_t s = 0; s < kPageSections; ++s) {
    at = aligned(at);
    layout->sections[s] = {at, section_bytes(s, n[s])};
    if (n[s] > 0) std::memcpy(bytes.data() + at, data[s], n[s] * kElementBytes[s]);
    at += layout->sections[s].size;
  }
  LL_CHECK(at == layout->bytes);
  *this = PageBuilder(max_bytes_);
  return bytes;
}

std::vector<float> sh_table(uint32_t order, uint32_t rays) {
  const size_t stride = static_cast<size_t>(sh_stride(static_cast<int>(order)));
  const size_t padded = (size_t{rays} + gpu::kRayTile - 1) / gpu::kRayTile * gpu::kRayTile;
  std::vector<float> table(padded * stride), y(stride);
  for (uint32_t r = 0; r < rays; ++r) {
    sh_evaluate(static_cast<int>(order), sphere_direction(r, rays), y);
    for (size_t j = 0; j < stride; ++j) table[(r / 4 * stride + j) * 4 + r % 4] = y[j];
  }
  return table;
}

}  // namespace lightloom
