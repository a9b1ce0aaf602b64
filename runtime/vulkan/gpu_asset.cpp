#include "runtime/vulkan/gpu_asset.h"

#include <algorithm>
#include <string>

#include "core/base/sh.h"

namespace lightloom {
namespace {

template <class T>
std::span<const uint8_t> bytes_of(const std::vector<T>& v) {
  return {reinterpret_cast<const uint8_t*>(v.data()), v.size() * sizeof(T)};
}

VkDescriptorBufferInfo whole(const Buffer& b) { return {b.handle, 0, VK_WHOLE_SIZE}; }

uint64_t groups_of(uint64_t invocations) { return (invocations + gpu::kGroup - 1) / gpu::kGroup; }

}  // namespace

absl::StatusOr<std::unique_ptr<GpuAsset>> GpuAsset::load(Device* device, Transfer* transfer, const Pipelines* pipelines,
                                                         const AssetSource& source, const GpuLimits& limits) {
  std::unique_ptr<GpuAsset> asset(new GpuAsset(device, transfer, pipelines, limits));
  const Manifest& m = source.manifest();
  asset->counts_.surface_elements = source.surface_elements();
  asset->counts_.probes = static_cast<uint32_t>(m.probes.size());
  asset->counts_.cells = static_cast<uint32_t>(m.cells.size());
  asset->counts_.clusters = static_cast<uint32_t>(m.clusters.size());
  asset->counts_.order = static_cast<uint32_t>(m.params.order);
  asset->rays_ = static_cast<uint32_t>(m.params.relight_rays);
  asset->stride_ = static_cast<uint32_t>(sh_stride(m.params.order));
  LL_RETURN_IF_ERROR(asset->create_surface(source));
  LL_RETURN_IF_ERROR(asset->load_relight(source));
  LL_RETURN_IF_ERROR(asset->load_cells(source));
  LL_RETURN_IF_ERROR(asset->create_sets());
  asset->counts_.pages = static_cast<uint32_t>(asset->pages_.size());
  asset->counts_.gpu_bytes = asset->arena_.bytes();
  return asset;
}

absl::Status GpuAsset::create_surface(const AssetSource& source) {
  const uint64_t S = source.surface_elements();
  for (Buffer& b : arrays_) {
    LL_ASSIGN_OR_RETURN(b, arena_.buffer(S * 3 * sizeof(float)));
    LL_RETURN_IF_ERROR(transfer_->clear(b));
  }
  LL_ASSIGN_OR_RETURN(radiosity_, arena_.buffer(S * 4 * sizeof(float)));
  return absl::OkStatus();
}

absl::Status GpuAsset::load_relight(const AssetSource& source) {
  LL_ASSIGN_OR_RETURN(lambda_, arena_.buffer(uint64_t{counts_.probes} * 3 * stride_ * sizeof(float)));
  if (counts_.probes == 0) return absl::OkStatus();

  const uint64_t probe_bytes = uint64_t{rays_} * sizeof(uint32_t);
  const uint32_t probes_per_page =
      static_cast<uint32_t>(std::clamp<uint64_t>(limits_.page_bytes / probe_bytes, 1, counts_.probes));
  for (uint32_t first = 0; first < counts_.probes; first += probes_per_page) {
    RelightPage page;
    page.first_probe = first;
    page.probes = std::min(probes_per_page, counts_.probes - first);
    std::vector<uint32_t> rays;
    for (uint32_t p = 0; p < page.probes; ++p) {
      LL_ASSIGN_OR_RETURN(const std::vector<uint32_t> more, source.relight(first + p));
      rays.insert(rays.end(), more.begin(), more.end());
    }
    LL_ASSIGN_OR_RETURN(page.rays, arena_.buffer(page.probes * probe_bytes));
    LL_RETURN_IF_ERROR(transfer_->upload(page.rays, bytes_of(rays)));
    counts_.relight_bytes += page.probes * probe_bytes;
    relight_pages_.push_back(page);
  }
  const std::vector<float> table = sh_table(counts_.order, rays_);
  LL_ASSIGN_OR_RETURN(sh_, arena_.buffer(table.size() * sizeof(float)));
  return transfer_->upload(sh_, bytes_of(table));
}

absl::Status GpuAsset::load_cells(const AssetSource& source) {
  PageBuilder builder(limits_.page_bytes);
  std::vector<bool> received(source.surface_elements());
  for (uint32_t i = 0; i < counts_.cells; ++i) {
    LL_ASSIGN_OR_RETURN(const SourceCell cell, source.cell(i));
    LL_RETURN_IF_ERROR(mark_receivers(i, cell, &received));
    counts_.receivers += static_cast<uint32_t>(cell.elements.size());
    if (!builder.fits(cell)) {
      if (!builder.empty()) LL_RETURN_IF_ERROR(finish_page(&builder));
      if (!builder.fits(cell)) {
        return absl::UnimplementedError(
            "cell " + std::to_string(i) + " needs " + std::to_string(PageBuilder::bytes_alone(cell)) +
            " bytes, a page has " + std::to_string(limits_.page_bytes) + "; bake with smaller cells or lower ranks");
      }
    }
    builder.add(cell);
  }
  return builder.empty() ? absl::OkStatus() : finish_page(&builder);
}

absl::Status GpuAsset::finish_page(PageBuilder* builder) {
  Page page;
  const std::vector<uint8_t> bytes = builder->take(&page.layout);
  LL_ASSIGN_OR_RETURN(page.data, arena_.buffer(bytes.size()));
  LL_ASSIGN_OR_RETURN(page.coefficients, arena_.buffer(uint64_t{page.layout.coefficients} * 4 * sizeof(float)));
  LL_RETURN_IF_ERROR(transfer_->upload(page.data, bytes));
  counts_.project_bytes += page.layout.projection_bytes;
  counts_.receive_bytes += page.layout.reconstruction_bytes;
  pages_.push_back(page);
  return absl::OkStatus();
}

absl::Status GpuAsset::create_sets() {
  std::vector<Pass> passes = {Pass::kRadiosity};
  passes.insert(passes.end(), relight_pages_.size(), Pass::kRelight);
  passes.insert(passes.end(), pages_.size(), Pass::kProject);
  passes.insert(passes.end(), pages_.size(), Pass::kReceive);
  LL_ASSIGN_OR_RETURN(sets_, DescriptorSets::create(device_, passes));

  const VkDescriptorBufferInfo radiosity[] = {whole(array(SurfaceArray::kDirect)), whole(array(SurfaceArray::kAlbedo)),
                                              whole(array(SurfaceArray::kEmission)),
                                              whole(array(SurfaceArray::kIrradiance)), whole(radiosity_)};
  LL_ASSIGN_OR_RETURN(radiosity_set_, sets_->set(*pipelines_, Pass::kRadiosity, radiosity));
  for (RelightPage& p : relight_pages_) {
    const VkDescriptorBufferInfo relight[] = {whole(p.rays), whole(radiosity_), whole(sh_), whole(lambda_)};
    LL_ASSIGN_OR_RETURN(p.set, sets_->set(*pipelines_, Pass::kRelight, relight));
  }
  for (Page& p : pages_) {
    const auto section = [&p](PageSection s) {
      return VkDescriptorBufferInfo{p.data.handle, p.layout[s].offset, p.layout[s].size};
    };
    const VkDescriptorBufferInfo project[] = {section(PageSection::kClusters),
                                              section(PageSection::kJobs),
                                              section(PageSection::kProbes),
                                              section(PageSection::kCorrections),
                                              section(PageSection::kMatrix),
                                              whole(lambda_),
                                              whole(p.coefficients)};
    LL_ASSIGN_OR_RETURN(p.project, sets_->set(*pipelines_, Pass::kProject, project));
    const VkDescriptorBufferInfo receive[] = {section(PageSection::kClusters),        section(PageSection::kOctets),
                                              section(PageSection::kElements),        section(PageSection::kUniforms),
                                              section(PageSection::kMatrix),          whole(p.coefficients),
                                              whole(array(SurfaceArray::kIrradiance))};
    LL_ASSIGN_OR_RETURN(p.receive, sets_->set(*pipelines_, Pass::kReceive, receive));
  }
  return absl::OkStatus();
}

void GpuAsset::dispatch_relight(VkCommandBuffer commands) const {
  for (const RelightPage& page : relight_pages_) {
    gpu::RelightPush push;
    push.sky_r = environment_.x;
    push.sky_g = environment_.y;
    push.sky_b = environment_.z;
    push.scale = static_cast<float>(4 * 3.14159265358979323846 / rays_);
    push.rays = rays_;
    push.stride8 = stride_ / 8;
    push.first_probe = page.first_probe;
    push.probes = page.probes;
    const uint32_t groups = (page.probes + gpu::kRelightProbes - 1) / gpu::kRelightProbes;
    pipelines_->dispatch(commands, Pass::kRelight, page.set, push, groups, limits_.max_groups);
  }
}

void GpuAsset::record_frame(VkCommandBuffer commands, VkQueryPool queries, uint32_t first_query) const {
  const auto timestamp = [&](uint32_t n) {
    if (queries == VK_NULL_HANDLE) return;
    vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, queries, first_query + n);
  };
  timestamp(0);
  pipelines_->dispatch(commands, Pass::kRadiosity, radiosity_set_, gpu::RadiosityPush{counts_.surface_elements},
                       groups_of(counts_.surface_elements), limits_.max_groups);
  barrier_between_passes(commands);
  timestamp(1);
  dispatch_relight(commands);
  barrier_between_passes(commands);
  timestamp(2);
  for (const Page& p : pages_) {
    const gpu::ProjectPush push{p.layout.jobs, stride_ / 8};
    pipelines_->dispatch(commands, Pass::kProject, p.project, push, p.layout.jobs, limits_.max_groups);
  }
  barrier_between_passes(commands);
  timestamp(3);
  for (const Page& p : pages_) {
    const gpu::ReceivePush push{p.layout.octets};
    pipelines_->dispatch(commands, Pass::kReceive, p.receive, push, groups_of(p.layout.octets), limits_.max_groups);
  }
  barrier_between_passes(commands);
  timestamp(4);
}

}  // namespace lightloom
