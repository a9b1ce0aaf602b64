/* lightloom's runtime: plays a baked .loom asset on a Vulkan device. C99.
 *
 * The caller says how much light arrives straight from the lamps at every surface element (texel) of the
 * level, and what colour the surfaces have; the runtime answers with the indirect irradiance E of every
 * surface element. Lights, albedo, emission and sky may change at any time; nothing is baked again. How the
 * pieces fit: docs/runtime.md.
 *
 * Surface elements 0..S-1: the objects in the manifest's order, and within each the keys of its surface
 * chunk, ascending. Every per-element array is S x 3 floats, linear RGB, element after element.
 *
 * Calls on one runtime must not overlap; different runtimes are independent. No function throws or aborts on
 * bad input: each says what went wrong by its result and one line to the message callback, and leaves the
 * runtime as it was unless it says otherwise.
 */
#ifndef LIGHTLOOM_H
#define LIGHTLOOM_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define LIGHTLOOM_VERSION_MAJOR 0
#define LIGHTLOOM_VERSION_MINOR 1
#define LIGHTLOOM_VERSION_PATCH 0

/* Values are stable: new ones are only added. */
typedef enum lightloom_result {
  LIGHTLOOM_OK = 0,
  LIGHTLOOM_ERROR_INVALID_ARGUMENT = -1,  /* null pointer, wrong count, a number that is not finite or out of range */
  LIGHTLOOM_ERROR_NO_DEVICE = -2,         /* no Vulkan loader, driver or device with a compute queue */
  LIGHTLOOM_ERROR_MISSING_FEATURE = -3,   /* the device, or an installed layer, lacks something that is needed */
  LIGHTLOOM_ERROR_OUT_OF_MEMORY = -4,     /* host or device */
  LIGHTLOOM_ERROR_CORRUPT_ASSET = -5,     /* bytes that no baker wrote, or chunks that contradict each other */
  LIGHTLOOM_ERROR_UNSUPPORTED_ASSET = -6, /* a newer version, or too large for this device */
  LIGHTLOOM_ERROR_READ_FAILED = -7,       /* read_chunk returned non-zero */
  LIGHTLOOM_ERROR_NO_ASSET = -8,          /* nothing is loaded */
  LIGHTLOOM_ERROR_DEVICE_LOST = -9,       /* only lightloom_destroy is of use now */
  LIGHTLOOM_ERROR_INTERNAL = -10          /* a bug of ours */
} lightloom_result;

/* Never null; English, static. */
const char* lightloom_result_string(lightloom_result result);

/* major << 22 | minor << 12 | patch, of the library that is linked. */
uint32_t lightloom_version(void);

typedef struct lightloom_runtime lightloom_runtime;

typedef enum lightloom_message_kind {
  LIGHTLOOM_MESSAGE_ERROR = 0,     /* why a function returned an error */
  LIGHTLOOM_MESSAGE_VALIDATION = 1 /* from the validation layers; a bug of ours */
} lightloom_message_kind;

/* `text` is one line without newline, valid during the call. Called from within a lightloom function, on its
 * thread. */
typedef void (*lightloom_message_fn)(void* user, lightloom_message_kind kind, const char* text);

enum {
  /* Core and synchronization validation; needs the Khronos validation layer. Slow. */
  LIGHTLOOM_CREATE_VALIDATION = 1u << 0,
  /* Copies through staging buffers, and flushes, even where the device's memory could be written directly:
   * what happens on most discrete GPUs. For tests. */
  LIGHTLOOM_CREATE_FORCE_STAGING = 1u << 1
};

/* Zero all, then set struct_size to sizeof. Fields are only ever added at the end. */
typedef struct lightloom_create_info {
  uint32_t struct_size;
  uint32_t flags;               /* LIGHTLOOM_CREATE_* */
  lightloom_message_fn message; /* may be null */
  void* message_user;
  uint64_t page_bytes;     /* largest asset buffer; 0: 64 MiB. Small values are for tests. */
  uint32_t max_workgroups; /* per dispatch dimension; 0: what the device allows. For tests. */
  uint32_t reserved;       /* 0 */
} lightloom_create_info;

/* Makes a runtime with a Vulkan instance, device and compute queue of its own: a discrete GPU before an
 * integrated one before a software one. *out is null on failure. */
lightloom_result lightloom_create(const lightloom_create_info* info, lightloom_runtime** out);

/* Frees everything, the asset too. Null is fine. */
void lightloom_destroy(lightloom_runtime* runtime);

/* Writes the `size` bytes of the chunk named `digest` to `out`; returns 0, or anything else if it cannot.
 * Must not call lightloom. A loader from a folder opens chunks/ab/cdef... with the digest in hex. */
typedef int (*lightloom_read_chunk_fn)(void* user, const uint8_t digest[32], uint64_t size, void* out);

typedef struct lightloom_asset_info {
  uint32_t struct_size;
  uint32_t reserved; /* 0 */
  const void* manifest;
  uint64_t manifest_bytes;
  lightloom_read_chunk_fn read_chunk;
  void* read_user;
} lightloom_asset_info;

/* Reads every chunk, checks its SHA-256, structure and agreement with the manifest, and uploads it. Replaces
 * the asset that was loaded before; on failure no asset is loaded. All inputs and E start at 0. */
lightloom_result lightloom_load(lightloom_runtime* runtime, const lightloom_asset_info* info);
void lightloom_unload(lightloom_runtime* runtime);

typedef struct lightloom_counts {
  uint32_t struct_size;      /* in: sizeof; the fields that fit are filled */
  uint32_t surface_elements; /* S */
  uint32_t receivers;        /* surface elements whose E is baked; E stays 0 at the others */
  uint32_t probes;
  uint32_t cells;
  uint32_t clusters;
  uint32_t pages; /* GPU buffers that hold cells */
  uint32_t sh_order;
  uint64_t gpu_bytes; /* allocated on the device for this asset */
} lightloom_counts;

lightloom_result lightloom_get_counts(const lightloom_runtime* runtime, lightloom_counts* counts);

/* `elements` must be S. Values must be finite, albedo within [0, 1]. The runtime copies the array. */

/* Irradiance that arrives straight from punctual lights, W/m2 (cosine and shadows included; no pi divided
 * out). */
lightloom_result lightloom_set_direct(lightloom_runtime* runtime, const float* rgb, uint64_t elements);
/* Diffuse reflectance. */
lightloom_result lightloom_set_albedo(lightloom_runtime* runtime, const float* rgb, uint64_t elements);
/* Radiance that the surface emits, W/(m2 sr). */
lightloom_result lightloom_set_emission(lightloom_runtime* runtime, const float* rgb, uint64_t elements);
/* Radiance of the sky, the same in all directions, W/(m2 sr). */
lightloom_result lightloom_set_environment(lightloom_runtime* runtime, const float rgb[3]);

/* Runs `iterations` frames and waits for them. Each adds a bounce: it lights the surfaces with the direct
 * light, the emission and the E of the frame before, and computes a new E. */
lightloom_result lightloom_update(lightloom_runtime* runtime, uint32_t iterations);

/* E per surface element: indirect irradiance (pi times the reflected radiance of a white diffuse surface),
 * W/m2. */
lightloom_result lightloom_read_irradiance(lightloom_runtime* runtime, float* rgb, uint64_t elements);

/* E = 0: the next frame starts from the first bounce. */
lightloom_result lightloom_reset_feedback(lightloom_runtime* runtime);

/* Of the last lightloom_update that returned OK; GPU time stamps, milliseconds, summed over its frames. */
typedef struct lightloom_stats {
  uint32_t struct_size; /* in: sizeof; the fields that fit are filled */
  uint32_t frames;
  uint32_t timestamps; /* 0: the queue has none and all times are 0 */
  uint32_t reserved;
  double radiosity_ms;    /* light leaving every surface element */
  double relight_ms;      /* radiance at every probe */
  double project_ms;      /* coefficients of every cluster */
  double receive_ms;      /* E of every receiver */
  uint64_t relight_bytes; /* asset bytes that the pass reads each frame */
  uint64_t project_bytes;
  uint64_t receive_bytes;
} lightloom_stats;

lightloom_result lightloom_get_stats(const lightloom_runtime* runtime, lightloom_stats* stats);

#ifdef __cplusplus
}
#endif

#endif /* LIGHTLOOM_H */
