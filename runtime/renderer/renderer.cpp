#include "runtime/renderer/renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "core/base/sampling.h"
#include "runtime/renderer/status.h"

namespace lightloom::renderer {
namespace {

constexpr VkShaderStageFlags kPushStages = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;

static_assert(static_cast<uint32_t>(Layer::kFull) == gpu::kFull && static_cast<uint32_t>(Layer::kE) == gpu::kE &&
              static_cast<uint32_t>(Layer::kAlbedo) == gpu::kAlbedo);
static_assert(static_cast<uint32_t>(LightType::kPoint) == gpu::kPoint &&
              static_cast<uint32_t>(LightType::kDirectional) == gpu::kDirectional);

template <class T>
void copy(const std::vector<T>& from, const Buffer& to) {
  if (!from.empty()) std::memcpy(to.mapped, from.data(), from.size() * sizeof(T));
}

void append_layer(const Image& image, std::vector<float>* texels) {
  const auto *r = image.channel("R"), *g = image.channel("G"), *b = image.channel("B"), *a = image.channel("A");
  for (size_t i = 0; i < r->size(); ++i) texels->insert(texels->end(), {(*r)[i], (*g)[i], (*b)[i], (*a)[i]});
}

}  // namespace

absl::StatusOr<std::unique_ptr<Renderer>> Renderer::create(Gpu* gpu, const Scene& scene, const AtlasLayout& layout,
                                                           uint32_t shadow_size) {
  std::unique_ptr<Renderer> r(new Renderer(gpu, scene));
  LL_ASSIGN_OR_RETURN(r->pipelines_, make_pipelines(*gpu));
  r->layout_ = layout;
  r->mesh_ = make_mesh(scene, layout);
  LL_ASSIGN_OR_RETURN(r->vertices_, gpu->device_buffer(bytes_of(r->mesh_.vertices), VK_BUFFER_USAGE_VERTEX_BUFFER_BIT));
  r->mesh_.vertices = {};
  LL_ASSIGN_OR_RETURN(Materials materials, Materials::create(*gpu, scene, r->pipelines_.material_set.get()));
  r->materials_ = std::make_unique<Materials>(std::move(materials));
  LL_ASSIGN_OR_RETURN(ShadowMaps maps, ShadowMaps::create(*gpu, shadow_view_count(scene.lights), shadow_size));
  r->shadow_maps_ = std::make_unique<ShadowMaps>(std::move(maps));
  for (const Light& light : scene.lights) r->light_types_.push_back(light.type);
  r->bounds_ = scene.bounds();
  LL_RETURN_IF_ERROR(r->make_frame_set());
  const Image dark(1, 1, {"R", "G", "B", "A"});
  LL_RETURN_IF_ERROR(r->set_irradiance(dark, dark));
  return r;
}

absl::Status Renderer::make_frame_set() {
  auto sampler = vulkan_struct<VkSamplerCreateInfo>(VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO);
  sampler.addressModeU = sampler.addressModeV = sampler.addressModeW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
  VkSampler nearest = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateSampler", vkCreateSampler(gpu_->device(), &sampler, nullptr, &nearest));
  nearest_ = {gpu_->device(), nearest, vkDestroySampler};

  const size_t lights = scene_.lights.size(), views = shadow_view_count(scene_.lights);
  LL_ASSIGN_OR_RETURN(frame_data_, gpu_->host_buffer(sizeof(gpu::FrameData), VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT));
  LL_ASSIGN_OR_RETURN(light_data_,
                      gpu_->host_buffer(lights * sizeof(gpu::LightData), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
  LL_ASSIGN_OR_RETURN(view_data_, gpu_->host_buffer(views * sizeof(gpu::ViewData), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));

  const std::array<VkDescriptorPoolSize, 3> sizes{{{VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 1},
                                                   {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 2},
                                                   {VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 2}}};
  auto info = vulkan_struct<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  info.maxSets = 1;
  info.poolSizeCount = static_cast<uint32_t>(sizes.size());
  info.pPoolSizes = sizes.data();
  VkDescriptorPool pool = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateDescriptorPool", vkCreateDescriptorPool(gpu_->device(), &info, nullptr, &pool));
  pool_ = {gpu_->device(), pool, vkDestroyDescriptorPool};
  const VkDescriptorSetLayout layout = pipelines_.frame_set.get();
  auto allocate = vulkan_struct<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
  allocate.descriptorPool = pool;
  allocate.descriptorSetCount = 1;
  allocate.pSetLayouts = &layout;
  LL_VK_RETURN_IF_ERROR("vkAllocateDescriptorSets", vkAllocateDescriptorSets(gpu_->device(), &allocate, &frame_set_));

  const std::array<const Buffer*, 3> buffers{&frame_data_, &light_data_, &view_data_};
  for (uint32_t b = 0; b < buffers.size(); ++b) {
    const VkDescriptorBufferInfo buffer{buffers[b]->handle.get(), 0, VK_WHOLE_SIZE};
    auto write = vulkan_struct<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
    write.dstSet = frame_set_;
    write.dstBinding = b;
    write.descriptorCount = 1;
    write.descriptorType = b == 0 ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    write.pBufferInfo = &buffer;
    vkUpdateDescriptorSets(gpu_->device(), 1, &write, 0, nullptr);
  }
  bind_image(3, nearest, shadow_maps_->view(), kSampled.layout);
  return absl::OkStatus();
}

void Renderer::bind_image(uint32_t binding, VkSampler sampler, VkImageView view, VkImageLayout layout) const {
  const VkDescriptorImageInfo image{sampler, view, layout};
  auto write = vulkan_struct<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
  write.dstSet = frame_set_;
  write.dstBinding = binding;
  write.descriptorCount = 1;
  write.descriptorType = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
  write.pImageInfo = &image;
  vkUpdateDescriptorSets(gpu_->device(), 1, &write, 0, nullptr);
}

absl::Status Renderer::set_irradiance(const Image& fronts, const Image& backs) {
  const auto width = static_cast<uint32_t>(fronts.width), height = static_cast<uint32_t>(fronts.height);
  if (irradiance_.width != width || irradiance_.height != height) {
    TextureInfo info;
    info.format = VK_FORMAT_R32G32B32A32_SFLOAT;
    info.width = width;
    info.height = height;
    info.layers = 2;
    info.array = true;
    info.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
    LL_ASSIGN_OR_RETURN(irradiance_, gpu_->texture(info));
  }
  std::vector<float> texels;
  texels.reserve(8ull * width * height);
  append_layer(fronts, &texels);
  append_layer(backs, &texels);
  LL_RETURN_IF_ERROR(gpu_->fill(irradiance_, bytes_of(texels)));
  use_irradiance(irradiance_.view.get(), kSampled.layout);
  return absl::OkStatus();
}

void Renderer::use_irradiance(VkImageView view, VkImageLayout layout) { bind_image(4, nearest_.get(), view, layout); }

absl::Status Renderer::update_lights() {
  const bool same = std::equal(scene_.lights.begin(), scene_.lights.end(), light_types_.begin(), light_types_.end(),
                               [](const Light& light, LightType type) { return light.type == type; });
  if (!same) return absl::FailedPreconditionError("lights came, went or changed their type; make a new renderer");
  views_ = make_shadow_views(scene_.lights, bounds_, shadow_maps_->size());
  copy(views_.lights, light_data_);
  copy(views_.views, view_data_);
  return absl::OkStatus();
}

void Renderer::record_shadows(VkCommandBuffer commands) const {
  const bool keep = drawn_.has_value();
  std::vector<gpu::ViewData> changed;
  for (size_t v = 0; v < views_.views.size(); ++v) {
    if (!keep || (*drawn_)[v].view_projection != views_.views[v].view_projection) changed.push_back(views_.views[v]);
  }
  shadow_maps_->record(commands, changed, keep, pipelines_, vertices_.handle.get(), mesh_, scene_, *materials_);
  drawn_ = views_.views;
}

absl::Status Renderer::set_size(uint32_t width, uint32_t height) {
  if (colour_.width == width && colour_.height == height) return absl::OkStatus();
  TextureInfo info;
  info.width = width;
  info.height = height;
  info.format = kColourFormat;
  info.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_SAMPLED_BIT;
  LL_ASSIGN_OR_RETURN(colour_, gpu_->texture(info));
  info.format = kDepthFormat;
  info.aspect = VK_IMAGE_ASPECT_DEPTH_BIT;
  info.usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT;
  LL_ASSIGN_OR_RETURN(depth_, gpu_->texture(info));
  LL_ASSIGN_OR_RETURN(readback_, gpu_->host_buffer(16ull * width * height, VK_BUFFER_USAGE_TRANSFER_DST_BIT));
  return absl::OkStatus();
}

void Renderer::record_forward(VkCommandBuffer commands) const {
  transition(commands, colour_.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kNoUse, kColour);
  transition(commands, depth_.handle.get(), VK_IMAGE_ASPECT_DEPTH_BIT, kNoUse, kDepth);
  auto colour = vulkan_struct<VkRenderingAttachmentInfo>(VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO);
  colour.imageView = colour_.view.get();
  colour.imageLayout = kColour.layout;
  colour.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
  colour.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  colour.clearValue.color = {{background_.x, background_.y, background_.z, 1}};
  auto depth = colour;
  depth.imageView = depth_.view.get();
  depth.imageLayout = kDepth.layout;
  depth.clearValue.depthStencil = {0, 0};
  auto rendering = vulkan_struct<VkRenderingInfo>(VK_STRUCTURE_TYPE_RENDERING_INFO);
  rendering.renderArea = {{0, 0}, {colour_.width, colour_.height}};
  rendering.layerCount = 1;
  rendering.colorAttachmentCount = 1;
  rendering.pColorAttachments = &colour;
  rendering.pDepthAttachment = &depth;
  const VkViewport viewport{0, 0, static_cast<float>(colour_.width), static_cast<float>(colour_.height), 0, 1};
  const VkPipelineLayout layout = pipelines_.forward_layout.get();
  const VkBuffer vertices = vertices_.handle.get();
  const VkDeviceSize start = 0;

  vkCmdBeginRendering(commands, &rendering);
  vkCmdSetViewport(commands, 0, 1, &viewport);
  vkCmdSetScissor(commands, 0, 1, &rendering.renderArea);
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipelines_.forward.get());
  vkCmdBindVertexBuffers(commands, 0, 1, &vertices, &start);
  vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 0, 1, &frame_set_, 0, nullptr);
  for (const DrawRange& range : mesh_.ranges) {
    const VkDescriptorSet set = materials_->set(range.material);
    const gpu::MaterialPush push = material_push(scene_.materials[range.material]);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 1, 1, &set, 0, nullptr);
    vkCmdPushConstants(commands, layout, kPushStages, 0, sizeof push, &push);
    vkCmdDraw(commands, range.count, 1, range.first, 0);
  }
  vkCmdEndRendering(commands);
  transition(commands, colour_.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kColour, kSampled);
}

void Renderer::record_read(VkCommandBuffer commands) const {
  transition(commands, colour_.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kSampled, kCopySource);
  VkBufferImageCopy region{};
  region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  region.imageExtent = {colour_.width, colour_.height, 1};
  vkCmdCopyImageToBuffer(commands, colour_.handle.get(), kCopySource.layout, readback_.handle.get(), 1, &region);
  after_copies(commands);
}

Image Renderer::resolve(int width, int height, int side) const {
  Image image(width, height, {"R", "G", "B"});
  const auto* texels = static_cast<const std::array<float, 4>*>(readback_.mapped);
  const float share = 1.0f / static_cast<float>(side * side);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Vec3 sum;
      for (int k = 0; k < side * side; ++k) {
        const int xx = x * side + k % side, yy = y * side + k / side;
        const auto& t = texels[static_cast<size_t>(yy) * static_cast<size_t>(width * side) + static_cast<size_t>(xx)];
        sum += Vec3{t[0], t[1], t[2]} * share;
      }
      image.set_rgb(x, y, sum);
    }
  }
  return image;
}

absl::Status Renderer::set_view(const Camera& camera, Layer layer) {
  LL_RETURN_IF_ERROR(update_lights());
  const gpu::FrameData frame{camera_matrix(camera),
                             {camera.position.x, camera.position.y, camera.position.z, 0},
                             static_cast<uint32_t>(views_.lights.size()),
                             static_cast<uint32_t>(layer),
                             shadow_maps_->size(),
                             0};
  std::memcpy(frame_data_.mapped, &frame, sizeof frame);
  background_ = shows_sky(layer) ? scene_.environment : Vec3{};
  return absl::OkStatus();
}

absl::Status Renderer::record(VkCommandBuffer commands,
                              const std::function<absl::Status(VkCommandBuffer)>& between) const {
  record_shadows(commands);
  absl::Status status = between ? between(commands) : absl::OkStatus();
  if (!status.ok()) {
    drawn_.reset();  // nothing of this will run
    return status;
  }
  record_forward(commands);
  return absl::OkStatus();
}

absl::StatusOr<Image> Renderer::read() const {
  LL_RETURN_IF_ERROR(gpu_->run([&](VkCommandBuffer commands) {
    record_read(commands);
    transition(commands, colour_.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kCopySource, kSampled);
    return absl::OkStatus();
  }));
  return resolve(static_cast<int>(colour_.width), static_cast<int>(colour_.height), 1);
}

absl::StatusOr<Image> Renderer::render(const Camera& camera, const PictureOptions& options,
                                       const std::function<absl::Status(VkCommandBuffer)>& between) {
  LL_ASSIGN_OR_RETURN(const int height, image_height(camera, options.width));
  const int side = static_cast<int>(strata(options.samples));
  LL_RETURN_IF_ERROR(set_size(static_cast<uint32_t>(options.width * side), static_cast<uint32_t>(height * side)));
  LL_RETURN_IF_ERROR(set_view(camera, options.layer));
  LL_RETURN_IF_ERROR(gpu_->run([&](VkCommandBuffer commands) -> absl::Status {
    LL_RETURN_IF_ERROR(record(commands, between));
    record_read(commands);
    return absl::OkStatus();
  }));
  return resolve(options.width, height, side);
}

absl::Status Renderer::update_object(size_t object) {
  const std::vector<VertexRun> runs = object_vertices(scene_, layout_, mesh_, object);
  uint64_t bytes = 0;
  for (const VertexRun& run : runs) bytes += run.vertices.size() * sizeof(Vertex);
  if (bytes == 0) return absl::OkStatus();
  LL_ASSIGN_OR_RETURN(const Buffer staging, gpu_->host_buffer(bytes, VK_BUFFER_USAGE_TRANSFER_SRC_BIT));
  std::vector<VkBufferCopy> regions;
  uint64_t at = 0;
  for (const VertexRun& run : runs) {
    const uint64_t size = run.vertices.size() * sizeof(Vertex);
    std::memcpy(static_cast<uint8_t*>(staging.mapped) + at, run.vertices.data(), size);
    regions.push_back({at, run.first * sizeof(Vertex), size});
    at += size;
  }
  bounds_ = scene_.bounds();
  drawn_.reset();
  return gpu_->run([&](VkCommandBuffer commands) {
    vkCmdCopyBuffer(commands, staging.handle.get(), vertices_.handle.get(), static_cast<uint32_t>(regions.size()),
                    regions.data());
    after_copies(commands);
    return absl::OkStatus();
  });
}

}  // namespace lightloom::renderer
