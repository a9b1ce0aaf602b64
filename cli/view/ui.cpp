#include "cli/view/ui.h"

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_vulkan.h>
#include <imgui.h>

#include "runtime/renderer/status.h"

namespace lightloom::view {
namespace {

using renderer::kColour;
using renderer::vulkan_struct;

/// The first error of ImGui's own Vulkan calls: it has no other way to say so.
VkResult ui_error = VK_SUCCESS;
void note(VkResult result) {
  if (result < 0 && ui_error == VK_SUCCESS) ui_error = result;
}
absl::Status ui_status() { return renderer::vulkan_status(ui_error, "the user interface"); }

/// ImGui 1.86 knows no dynamic rendering.
absl::StatusOr<renderer::Owned<VkRenderPass>> make_pass(VkDevice device, VkFormat format) {
  VkAttachmentDescription colour{};
  colour.format = format;
  colour.samples = VK_SAMPLE_COUNT_1_BIT;
  colour.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  colour.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  colour.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  colour.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  colour.initialLayout = colour.finalLayout = kColour.layout;
  const VkAttachmentReference reference{0, kColour.layout};
  VkSubpassDescription subpass{};
  subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &reference;
  auto info = vulkan_struct<VkRenderPassCreateInfo>(VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO);
  info.attachmentCount = 1;
  info.pAttachments = &colour;
  info.subpassCount = 1;
  info.pSubpasses = &subpass;
  VkRenderPass pass = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateRenderPass", vkCreateRenderPass(device, &info, nullptr, &pass));
  return renderer::Owned<VkRenderPass>(device, pass, vkDestroyRenderPass);
}

void look() {
  ImGui::StyleColorsDark();
  ImGuiStyle& style = ImGui::GetStyle();
  style.WindowRounding = 0;
  style.FrameRounding = 3;
  style.Colors[ImGuiCol_WindowBg].w = 0.88f;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Ui>> Ui::create(GLFWwindow* window, renderer::Gpu* gpu, VkFormat format) {
  std::unique_ptr<Ui> ui(new Ui);
  LL_RETURN_IF_ERROR(ui->start(window, gpu, format));
  return ui;
}

absl::Status Ui::start(GLFWwindow* window, renderer::Gpu* gpu, VkFormat format) {
  device_ = gpu->device();
  ui_error = VK_SUCCESS;
  LL_ASSIGN_OR_RETURN(pass_, make_pass(device_, format));
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 4};
  auto pool_info = vulkan_struct<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  pool_info.flags = VK_DESCRIPTOR_POOL_CREATE_FREE_DESCRIPTOR_SET_BIT;
  pool_info.maxSets = 4;
  pool_info.poolSizeCount = 1;
  pool_info.pPoolSizes = &size;
  VkDescriptorPool pool = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateDescriptorPool", vkCreateDescriptorPool(device_, &pool_info, nullptr, &pool));
  pool_ = {device_, pool, vkDestroyDescriptorPool};

  ImGui::CreateContext();
  ImGui::GetIO().IniFilename = nullptr;  // nothing is written where the user happens to be
  look();
  window_started_ = ImGui_ImplGlfw_InitForVulkan(window, /*install_callbacks=*/true);
  ImGui_ImplVulkan_InitInfo info{};
  info.Instance = gpu->instance();
  info.PhysicalDevice = gpu->physical();
  info.Device = device_;
  info.QueueFamily = gpu->queue_family();
  info.Queue = gpu->queue();
  info.DescriptorPool = pool;
  info.MinImageCount = info.ImageCount = 2;
  info.MSAASamples = VK_SAMPLE_COUNT_1_BIT;
  info.CheckVkResultFn = note;
  vulkan_started_ = ImGui_ImplVulkan_Init(&info, pass_.get());
  LL_RETURN_IF_ERROR(gpu->run([](VkCommandBuffer commands) {
    ImGui_ImplVulkan_CreateFontsTexture(commands);
    return absl::OkStatus();
  }));
  ImGui_ImplVulkan_DestroyFontUploadObjects();
  return ui_status();
}

Ui::~Ui() {
  if (vulkan_started_) ImGui_ImplVulkan_Shutdown();
  if (window_started_) ImGui_ImplGlfw_Shutdown();
  if (ImGui::GetCurrentContext() != nullptr) ImGui::DestroyContext();
}

absl::Status Ui::set_picture(const renderer::Texture2D& picture) {
  const VkImageView view = picture.view.get();
  auto info = vulkan_struct<VkFramebufferCreateInfo>(VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO);
  info.renderPass = pass_.get();
  info.attachmentCount = 1;
  info.pAttachments = &view;
  info.width = picture.width;
  info.height = picture.height;
  info.layers = 1;
  VkFramebuffer frame = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateFramebuffer", vkCreateFramebuffer(device_, &info, nullptr, &frame));
  frame_ = {device_, frame, vkDestroyFramebuffer};
  picture_ = picture.handle.get();
  extent_ = {picture.width, picture.height};
  return absl::OkStatus();
}

void Ui::begin() {
  ImGui_ImplVulkan_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  ImGui::NewFrame();
}

void Ui::end() { ImGui::Render(); }

absl::Status Ui::record(VkCommandBuffer commands) {
  renderer::Use again = kColour;  // blends with what was drawn before
  again.access |= VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT;
  transition(commands, picture_, VK_IMAGE_ASPECT_COLOR_BIT, kColour, again);
  auto begin = vulkan_struct<VkRenderPassBeginInfo>(VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO);
  begin.renderPass = pass_.get();
  begin.framebuffer = frame_.get();
  begin.renderArea.extent = extent_;
  vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
  ImGui_ImplVulkan_RenderDrawData(ImGui::GetDrawData(), commands);
  vkCmdEndRenderPass(commands);
  return ui_status();
}

}  // namespace lightloom::view
