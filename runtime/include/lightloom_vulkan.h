/* lightloom on the engine's own Vulkan device: its passes are recorded into the engine's command buffer. There is
 * no queue, submission or wait of ours; once an asset is loaded, recording allocates nothing and creates no Vulkan
 * object. C99.
 *
 *   lightloom_vulkan_check   is the device good enough?
 *   lightloom_vulkan_create  from the engine's VkDevice
 *   lightloom_load_...       (lightloom.h)
 *   each frame:  lightloom_vulkan_record(commands), then draw with E as a buffer or a sampled image
 */
#ifndef LIGHTLOOM_VULKAN_H
#define LIGHTLOOM_VULKAN_H

#include <lightloom.h>
#include <vulkan/vulkan_core.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What the device must have. Filled by lightloom_vulkan_check whatever the device has. */
typedef struct lightloom_vulkan_requirements {
  uint32_t struct_size;
  uint32_t api_version;                   /* Vulkan 1.1; no extensions, no features */
  uint32_t storage_buffers;               /* maxPerStageDescriptorStorageBuffers */
  uint32_t workgroup_invocations;         /* maxComputeWorkGroupInvocations */
  uint32_t shared_memory_bytes;           /* maxComputeSharedMemorySize */
  uint32_t push_constant_bytes;           /* maxPushConstantsSize */
  uint64_t storage_buffer_range;          /* maxStorageBufferRange; an asset may need more: UNSUPPORTED_ASSET */
  VkBufferUsageFlags direct_buffer_usage; /* of lightloom_frame_info.direct_buffer */
} lightloom_vulkan_requirements;

typedef struct lightloom_vulkan_check_info {
  uint32_t struct_size;
  uint32_t queue_family; /* on which the command buffers will run: must have compute */
  VkInstance instance;
  VkPhysicalDevice physical_device;
  PFN_vkGetInstanceProcAddr get_instance_proc_addr;
  lightloom_message_fn message; /* hears what lacks; may be null */
  void* message_user;
} lightloom_vulkan_check_info;

/* OK or MISSING_FEATURE. `requirements` may be null. */
LIGHTLOOM_API lightloom_result lightloom_vulkan_check(const lightloom_vulkan_check_info* info,
                                                      lightloom_vulkan_requirements* requirements);

typedef struct lightloom_vulkan_create_info {
  uint32_t struct_size;
  uint32_t flags; /* LIGHTLOOM_CREATE_SMOOTHING */
  lightloom_message_fn message;
  void* message_user;
  lightloom_allocator allocator;
  VkInstance instance; /* made for Vulkan 1.1 or newer */
  VkPhysicalDevice physical_device;
  VkDevice device;
  PFN_vkGetInstanceProcAddr get_instance_proc_addr;  /* every Vulkan call goes through these two */
  PFN_vkGetDeviceProcAddr get_device_proc_addr;      /* null: asked of the other */
  const VkAllocationCallbacks* allocation_callbacks; /* may be null; given to every vkCreate and vkAllocate */
  uint32_t queue_family;                             /* on which the command buffers will run */
  uint32_t frames_in_flight;                         /* 1..8; see lightloom_vulkan_record */
  uint64_t byte_budget;                              /* as lightloom_create_info */
  uint64_t page_bytes;                               /* as lightloom_create_info */
  uint64_t staging_bytes;                            /* as lightloom_create_info */
  uint32_t workgroup_size;                           /* as lightloom_create_info */
  uint32_t max_workgroups;                           /* as lightloom_create_info */
  uint32_t max_lights;                               /* that a frame may have; 0: 64 */
  uint32_t max_shadow_views;                         /* 0: 128 */
  VkFormat image_format; /* of E as an image: R16G16B16A16_SFLOAT or R32G32B32A32_SFLOAT; UNDEFINED: no image */
} lightloom_vulkan_create_info;

/* *out is null on failure. The device must outlive the runtime. */
LIGHTLOOM_API lightloom_result lightloom_vulkan_create(const lightloom_vulkan_create_info* info,
                                                       lightloom_runtime** out);

/* Where the direct light of a frame comes from. */
typedef enum lightloom_direct_source {
  LIGHTLOOM_DIRECT_HOST = 0,   /* lightloom_set_direct, or what the last frame had */
  LIGHTLOOM_DIRECT_BUFFER = 1, /* direct_buffer */
  LIGHTLOOM_DIRECT_LIGHTS = 2  /* our own pass over lights and shadow maps */
} lightloom_direct_source;

typedef struct lightloom_frame_info {
  uint32_t struct_size;
  uint32_t direct_source; /* lightloom_direct_source */
  /* DIRECT_BUFFER: S x 3 floats from `direct_offset` on (a multiple of minStorageBufferOffsetAlignment), in a buffer
   * with storage usage that shaders may read when our commands run. */
  VkBuffer direct_buffer;
  VkDeviceSize direct_offset;
  /* DIRECT_LIGHTS: copied by the call. */
  const lightloom_light* lights;
  const lightloom_shadow_view* shadow_views;
  uint32_t light_count;
  uint32_t shadow_view_count;
  /* Depth images, D32_SFLOAT, as one 2D array view (aspect depth); nearer is smaller. May be null if no light has
   * shadow views. Layout as given (DEPTH_STENCIL_READ_ONLY_OPTIMAL, SHADER_READ_ONLY_OPTIMAL or GENERAL). */
  VkImageView shadow_maps;
  VkImageLayout shadow_layout;
  uint32_t shadow_map_size; /* texels along a side */
  /* The image holds E times this, finite and > 0; 0: 1. An engine that exposes its light beforehand keeps E within what
   * fp16 holds (6e-8 to 65504). The buffer of E is not scaled. When it changes, all of the image is written anew. */
  float image_exposure;
  uint32_t reserved; /* 0 */
} lightloom_frame_info;

/* Records one frame, outside of a render pass. `info` null: all zero.
 *
 * The caller promises: when it records frame n, frame n - frames_in_flight is finished on the GPU; the command
 * buffers are submitted once, in the order of recording, all on queues whose work is ordered among each other;
 * nobody waits between them for us. Before: direct_buffer and the shadow maps are made visible to compute shader
 * reads, and reads of the outputs by earlier frames need no barrier (we wait for all graphics, compute and transfer
 * stages before writing E). After: E is visible to shader reads (vertex, fragment, compute) and transfer reads of
 * later commands; no barrier is needed in the same queue.
 *
 * With pending loads it may free what was unloaded. On an error the command buffer is invalid: do not submit it. */
LIGHTLOOM_API lightloom_result lightloom_vulkan_record(lightloom_runtime* runtime, VkCommandBuffer commands,
                                                       const lightloom_frame_info* info);

/* Valid until the asset is unloaded. */
typedef struct lightloom_vulkan_outputs {
  uint32_t struct_size;
  uint32_t surface_elements;
  VkBuffer irradiance; /* S x 3 floats, storage and transfer source */
  VkDeviceSize irradiance_bytes;
  VkBuffer direct; /* S x 3 floats: what lightloom_set_direct or our direct pass wrote */
  /* E times image_exposure in the lightmap's layout, alpha 1 at valid texels and 0 at those that are filled from neighbours (two texels
   * around each chart); layer 0: fronts, layer 1: backs. Row 0 is v = 0. Always in VK_IMAGE_LAYOUT_GENERAL once a
   * frame is recorded. Null without image_format. */
  VkImage image;
  VkImageView image_view; /* 2D array of 2 layers */
  VkFormat image_format;
  uint32_t image_width, image_height, image_layers;
} lightloom_vulkan_outputs;

LIGHTLOOM_API lightloom_result lightloom_vulkan_get_outputs(lightloom_runtime* runtime,
                                                            lightloom_vulkan_outputs* outputs);

/* ---- A device, for programs that have none --------------------------------------------------------------- */

typedef struct lightloom_vulkan_device_info {
  uint32_t struct_size;
  uint32_t flags;       /* LIGHTLOOM_CREATE_VALIDATION, LIGHTLOOM_CREATE_GPU_ASSISTED */
  uint32_t queue_flags; /* VkQueueFlags that the queue must have besides compute, such as VK_QUEUE_GRAPHICS_BIT */
  uint32_t reserved;    /* 0 */
  lightloom_message_fn message; /* hears errors and validation; may be null */
  void* message_user;
} lightloom_vulkan_device_info;

typedef struct lightloom_vulkan_device {
  VkInstance instance;
  VkPhysicalDevice physical_device;
  VkDevice device;
  VkQueue queue;
  uint32_t queue_family;
  uint32_t reserved;
  PFN_vkGetInstanceProcAddr get_instance_proc_addr;
  void* internal;
} lightloom_vulkan_device;

/* The Vulkan loader is opened at run time. `out` is all zero on failure. */
LIGHTLOOM_API lightloom_result lightloom_vulkan_make_device(const lightloom_vulkan_device_info* info,
                                                            lightloom_vulkan_device* out);
/* Every runtime on it must be destroyed before. */
LIGHTLOOM_API void lightloom_vulkan_destroy_device(lightloom_vulkan_device* device);

#ifdef __cplusplus
}
#endif

#endif /* LIGHTLOOM_VULKAN_H */
