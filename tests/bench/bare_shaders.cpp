#include "tests/bench/bare_shaders.h"

#include <time.h>

#include <algorithm>
#include <span>

#include "core/base/check.h"
#include "core/base/half.h"
#include "runtime/shaders/layout.h"
#include "runtime/vulkan/barriers.h"

namespace lightloom::bench {
namespace {

// Initialiser lists that glslc wrote from bare_matrix.comp.
constexpr uint32_t kAcross1By1[] =
#include "bare_across_1_1.inc"
    ;
constexpr uint32_t kAcross1By2[] =
#include "bare_across_1_2.inc"
    ;
constexpr uint32_t kAlong1By8[] =
#include "bare_along_1_8.inc"
    ;
constexpr uint32_t kAlong1By16[] =
#include "bare_along_1_16.inc"
    ;
constexpr uint32_t kAcross3By1[] =
#include "bare_across_3_1.inc"
    ;
constexpr uint32_t kAcross3By2[] =
#include "bare_across_3_2.inc"
    ;
constexpr uint32_t kAlong3By8[] =
#include "bare_along_3_8.inc"
    ;
constexpr uint32_t kAlong3By16[] =
#include "bare_along_3_16.inc"
    ;

struct Form {
  const char* name;
  std::span<const uint32_t> spirv;
  uint32_t columns, rows;  ///< LL_COLUMNS, LL_ROWS
  bool along;
};
constexpr Form kForms[] = {
    {"across, 1", kAcross1By1, 1, 1, false}, {"across, 2", kAcross1By2, 1, 2, false},
    {"along, 8", kAlong1By8, 1, 8, true},    {"along, 16", kAlong1By16, 1, 16, true},
    {"across, 1", kAcross3By1, 3, 1, false}, {"across, 2", kAcross3By2, 3, 2, false},
    {"along, 8", kAlong3By8, 3, 8, true},    {"along, 16", kAlong3By16, 3, 16, true},
};

/// The length of a sum: 16 probes of order 7; a cluster's rank.
constexpr uint32_t kAlongQuads = 128, kAcrossRows = 32;
constexpr uint32_t kMoreDispatches = 4;

void must(VkResult result) { LL_CHECK(result == VK_SUCCESS); }

}  // namespace

double process_cpu_seconds() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

BareShader::BareShader(Context* context, OwnQueue* queue, size_t form, uint32_t group, uint64_t bytes)
    : context_(context), queue_(queue), form_(form), group_(group) {
  const Form& f = kForms[form];
  const uint64_t of_group = uint64_t{group} * f.rows * (f.along ? kAlongQuads : kAcrossRows);
  groups_ = static_cast<uint32_t>(std::max<uint64_t>(1, bytes / 16 / of_group));
  const uint32_t owned = groups_ * group * f.rows;
  push_ = f.along ? Push{owned, kAlongQuads} : Push{kAcrossRows, owned};
  bytes_ = 16ull * push_.rows * push_.quads;
  const uint64_t x_bytes = 96ull * std::max(kAlongQuads, kAcrossRows);
  const uint64_t y_bytes = 96ull * owned;
  // Lavapipe's memory is the host's; a copy would measure the same.
  for (size_t b = 0; const uint64_t size : {bytes_, x_bytes, y_bytes}) {
    buffers_[b++] = *Buffer::create(context_, size, BufferUse::kHost);
  }
  std::fill_n(reinterpret_cast<uint16_t*>(buffers_[0].mapped()), bytes_ / 2, float_to_half(0.5f));
  std::fill_n(reinterpret_cast<float*>(buffers_[1].mapped()), x_bytes / 4, 1.0f);
  create_pipeline();
  create_set();
  seconds(1);  // compiles
}

void BareShader::create_pipeline() {
  const VulkanTable& vk = context_->vk;
  VkDescriptorSetLayoutBinding bindings[3];
  for (uint32_t b = 0; b < 3; ++b) {
    bindings[b] = {b, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
  }
  auto set = vulkan_struct<VkDescriptorSetLayoutCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
  set.bindingCount = 3;
  set.pBindings = bindings;
  must(vk.CreateDescriptorSetLayout(context_->device, &set, nullptr, &set_layout_));
  const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(Push)};
  auto layout = vulkan_struct<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layout.setLayoutCount = 1;
  layout.pSetLayouts = &set_layout_;
  layout.pushConstantRangeCount = 1;
  layout.pPushConstantRanges = &push;
  must(vk.CreatePipelineLayout(context_->device, &layout, nullptr, &layout_));
  auto module = vulkan_struct<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  module.codeSize = kForms[form_].spirv.size_bytes();
  module.pCode = kForms[form_].spirv.data();
  auto pipeline = vulkan_struct<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
  pipeline.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  pipeline.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  must(vk.CreateShaderModule(context_->device, &module, nullptr, &pipeline.stage.module));
  pipeline.stage.pName = "main";
  const VkSpecializationMapEntry entry{0, 0, sizeof group_};
  const VkSpecializationInfo specialization{1, &entry, sizeof group_, &group_};
  pipeline.stage.pSpecializationInfo = &specialization;
  pipeline.layout = layout_;
  must(vk.CreateComputePipelines(context_->device, VK_NULL_HANDLE, 1, &pipeline, nullptr, &pipeline_));
  vk.DestroyShaderModule(context_->device, pipeline.stage.module, nullptr);
}

void BareShader::create_set() {
  const VulkanTable& vk = context_->vk;
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 3};
  auto pool = vulkan_struct<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  pool.maxSets = 1;
  pool.poolSizeCount = 1;
  pool.pPoolSizes = &size;
  must(vk.CreateDescriptorPool(context_->device, &pool, nullptr, &pool_));
  auto allocate = vulkan_struct<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
  allocate.descriptorPool = pool_;
  allocate.descriptorSetCount = 1;
  allocate.pSetLayouts = &set_layout_;
  must(vk.AllocateDescriptorSets(context_->device, &allocate, &set_));
  VkDescriptorBufferInfo infos[3];
  for (size_t b = 0; b < 3; ++b) infos[b] = buffers_[b].whole();
  auto write = vulkan_struct<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
  write.dstSet = set_;
  write.descriptorCount = 3;
  write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
  write.pBufferInfo = infos;
  vk.UpdateDescriptorSets(context_->device, 1, &write, 0, nullptr);
}

BareShader::~BareShader() {
  const VulkanTable& vk = context_->vk;
  vk.DestroyDescriptorPool(context_->device, pool_, nullptr);
  vk.DestroyPipeline(context_->device, pipeline_, nullptr);
  vk.DestroyPipelineLayout(context_->device, layout_, nullptr);
  vk.DestroyDescriptorSetLayout(context_->device, set_layout_, nullptr);
}

std::string BareShader::name() const {
  return kForms[form_].name + std::string(", workgroups of ") + std::to_string(group_);
}

double BareShader::seconds(uint32_t dispatches) const {
  const VulkanTable& vk = context_->vk;
  const double start = process_cpu_seconds();
  const absl::Status status = queue_->run([&](VkCommandBuffer commands) -> absl::Status {
    vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
    vk.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout_, 0, 1, &set_, 0, nullptr);
    vk.CmdPushConstants(commands, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(Push), &push_);
    for (uint32_t d = 0; d < dispatches; ++d) {
      vk.CmdDispatch(commands, groups_, 1, 1);
      barrier_between(*context_, commands);
    }
    return absl::OkStatus();
  });
  LL_CHECK(status.ok());
  return process_cpu_seconds() - start;
}

double BareShader::gb_per_cpu_second() const {
  const double once = seconds(1);
  return 1e-9 * static_cast<double>(bytes_ * kMoreDispatches) / (seconds(1 + kMoreDispatches) - once);
}

std::vector<std::unique_ptr<BareShader>> bare_shaders(Context* context, OwnQueue* queue, uint32_t columns,
                                                      uint64_t bytes) {
  std::vector<std::unique_ptr<BareShader>> shaders;
  for (size_t f = 0; f < std::size(kForms); ++f) {
    if (kForms[f].columns != columns) continue;
    for (const uint32_t group : {8u, 64u}) shaders.emplace_back(new BareShader(context, queue, f, group, bytes));
  }
  return shaders;
}

}  // namespace lightloom::bench
