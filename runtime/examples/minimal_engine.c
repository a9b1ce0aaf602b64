/* The least an engine does to be lit by lightloom: a device of its own, an asset from disk, one lamp that moves, and the
 * irradiance E of every frame.
 *
 *   minimal_engine LEVEL.loom OUT FRAMES x0 y0 z0 x1 y1 z1
 *
 * moves a lamp of 10 W/sr from (x0, y0, z0) to (x1, y1, z1) and writes OUT_0000.ppm, OUT_0001.ppm, ...: E of the lightmap,
 * which a real engine would sample while it draws. The lamp has no shadows here: those come from shadow maps that the
 * engine draws anyway (runtime/renderer/shadow_maps.cpp does). */
#include <lightloom_vulkan.h>
#include <stdio.h>
#include <stdlib.h>
#include <vulkan/vulkan.h>

#define FRAMES_IN_FLIGHT 2

static void fail(const char* what, int code) {
  fprintf(stderr, "minimal_engine: %s (%d)\n", what, code);
  exit(1);
}
static void vk(VkResult result, const char* what) {
  if (result != VK_SUCCESS) fail(what, result);
}
static void on_message(void* user, lightloom_message_kind kind, const char* text) {
  (void)user, (void)kind;
  fprintf(stderr, "lightloom: %s\n", text);
}
static void loom(lightloom_result result) {
  if (result != LIGHTLOOM_OK) fail(lightloom_result_string(result), result);
}

/* ---- The engine's own Vulkan ---- */

typedef struct {
  VkInstance instance;
  VkPhysicalDevice physical;
  VkDevice device;
  VkQueue queue;
  uint32_t family;
  VkCommandPool pool;
  VkCommandBuffer commands[FRAMES_IN_FLIGHT];
  VkFence done[FRAMES_IN_FLIGHT];
} Engine;

static Engine make_engine(void) {
  Engine e = {0};
  const VkApplicationInfo application = {.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_1};
  const VkInstanceCreateInfo instance = {.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
                                         .pApplicationInfo = &application};
  vk(vkCreateInstance(&instance, NULL, &e.instance), "no Vulkan instance");
  uint32_t count = 1;
  if (vkEnumeratePhysicalDevices(e.instance, &count, &e.physical) < 0 || count == 0) fail("no Vulkan device", 0);
  VkQueueFamilyProperties families[16];
  count = 16;
  vkGetPhysicalDeviceQueueFamilyProperties(e.physical, &count, families);
  while (e.family < count && !(families[e.family].queueFlags & VK_QUEUE_COMPUTE_BIT)) ++e.family;
  if (e.family == count) fail("no compute queue", 0);

  const float priority = 1;
  const VkDeviceQueueCreateInfo queue = {.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                         .queueFamilyIndex = e.family,
                                         .queueCount = 1,
                                         .pQueuePriorities = &priority};
  const VkDeviceCreateInfo device = {
      .sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, .queueCreateInfoCount = 1, .pQueueCreateInfos = &queue};
  vk(vkCreateDevice(e.physical, &device, NULL, &e.device), "no device");
  vkGetDeviceQueue(e.device, e.family, 0, &e.queue);
  const VkCommandPoolCreateInfo pool = {.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
                                        .flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT,
                                        .queueFamilyIndex = e.family};
  vk(vkCreateCommandPool(e.device, &pool, NULL, &e.pool), "no command pool");
  const VkCommandBufferAllocateInfo buffers = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
                                               .commandPool = e.pool,
                                               .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
                                               .commandBufferCount = FRAMES_IN_FLIGHT};
  vk(vkAllocateCommandBuffers(e.device, &buffers, e.commands), "no command buffers");
  const VkFenceCreateInfo fence = {.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO, .flags = VK_FENCE_CREATE_SIGNALED_BIT};
  for (int i = 0; i < FRAMES_IN_FLIGHT; ++i) vk(vkCreateFence(e.device, &fence, NULL, &e.done[i]), "no fence");
  return e;
}

/* Memory that the host reads E from. An engine that draws needs none of this. */
typedef struct {
  VkBuffer buffer;
  VkDeviceMemory memory;
  const float* texels;
} Readback;

static Readback make_readback(const Engine* e, VkDeviceSize bytes) {
  Readback r;
  const VkBufferCreateInfo buffer = {
      .sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, .size = bytes, .usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT};
  vk(vkCreateBuffer(e->device, &buffer, NULL, &r.buffer), "no buffer");
  VkMemoryRequirements need;
  vkGetBufferMemoryRequirements(e->device, r.buffer, &need);
  VkPhysicalDeviceMemoryProperties memory;
  vkGetPhysicalDeviceMemoryProperties(e->physical, &memory);
  const VkMemoryPropertyFlags host = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  uint32_t type = 0;
  while (type < memory.memoryTypeCount && (!(need.memoryTypeBits >> type & 1) ||
                                           (memory.memoryTypes[type].propertyFlags & host) != host)) {
    ++type;
  }
  if (type == memory.memoryTypeCount) fail("no memory that the host can read", 0);
  const VkMemoryAllocateInfo allocate = {
      .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, .allocationSize = need.size, .memoryTypeIndex = type};
  vk(vkAllocateMemory(e->device, &allocate, NULL, &r.memory), "out of memory");
  vk(vkBindBufferMemory(e->device, r.buffer, r.memory, 0), "cannot bind memory");
  void* mapped = NULL;
  vk(vkMapMemory(e->device, r.memory, 0, VK_WHOLE_SIZE, 0, &mapped), "cannot map memory");
  r.texels = mapped;
  return r;
}

/* ---- lightloom ---- */

static int read_chunk(void* user, const uint8_t digest[32], uint64_t size, void* out) {
  char path[4096];
  int n = snprintf(path, sizeof path, "%s/chunks/%02x/", (const char*)user, digest[0]);
  for (int i = 1; i < 32 && n < (int)sizeof path; ++i) n += snprintf(path + n, sizeof path - (size_t)n, "%02x", digest[i]);
  FILE* file = fopen(path, "rb");
  const int missing = !file || fread(out, 1, size, file) != size;
  if (file) fclose(file);
  return missing;
}

static lightloom_runtime* make_runtime(const Engine* e, const char* folder) {
  lightloom_vulkan_create_info create = {.struct_size = sizeof create};
  create.message = on_message;
  create.instance = e->instance;
  create.physical_device = e->physical;
  create.device = e->device;
  create.get_instance_proc_addr = vkGetInstanceProcAddr;
  create.queue_family = e->family;
  create.frames_in_flight = FRAMES_IN_FLIGHT;
  create.image_format = VK_FORMAT_R32G32B32A32_SFLOAT;
  lightloom_runtime* runtime = NULL;
  loom(lightloom_vulkan_create(&create, &runtime));

  char path[4096];
  snprintf(path, sizeof path, "%s/manifest", folder);
  static uint8_t manifest[64 << 20];
  FILE* file = fopen(path, "rb");
  if (!file) fail("no manifest in the .loom folder", 0);
  lightloom_asset_info asset = {.struct_size = sizeof asset};
  asset.manifest = manifest;
  asset.manifest_bytes = fread(manifest, 1, sizeof manifest, file);
  fclose(file);
  asset.read_chunk = read_chunk;
  asset.read_user = (void*)folder;
  loom(lightloom_load(runtime, &asset));

  /* The colour of every surface element; a real engine takes it from its materials. */
  lightloom_counts counts = {.struct_size = sizeof counts};
  loom(lightloom_get_counts(runtime, &counts));
  float* grey = malloc(3 * sizeof(float) * counts.surface_elements);
  if (!grey) fail("out of memory", 0);
  for (uint64_t i = 0; i < 3ull * counts.surface_elements; ++i) grey[i] = 0.6f;
  loom(lightloom_set_albedo(runtime, grey, 0, counts.surface_elements));
  free(grey);
  return runtime;
}

/* One frame: lightloom's passes, then whatever uses E. No wait, queue or barrier of lightloom's own is needed. */
static void record(VkCommandBuffer commands, lightloom_runtime* runtime, const float lamp[3],
                   const lightloom_vulkan_outputs* out, VkBuffer target) {
  lightloom_light light = {.type = LIGHTLOOM_LIGHT_POINT, .first_shadow_view = LIGHTLOOM_NO_SHADOW};
  for (int c = 0; c < 3; ++c) light.position[c] = lamp[c], light.intensity[c] = 10;
  lightloom_frame_info frame = {.struct_size = sizeof frame, .direct_source = LIGHTLOOM_DIRECT_LIGHTS};
  frame.lights = &light;
  frame.light_count = 1;
  const VkCommandBufferBeginInfo begin = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
                                          .flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT};
  vk(vkBeginCommandBuffer(commands, &begin), "cannot record");
  loom(lightloom_vulkan_record(runtime, commands, &frame));
  /* Here an engine draws its level, with out->image_view bound as a texture. */
  const VkBufferImageCopy fronts = {.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
                                    .imageExtent = {out->image_width, out->image_height, 1}};
  vkCmdCopyImageToBuffer(commands, out->image, VK_IMAGE_LAYOUT_GENERAL, target, 1, &fronts);
  const VkMemoryBarrier to_host = {.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                                   .srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT,
                                   .dstAccessMask = VK_ACCESS_HOST_READ_BIT};
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &to_host, 0, NULL, 0,
                       NULL);
  vk(vkEndCommandBuffer(commands), "cannot record");
}

static void write_frame(const char* prefix, int frame, const float* texels, uint32_t width, uint32_t height) {
  char path[4096];
  snprintf(path, sizeof path, "%s_%04d.ppm", prefix, frame);
  FILE* file = fopen(path, "wb");
  if (!file) fail("cannot write the picture", 0);
  fprintf(file, "P6\n%u %u\n255\n", width, height);
  double sum = 0, valid = 0;
  for (uint64_t i = 0; i < (uint64_t)width * height; ++i) {
    const float* t = texels + 4 * i; /* E, W/m2; alpha: 1 where it was computed */
    sum += t[3] * (t[0] + t[1] + t[2]) / 3, valid += t[3];
    for (int c = 0; c < 3; ++c) fputc((int)(255 * t[c] / (1 + t[c])), file);
  }
  fclose(file);
  printf("%s: mean E %.4f W/m2 over %.0f texels\n", path, valid > 0 ? sum / valid : 0, valid);
}

int main(int argc, char** argv) {
  if (argc != 10) fail("usage: minimal_engine LEVEL.loom OUT FRAMES x0 y0 z0 x1 y1 z1", argc);
  const int frames = atoi(argv[3]);
  const Engine engine = make_engine();
  lightloom_runtime* runtime = make_runtime(&engine, argv[1]);
  lightloom_vulkan_outputs out = {.struct_size = sizeof out};
  loom(lightloom_vulkan_get_outputs(runtime, &out));
  Readback readback[FRAMES_IN_FLIGHT];
  for (int i = 0; i < FRAMES_IN_FLIGHT; ++i) {
    readback[i] = make_readback(&engine, 16ull * out.image_width * out.image_height);
  }

  for (int frame = 0; frame < frames + FRAMES_IN_FLIGHT; ++frame) {
    const int slot = frame % FRAMES_IN_FLIGHT;
    vk(vkWaitForFences(engine.device, 1, &engine.done[slot], VK_TRUE, UINT64_MAX), "the device stopped");
    if (frame >= FRAMES_IN_FLIGHT) {
      write_frame(argv[2], frame - FRAMES_IN_FLIGHT, readback[slot].texels, out.image_width, out.image_height);
    }
    if (frame >= frames) continue;
    const float t = frames > 1 ? (float)frame / (float)(frames - 1) : 0;
    float lamp[3];
    for (int c = 0; c < 3; ++c) lamp[c] = (1 - t) * strtof(argv[4 + c], NULL) + t * strtof(argv[7 + c], NULL);
    record(engine.commands[slot], runtime, lamp, &out, readback[slot].buffer);
    vk(vkResetFences(engine.device, 1, &engine.done[slot]), "cannot reset");
    const VkSubmitInfo submit = {
        .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO, .commandBufferCount = 1, .pCommandBuffers = &engine.commands[slot]};
    vk(vkQueueSubmit(engine.queue, 1, &submit, engine.done[slot]), "cannot submit");
  }

  lightloom_destroy(runtime);
  for (int i = 0; i < FRAMES_IN_FLIGHT; ++i) {
    vkDestroyBuffer(engine.device, readback[i].buffer, NULL);
    vkFreeMemory(engine.device, readback[i].memory, NULL);
    vkDestroyFence(engine.device, engine.done[i], NULL);
  }
  vkDestroyCommandPool(engine.device, engine.pool, NULL);
  vkDestroyDevice(engine.device, NULL);
  vkDestroyInstance(engine.instance, NULL);
  return 0;
}
