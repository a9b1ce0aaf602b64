// What an asset has on the device before any of its chunks is resident.
#include <algorithm>
#include <utility>

#include "core/base/sh.h"
#include "runtime/vulkan/asset.h"

namespace lightloom {
namespace {

/// Fewer tiles than this, so that a probe's bits of what it sees stay within 4 KiB.
constexpr uint64_t kMaxTiles = 32768;

}  // namespace

VulkanAsset::VulkanAsset(Context* context, const Pipelines* pipelines, std::shared_ptr<const AssetIndex> index,
                         const AssetOptions& options, std::pmr::memory_resource* memory)
    : context_(context),
      pipelines_(pipelines),
      memory_(memory),
      shared_index_(std::move(index)),
      index_(*shared_index_),
      options_(options),
      stride_(static_cast<uint32_t>(sh_stride(static_cast<int>(index_.order())))),
      inputs_{ShadowTable(memory), ShadowTable(memory), ShadowTable(memory)},
      cell_table_(memory),
      slot_table_(memory),
      map_table_(memory),
      near_table_(memory),
      inherited_parts_(memory),
      coarse_rays_(memory),
      surfaces_(index_.objects().size(), false, memory),
      probes_(index_.probes().size(), memory),
      cells_(memory),
      received_(index_.surface_elements(), false, memory),
      uploads_(memory),
      graves_(memory) {
  settings_.options.smoothing = settings_.options.fade = 1;
}

absl::StatusOr<std::unique_ptr<VulkanAsset>> VulkanAsset::create(Context* context, const Pipelines* pipelines,
                                                                 std::shared_ptr<const AssetIndex> index,
                                                                 const AssetOptions& options,
                                                                 std::pmr::memory_resource* memory) {
  std::unique_ptr<VulkanAsset> asset(new VulkanAsset(context, pipelines, std::move(index), options, memory));
  LL_RETURN_IF_ERROR(asset->create_arrays());
  LL_RETURN_IF_ERROR(asset->create_sets());
  return asset;
}

void VulkanAsset::free_all_but_light() {
  sets_ = nullptr;
  cell_pools_ = nullptr;
  relight_pools_ = nullptr;
  for (Buffer* b :
       {&radiosity_, &points_, &normals_, &lambda_, &sh_[0], &sh_[1], &changed_, &dirty_, &slot_seen_, &stamps_,
        &active_slots_, &cell_probes_, &cell_dirty_, &cell_seen_, &active_cells_, &control_, &inherited_}) {
    *b = Buffer();
  }
  for (ShadowTable* t :
       {&inputs_[0], &inputs_[1], &inputs_[2], &cell_table_, &slot_table_, &map_table_, &near_table_}) {
    t->free_device();
  }
  image_ = DeviceImage();
}

void VulkanAsset::inherit(VulkanAsset* before, std::span<const AssetIndex::Kept> kept) {
  for (size_t input = 0; input < inputs_.size(); ++input) {
    for (const AssetIndex::Kept& k : kept) {
      std::copy_n(before->inputs_[input].as<float>() + size_t{3} * k.from, size_t{3} * k.count,
                  inputs_[input].as<float>() + size_t{3} * k.to);
      inputs_[input].touch(12ull * k.to, 12ull * (k.to + k.count));
    }
  }
  settings_.environment = before->settings_.environment;
  if (!before->cleared_) return;  // its E is 0
  for (const AssetIndex::Kept& k : kept) {
    if (k.count > 0) inherited_parts_.push_back({12ull * k.from, 12ull * k.to, 12ull * k.count});
  }
  inherited_ = std::move(before->irradiance_);
}

absl::Status VulkanAsset::create_arrays() {
  const uint64_t S = index_.surface_elements(), P = probes_.size(), C = index_.cells().size();
  while ((S >> tile_shift_) + 2 > kMaxTiles) ++tile_shift_;
  sky_tile_ = static_cast<uint32_t>((S + (uint64_t{1} << tile_shift_) - 1) >> tile_shift_);
  tile_words_ = sky_tile_ / 32 + 1;

  const uint32_t rays = P == 0 ? 0 : index_.rays();
  const std::vector<uint32_t> coarse = lightloom::coarse_rays(rays);
  coarse_rays_.assign(coarse.begin(), coarse.end());
  std::vector<RelightRays> kinds = {{index_.rays(), &sh_[0]}};
  if (coarse.size() < rays) kinds.push_back({static_cast<uint32_t>(coarse.size()), &sh_[1]});
  relight_pools_ = std::make_unique<RelightPools>(context_, kinds, tile_words_, static_cast<uint32_t>(P), memory_);
  LL_RETURN_IF_ERROR(relight_pools_->check());
  const uint64_t slots = relight_pools_->slots();

  for (ShadowTable& input : inputs_) LL_RETURN_IF_ERROR(input.create(context_, 12 * S, 4));
  LL_RETURN_IF_ERROR(cell_table_.create(context_, C * sizeof(gpu::Cell), sizeof(gpu::Cell)));
  LL_RETURN_IF_ERROR(near_table_.create(context_, C * 4 * tile_words_, 4 * tile_words_));
  LL_RETURN_IF_ERROR(slot_table_.create(context_, slots * sizeof(gpu::Slot), sizeof(gpu::Slot), 0xff));
  const auto buffer = [this](Buffer* to, uint64_t bytes, BufferUse use = BufferUse::kDevice) -> absl::Status {
    LL_ASSIGN_OR_RETURN(*to, Buffer::create(context_, bytes, use));
    return absl::OkStatus();
  };
  LL_RETURN_IF_ERROR(buffer(&irradiance_, (options_.smoothing ? 24 : 12) * S));
  LL_RETURN_IF_ERROR(buffer(&radiosity_, 16 * S));
  LL_RETURN_IF_ERROR(buffer(&points_, 16 * S));
  LL_RETURN_IF_ERROR(buffer(&normals_, 4 * S));
  LL_RETURN_IF_ERROR(buffer(&lambda_, P * 3 * stride_ * sizeof(float)));
  LL_RETURN_IF_ERROR(buffer(&changed_, 4 * tile_words_));
  LL_RETURN_IF_ERROR(buffer(&dirty_, 4 * slots));
  LL_RETURN_IF_ERROR(buffer(&slot_seen_, 4 * slots));
  LL_RETURN_IF_ERROR(buffer(&stamps_, 4 * P));
  LL_RETURN_IF_ERROR(buffer(&cell_probes_, 4 * index_.cell_probes().size()));
  LL_RETURN_IF_ERROR(buffer(&cell_dirty_, 4 * C));
  LL_RETURN_IF_ERROR(buffer(&cell_seen_, 4 * C));
  LL_RETURN_IF_ERROR(buffer(&active_cells_, C * sizeof(gpu::ActiveCell)));
  LL_RETURN_IF_ERROR(buffer(&control_, sizeof(gpu::Control), BufferUse::kIndirect));

  cells_.resize(C);
  if (C > 0) cell_table_.touch(0, cell_table_.bytes());

  const auto fill = [this](const Buffer& to, std::pmr::vector<uint8_t> bytes) {
    Upload upload{{AssetIndex::Kind::kSurface, UINT32_MAX}, to.handle(), 0, std::move(bytes), 0, 0, false, false};
    uploads_.push(std::move(upload));
  };
  for (uint32_t kind = 0; kind < kinds.size(); ++kind) {
    const std::vector<uint32_t> chosen = kind == 0 ? every_ray(rays) : coarse;
    std::pmr::vector<uint8_t> table = sh_table(index_.order(), index_.rays(), chosen, memory_);
    LL_RETURN_IF_ERROR(buffer(&sh_[kind], table.size()));
    fill(sh_[kind], std::move(table));
  }
  const auto* lists = reinterpret_cast<const uint8_t*>(index_.cell_probes().data());
  fill(cell_probes_, std::pmr::vector<uint8_t>(lists, lists + 4 * index_.cell_probes().size(), memory_));

  if (options_.image_format != VK_FORMAT_UNDEFINED && index_.width() > 0 && index_.height() > 0) {
    const uint64_t texels = uint64_t{kImageLayers} * index_.width() * index_.height();
    LL_RETURN_IF_ERROR(map_table_.create(context_, 4 * texels, 4, 0xff));
    map_ = std::make_unique<LightmapMap>(index_.width(), index_.height(), std::span(map_table_.as<uint32_t>(), texels),
                                         memory_);
    LL_ASSIGN_OR_RETURN(
        image_, DeviceImage::create(context_, options_.image_format, index_.width(), index_.height(), kImageLayers));
  }
  return absl::OkStatus();
}

absl::Status VulkanAsset::create_sets() {
  const Pass image_pass = options_.image_format == VK_FORMAT_R32G32B32A32_SFLOAT ? Pass::kImage32 : Pass::kImage16;
  const uint32_t F = context_->frames, pools = gpu::kMaxPools;
  const DescriptorSets::Demand demands[] = {
      {Pass::kDirect, F},    {Pass::kDirectShadowed, F}, {Pass::kRadiosity, F},   {Pass::kSelectProbes, 1},
      {Pass::kMarkCells, 1}, {Pass::kSelectCells, 1},    {Pass::kSettle, 1},      {image_pass, 1},
      {Pass::kMark, pools},  {Pass::kRelight, pools},    {Pass::kProject, pools}, {Pass::kReceive, 2 * pools}};
  LL_ASSIGN_OR_RETURN(sets_, DescriptorSets::create(context_, pipelines_, demands));

  const PoolBindings bindings{&lambda_,  &active_cells_, &control_,   &irradiance_,  &slot_table_.device(),
                              &changed_, &dirty_,        &radiosity_, &active_slots_};
  relight_pools_->bind(sets_.get(), bindings);
  uint64_t cell_bytes = 0;
  for (const AssetIndex::Cell& c : index_.cells()) cell_bytes += c.chunk.size + c.chunk.size / 8 + 1024;
  cell_pools_ = std::make_unique<CellPools>(context_, sets_.get(), bindings, cell_bytes, memory_);
  LL_ASSIGN_OR_RETURN(active_slots_, Buffer::create(context_, 4ull * relight_pools_->slots(), BufferUse::kDevice));

  for (uint32_t f = 0; f < F; ++f) {
    LL_ASSIGN_OR_RETURN(const VkDescriptorSet radiosity, sets_->allocate(Pass::kRadiosity));
    LL_ASSIGN_OR_RETURN(const VkDescriptorSet direct, sets_->allocate(Pass::kDirect));
    LL_ASSIGN_OR_RETURN(const VkDescriptorSet shadowed, sets_->allocate(Pass::kDirectShadowed));
    radiosity_sets_.push_back(radiosity);
    direct_sets_.push_back(direct);
    shadowed_sets_.push_back(shadowed);
  }
  bound_direct_.resize(F);
  const VkDescriptorBufferInfo select_probes[] = {dirty_.whole(),   slot_table_.device().whole(),
                                                  stamps_.whole(),  active_slots_.whole(),
                                                  control_.whole(), slot_seen_.whole()};
  LL_ASSIGN_OR_RETURN(select_probes_, sets_->make(Pass::kSelectProbes, select_probes));
  const VkDescriptorBufferInfo cells = cell_table_.device().whole();
  const VkDescriptorBufferInfo mark_cells[] = {
      cells,           cell_probes_.whole(), stamps_.whole(), cell_dirty_.whole(), near_table_.device().whole(),
      changed_.whole()};
  LL_ASSIGN_OR_RETURN(mark_cells_, sets_->make(Pass::kMarkCells, mark_cells));
  const VkDescriptorBufferInfo select_cells[] = {cells,
                                                 cell_probes_.whole(),
                                                 stamps_.whole(),
                                                 cell_dirty_.whole(),
                                                 active_cells_.whole(),
                                                 control_.whole(),
                                                 cell_seen_.whole()};
  LL_ASSIGN_OR_RETURN(select_cells_, sets_->make(Pass::kSelectCells, select_cells));
  if (options_.smoothing) {
    const VkDescriptorBufferInfo settle[] = {irradiance_.whole()};
    LL_ASSIGN_OR_RETURN(settle_, sets_->make(Pass::kSettle, settle));
  }
  if (map_ != nullptr) {
    const VkDescriptorBufferInfo image[] = {map_table_.device().whole(), irradiance_.whole()};
    const VkDescriptorImageInfo view{VK_NULL_HANDLE, image_.view(), VK_IMAGE_LAYOUT_GENERAL};
    LL_ASSIGN_OR_RETURN(image_set_, sets_->make(image_pass, image, &view));
  }
  return absl::OkStatus();
}

}  // namespace lightloom
