#include "runtime/renderer/lines.h"

#include <cmath>
#include <cstddef>
#include <cstring>

#include "runtime/renderer/pipeline_parts.h"
#include "runtime/renderer/pipelines.h"
#include "runtime/renderer/shaders/frame.h"
#include "runtime/renderer/shadow_views.h"
#include "runtime/renderer/status.h"

namespace lightloom::renderer {
namespace {

// clang-format off
constexpr uint32_t kVert[] =
#include "runtime/renderer/shaders/lines.vert.inc"
;
constexpr uint32_t kFrag[] =
#include "runtime/renderer/shaders/lines.frag.inc"
;
// clang-format on

constexpr float kNearer = 1.002f;  // two millimetres of a metre: less than any thing is thick

absl::StatusOr<Owned<VkPipeline>> make_pipeline(VkDevice device, VkPipelineLayout layout, VkFormat colour,
                                                VkPrimitiveTopology topology) {
  GraphicsPipeline info;
  info.layout = layout;
  info.vertex = kVert;
  info.fragment = kFrag;
  info.stride = sizeof(ColouredVertex);
  info.attributes = {{0, 0, VK_FORMAT_R32G32B32_SFLOAT, offsetof(ColouredVertex, position)},
                     {1, 0, VK_FORMAT_R8G8B8A8_UNORM, offsetof(ColouredVertex, colour)}};
  info.topology = topology;
  info.colour = colour;
  info.depth = kDepthFormat;
  info.depth_test = VK_COMPARE_OP_GREATER_OR_EQUAL;
  info.depth_write = false;
  info.blend = true;
  return graphics_pipeline(device, info);
}

}  // namespace

void Marks::line(Vec3 a, Vec3 b, Rgba colour) {
  lines.push_back({a, colour});
  lines.push_back({b, colour});
}

void Marks::box(const Aabb& box, Rgba colour) {
  const auto corner = [&](int i) {
    return Vec3{(i & 1) != 0 ? box.hi.x : box.lo.x, (i & 2) != 0 ? box.hi.y : box.lo.y,
                (i & 4) != 0 ? box.hi.z : box.lo.z};
  };
  for (int i = 0; i < 8; ++i) {
    for (const int axis : {1, 2, 4}) {
      if ((i & axis) == 0) line(corner(i), corner(i | axis), colour);
    }
  }
}

void Marks::square(Vec3 centre, Vec3 normal, float half, Rgba colour) {
  // Upright on walls, as most lightmaps are.
  const Vec3 s = normalize(cross(std::abs(normal.y) < 0.99f ? Vec3{0, 1, 0} : Vec3{0, 0, 1}, normal)) * half;
  const Vec3 t = cross(normal, s);
  for (const Vec3 p :
       {centre - s - t, centre + s - t, centre + s + t, centre - s - t, centre + s + t, centre - s + t}) {
    triangles.push_back({p, colour});
  }
}

void Marks::octahedron(Vec3 centre, float radius, Rgba colour) {
  for (int i = 0; i < 8; ++i) {
    // Faces in three brightnesses: without light they would show no shape.
    const float shade = (i & 2) != 0 ? 0.6f : (i & 1) != 0 ? 1.0f : 0.8f;
    Rgba c = colour;
    for (size_t k = 0; k < 3; ++k) c[k] = static_cast<uint8_t>(static_cast<float>(c[k]) * shade);
    triangles.push_back({centre + Vec3{(i & 1) != 0 ? radius : -radius, 0, 0}, c});
    triangles.push_back({centre + Vec3{0, (i & 2) != 0 ? -radius : radius, 0}, c});
    triangles.push_back({centre + Vec3{0, 0, (i & 4) != 0 ? radius : -radius}, c});
  }
}

void Marks::append(const Marks& other) {
  lines.insert(lines.end(), other.lines.begin(), other.lines.end());
  triangles.insert(triangles.end(), other.triangles.begin(), other.triangles.end());
}

absl::StatusOr<Lines> Lines::create(Gpu* gpu, VkFormat colour_format) {
  Lines out;
  out.gpu_ = gpu;
  LL_ASSIGN_OR_RETURN(out.layout_, pipeline_layout(gpu->device(), {}, sizeof(gpu::LinesPush)));
  const VkPipelineLayout layout = out.layout_.get();
  LL_ASSIGN_OR_RETURN(out.lines_, make_pipeline(gpu->device(), layout, colour_format, VK_PRIMITIVE_TOPOLOGY_LINE_LIST));
  LL_ASSIGN_OR_RETURN(out.triangles_,
                      make_pipeline(gpu->device(), layout, colour_format, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST));
  return out;
}

absl::Status Lines::set(const Marks& marks) {
  line_count_ = static_cast<uint32_t>(marks.lines.size());
  triangle_count_ = static_cast<uint32_t>(marks.triangles.size());
  const size_t first = marks.triangles.size() * sizeof(ColouredVertex);
  const size_t bytes = first + marks.lines.size() * sizeof(ColouredVertex);
  if (bytes == 0) return absl::OkStatus();
  if (vertices_.bytes < bytes) {
    LL_ASSIGN_OR_RETURN(vertices_, gpu_->host_buffer(bytes + bytes / 2, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT));
  }
  auto* const to = static_cast<uint8_t*>(vertices_.mapped);
  if (triangle_count_ > 0) std::memcpy(to, marks.triangles.data(), first);
  if (line_count_ > 0) std::memcpy(to + first, marks.lines.data(), bytes - first);
  return absl::OkStatus();
}

void Lines::record(VkCommandBuffer commands, const Camera& camera, const Texture2D& target,
                   const Texture2D& depth) const {
  if (line_count_ + triangle_count_ == 0) return;
  Use again = kColour;  // blends with what was drawn before
  again.access |= VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT;
  transition(commands, target.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kColour, again);
  transition(commands, depth.handle.get(), VK_IMAGE_ASPECT_DEPTH_BIT, kDepth, kDepth);
  auto colour = vulkan_struct<VkRenderingAttachmentInfo>(VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO);
  colour.imageView = target.view.get();
  colour.imageLayout = kColour.layout;
  colour.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
  colour.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  auto tested = colour;
  tested.imageView = depth.view.get();
  tested.imageLayout = kDepth.layout;
  auto rendering = vulkan_struct<VkRenderingInfo>(VK_STRUCTURE_TYPE_RENDERING_INFO);
  rendering.renderArea = {{0, 0}, {target.width, target.height}};
  rendering.layerCount = 1;
  rendering.colorAttachmentCount = 1;
  rendering.pColorAttachments = &colour;
  rendering.pDepthAttachment = &tested;
  const VkViewport viewport{0, 0, static_cast<float>(target.width), static_cast<float>(target.height), 0, 1};
  const gpu::LinesPush push{camera_matrix(camera), kNearer};
  const VkBuffer vertices = vertices_.handle.get();
  const VkDeviceSize start = 0;
  vkCmdBeginRendering(commands, &rendering);
  vkCmdSetViewport(commands, 0, 1, &viewport);
  vkCmdSetScissor(commands, 0, 1, &rendering.renderArea);
  vkCmdBindVertexBuffers(commands, 0, 1, &vertices, &start);
  vkCmdPushConstants(commands, layout_.get(), VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, 0, sizeof push,
                     &push);
  if (triangle_count_ > 0) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, triangles_.get());
    vkCmdDraw(commands, triangle_count_, 1, 0, 0);
  }
  if (line_count_ > 0) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, lines_.get());
    vkCmdDraw(commands, line_count_, 1, triangle_count_, 0);
  }
  vkCmdEndRendering(commands);
}

}  // namespace lightloom::renderer
