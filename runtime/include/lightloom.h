/* lightloom's runtime: relights a baked .loom asset while the game runs. C99, without Vulkan; what an engine
 * adds to use its own device is in lightloom_vulkan.h. How the pieces fit: docs/runtime.md.
 *
 * The engine says how much light arrives straight from the lamps at every surface element (texel) of the
 * level, and what colour the surfaces have; the runtime answers with the indirect irradiance E of every
 * surface element. Lights, albedo, emission and sky may change at any time; nothing is baked again.
 *
 * Surface elements 0..S-1: the objects in the manifest's order, and within each the keys of its surface chunk,
 * ascending. The manifest alone fixes S. Per-element arrays are S x 3 floats, linear RGB, element after element.
 *
 * Threads: lightloom_load_chunk, lightloom_unload_chunk, lightloom_set_*, lightloom_get_* and one recording
 * thread may run at once on one runtime. destroy, load, load_manifest, reload_manifest, unload must be alone on it, with all
 * recorded frames finished; create, update and read_irradiance count as recording.
 * Different runtimes are independent.
 *
 * No function throws or aborts on bad input: each says what went wrong by its result and one line to the message
 * callback, and leaves the runtime as it was unless it says otherwise.
 */
#ifndef LIGHTLOOM_H
#define LIGHTLOOM_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define LIGHTLOOM_API __attribute__((visibility("default")))
#else
#define LIGHTLOOM_API
#endif

#define LIGHTLOOM_VERSION_MAJOR 0
#define LIGHTLOOM_VERSION_MINOR 2
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
  LIGHTLOOM_ERROR_NO_ASSET = -8,          /* no manifest is loaded */
  LIGHTLOOM_ERROR_DEVICE_LOST = -9,       /* only lightloom_destroy is of use now */
  LIGHTLOOM_ERROR_INTERNAL = -10,         /* a bug of ours */
  LIGHTLOOM_ERROR_OVER_BUDGET = -11,      /* byte_budget would be exceeded */
  LIGHTLOOM_ERROR_UNKNOWN_CHUNK = -12,    /* the manifest does not name that digest */
  LIGHTLOOM_ERROR_NOT_READY = -13         /* something else must be loaded first */
} lightloom_result;

/* Never null; English, static. */
LIGHTLOOM_API const char* lightloom_result_string(lightloom_result result);

/* major << 22 | minor << 12 | patch, of the library that is linked. */
LIGHTLOOM_API uint32_t lightloom_version(void);

typedef struct lightloom_runtime lightloom_runtime;

typedef enum lightloom_message_kind {
  LIGHTLOOM_MESSAGE_ERROR = 0,     /* why a function returned an error */
  LIGHTLOOM_MESSAGE_VALIDATION = 1 /* from the validation layers; a bug of ours */
} lightloom_message_kind;

/* `text` is one line without newline, valid during the call. Called from within a lightloom function, on its
 * thread: from several at once if the runtime is used by several. */
typedef void (*lightloom_message_fn)(void* user, lightloom_message_kind kind, const char* text);

/* Where the runtime's host memory comes from; both null: malloc. Called from every thread that calls lightloom.
 * allocate returns null when it has none. What decoding a chunk needs for the length of a call comes from the
 * heap in any case. */
typedef struct lightloom_allocator {
  void* user;
  void* (*allocate)(void* user, size_t size, size_t alignment);
  void (*release)(void* user, void* memory, size_t size, size_t alignment);
} lightloom_allocator;

/* ---- A runtime on its own: tools, servers, tests, machines without a device ------------------------------------------- */

enum {
  LIGHTLOOM_CREATE_VALIDATION = 1u << 0,   /* core and synchronization validation; needs the Khronos layer. Slow. */
  LIGHTLOOM_CREATE_GPU_ASSISTED = 1u << 1, /* with VALIDATION: shaders' accesses are checked too. Very slow. */
  LIGHTLOOM_CREATE_SMOOTHING = 1u << 2,    /* makes room for smoothing and fade < 1 (lightloom_update_options) */
  LIGHTLOOM_CREATE_CPU = 1u << 3 /* no device: the processor's vector units; only SMOOTHING may stand beside it */
};

/* Zero all, then set struct_size to sizeof. Fields are only ever added at the end. */
typedef struct lightloom_create_info {
  uint32_t struct_size;
  uint32_t flags;               /* LIGHTLOOM_CREATE_* */
  lightloom_message_fn message; /* may be null */
  void* message_user;
  lightloom_allocator allocator;
  uint64_t byte_budget;    /* of the asset, device memory or host memory with CPU; 0: no limit */
  uint64_t page_bytes;     /* largest asset buffer; 0: 64 MiB. Small values are for tests. */
  uint64_t staging_bytes;  /* of the upload buffer of one frame; 0: 8 MiB */
  uint32_t workgroup_size; /* 8, 16, 32 or 64 invocations; 0: what suits the device */
  uint32_t max_workgroups; /* per dispatch dimension; 0: what the device allows. For tests. */
  uint32_t threads;        /* with CPU; 0: one per hardware thread */
  uint32_t reserved;       /* 0 */
} lightloom_create_info;

/* Makes a runtime with a Vulkan instance, device and compute queue of its own: a discrete GPU before an
 * integrated one before a software one; or, with LIGHTLOOM_CREATE_CPU, one without a device, which gives the same
 * numbers. *out is null on failure. */
LIGHTLOOM_API lightloom_result lightloom_create(const lightloom_create_info* info, lightloom_runtime** out);

/* Frees everything, the asset too. No recorded command buffer may be in use any more. Null is fine. */
LIGHTLOOM_API void lightloom_destroy(lightloom_runtime* runtime);

/* ---- Assets ---------------------------------------------------------------------------------------------- */

/* Starts an asset: replaces the one that was loaded, on failure none is. All inputs and E start at 0; no chunk is
 * resident. */
LIGHTLOOM_API lightloom_result lightloom_load_manifest(lightloom_runtime* runtime, const void* manifest,
                                                       uint64_t bytes);

/* The level was baked anew: as lightloom_load_manifest, but elements of objects that stay keep direct, albedo, emission
 * and E, under their new numbers; the sky stays. Of an object some of whose texels are others now, elements keep those of
 * about the same place: set albedo and emission of all. So the level goes on as it was lit until
 * its chunks are there, and those of new objects start dark. Streams must be destroyed before. A manifest that is
 * not valid changes nothing; on another failure no asset is loaded. */
LIGHTLOOM_API lightloom_result lightloom_reload_manifest(lightloom_runtime* runtime, const void* manifest,
                                                         uint64_t bytes);

/* Makes a chunk of the manifest resident; the bytes are copied, their SHA-256, structure and agreement with the
 * manifest are checked. An object's surface chunk comes before the cell and relight chunks that name the object
 * (NOT_READY). A cell takes part once the relight chunks of all its probes are resident too; until then, and after
 * it is unloaded, its E stays what it was. Uploads are part of the frames recorded next. A chunk that is resident
 * already is no error. On OVER_BUDGET nothing has changed; NOT_READY also says that all memory for it is in use by
 * frames in flight. */
LIGHTLOOM_API lightloom_result lightloom_load_chunk(lightloom_runtime* runtime, const uint8_t digest[32],
                                                    const void* bytes, uint64_t size);

/* How much of a chunk is kept. Less of it takes less memory and time, and gives a coarser light that has its energy. */
typedef struct lightloom_detail {
  uint32_t struct_size;
  uint32_t flags;    /* LIGHTLOOM_DETAIL_* */
  uint32_t max_rank; /* cells: coefficients per cluster at most, besides the uniform one */
  uint32_t bands;    /* cells: of the probes' spherical harmonics, at most; 0: all */
} lightloom_detail;

enum {
  LIGHTLOOM_DETAIL_COARSE_RAYS = 1u << 0, /* relight sets: about 256 of their rays */
  LIGHTLOOM_DETAIL_BASE = 1u << 1         /* stays resident beneath other details, which must be loaded later */
};

/* As lightloom_load_chunk. If the chunk is resident in another detail, that one lights the level until the frame which
 * has all of the new one (both take memory until then), and E goes to its new values by `fade`. */
LIGHTLOOM_API lightloom_result lightloom_load_chunk_part(lightloom_runtime* runtime, const uint8_t digest[32],
                                                         const void* bytes, uint64_t size,
                                                         const lightloom_detail* detail);
/* Back to the base of the chunk, which needs no upload. Without a base nothing changes. */
LIGHTLOOM_API lightloom_result lightloom_drop_detail(lightloom_runtime* runtime, const uint8_t digest[32]);

/* Its memory is used again once frames_in_flight more frames are recorded. Without its surface chunk an object
 * gets no light from the direct pass; cells and probes that name it go on. A chunk that is not resident is no
 * error. */
LIGHTLOOM_API lightloom_result lightloom_unload_chunk(lightloom_runtime* runtime, const uint8_t digest[32]);

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

/* The manifest and every chunk of it. On failure no asset is loaded. */
LIGHTLOOM_API lightloom_result lightloom_load(lightloom_runtime* runtime, const lightloom_asset_info* info);
LIGHTLOOM_API void lightloom_unload(lightloom_runtime* runtime);

typedef struct lightloom_counts {
  uint32_t struct_size;      /* in: sizeof; the fields that fit are filled */
  uint32_t surface_elements; /* S */
  uint32_t receivers;        /* of all cells of the manifest; E stays 0 at the other surface elements */
  uint32_t probes;
  uint32_t cells;
  uint32_t clusters;
  uint32_t sh_order;
  uint32_t image_width, image_height; /* of the lightmap image */
  uint32_t resident_surfaces, resident_probes, resident_cells;
  uint32_t active_cells;  /* resident with all their probes */
  uint32_t pages;         /* device buffers that hold cells */
  uint64_t pending_bytes; /* not yet part of a recorded frame */
  uint64_t gpu_bytes;     /* device memory (CPU: host memory) that the asset takes, staging excluded */
  uint64_t byte_budget;   /* 0: no limit */
} lightloom_counts;

LIGHTLOOM_API lightloom_result lightloom_get_counts(lightloom_runtime* runtime, lightloom_counts* counts);

/* ---- Streaming ------------------------------------------------------------------------------------------- */

/* Keeps resident what the camera needs most. First a coarse base of every cell and probe, near ones first: nothing is
 * black, and the light that bounces keeps its energy. Then details, by how much is seen of them per byte, from where the
 * camera is and where it will be; what is worth least is dropped for it. Use it in place of lightloom_load_chunk. */
typedef struct lightloom_stream lightloom_stream;

enum {
  LIGHTLOOM_STREAM_NO_THREAD = 1u << 0 /* no thread of ours: call lightloom_stream_work on one of yours */
};

typedef struct lightloom_stream_info {
  uint32_t struct_size;
  uint32_t flags;                     /* LIGHTLOOM_STREAM_* */
  lightloom_read_chunk_fn read_chunk; /* called on the streaming thread; a chunk that cannot be read is tried again */
  void* read_user;
  uint64_t byte_budget; /* device memory of cells and relight sets, about; 0: none but the runtime's own */
  uint64_t queue_bytes; /* nothing is read while more than this waits to be uploaded; 0: 8 MiB */
} lightloom_stream_info;

/* A manifest must be loaded, with no cell or relight set resident; destroy the stream before the manifest is replaced and
 * before the runtime. *out is null on failure. */
LIGHTLOOM_API lightloom_result lightloom_stream_create(lightloom_runtime* runtime, const lightloom_stream_info* info,
                                                       lightloom_stream** out);
/* Waits for a read that is going on. What is resident stays. Null is fine. */
LIGHTLOOM_API void lightloom_stream_destroy(lightloom_stream* stream);

typedef struct lightloom_stream_view {
  uint32_t struct_size;
  uint32_t reserved; /* 0 */
  float position[3]; /* of the camera, metres */
  float velocity[3]; /* m/s */
} lightloom_stream_view;

/* Each frame, from any thread: where the camera is. It costs next to nothing; the work is done elsewhere. */
LIGHTLOOM_API lightloom_result lightloom_stream_set_view(lightloom_stream* stream, const lightloom_stream_view* view);

/* Cells that touch one of `count` boxes are kept in full detail before all others; lo and hi: 3 floats of each. Replaces
 * the boxes of before. */
LIGHTLOOM_API lightloom_result lightloom_stream_pin(lightloom_stream* stream, const float* lo, const float* hi,
                                                    uint32_t count);

/* With NO_THREAD: does a piece of work, reading about `bytes`. *more is 0 if nothing is left until the next view; may be
 * null. One thread at a time. */
LIGHTLOOM_API lightloom_result lightloom_stream_work(lightloom_stream* stream, uint64_t bytes, uint32_t* more);

typedef struct lightloom_stream_state {
  uint32_t struct_size;                       /* in: sizeof; the fields that fit are filled */
  uint32_t done;                              /* 1: all that the view needs and the budget holds is there, or failing */
  uint32_t base_cells, some_cells, all_cells; /* resident at exactly that level */
  uint32_t base_probes, all_probes;
  uint32_t failing;                        /* chunks that could not be read or had no room, and are tried again later */
  uint64_t bytes;                          /* that cells and relight sets take, about */
  uint64_t read_bytes, read_chunks, drops; /* so far */
} lightloom_stream_state;

LIGHTLOOM_API lightloom_result lightloom_stream_get_state(lightloom_stream* stream, lightloom_stream_state* state);

/* For display: per cell of the manifest 0 (nothing), 1 (base), 2 (some columns) or 3 (all). */
LIGHTLOOM_API lightloom_result lightloom_stream_get_levels(lightloom_stream* stream, uint8_t* levels, uint32_t cells);

/* ---- What the surfaces are like -------------------------------------------------------------------------- */

/* Elements [first, first + count) take the values rgb[0..3*count). Values must be finite, albedo within [0, 1]. The
 * runtime copies the array; it is part of the frames recorded next. */

/* Irradiance that arrives straight from punctual lights, W/m2 (cosine and shadows included; no pi divided
 * out). */
LIGHTLOOM_API lightloom_result lightloom_set_direct(lightloom_runtime* runtime, const float* rgb, uint64_t first,
                                                    uint64_t count);
/* Diffuse reflectance; above LIGHTLOOM_MAX_ALBEDO it is taken as that, so that infinite bounces stay finite. */
LIGHTLOOM_API lightloom_result lightloom_set_albedo(lightloom_runtime* runtime, const float* rgb, uint64_t first,
                                                    uint64_t count);
#define LIGHTLOOM_MAX_ALBEDO 0.99f
/* Radiance that the surface emits, W/(m2 sr). */
LIGHTLOOM_API lightloom_result lightloom_set_emission(lightloom_runtime* runtime, const float* rgb, uint64_t first,
                                                      uint64_t count);
/* Radiance of the sky, the same in all directions, W/(m2 sr). */
LIGHTLOOM_API lightloom_result lightloom_set_environment(lightloom_runtime* runtime, const float rgb[3]);

/* For the runtime's own direct light pass (lightloom_vulkan.h). Units as KHR_lights_punctual, radiometric: W/sr for
 * point and spot lights, W/m2 for directional ones. */
typedef enum lightloom_light_type {
  LIGHTLOOM_LIGHT_POINT = 0,
  LIGHTLOOM_LIGHT_SPOT = 1,
  LIGHTLOOM_LIGHT_DIRECTIONAL = 2
} lightloom_light_type;

#define LIGHTLOOM_NO_SHADOW 0xffffffffu

typedef struct lightloom_light {
  uint32_t type;              /* lightloom_light_type */
  uint32_t first_shadow_view; /* into the shadow views: point 6 (+X -X +Y -Y +Z -Z), others 1; or NO_SHADOW */
  float position[3];          /* point, spot; metres */
  float range;                /* metres; 0: unlimited */
  float direction[3];         /* spot, directional: unit, the way the light travels */
  float inner_cone;           /* radians from the axis */
  float intensity[3];         /* colour times intensity, linear RGB */
  float outer_cone;
} lightloom_light;

/* How a world position is found in the depth image of a light. */
typedef struct lightloom_shadow_view {
  float view_projection[16]; /* column major, world to Vulkan clip space, z 0 (near) .. 1 */
  uint32_t layer;            /* of the array of depth images */
  uint32_t reserved[3];      /* 0 */
} lightloom_shadow_view;

/* ---- Frames ---------------------------------------------------------------------------------------------- */

/* How much one frame may do. All zero (but struct_size): everything that changed, at once. */
typedef struct lightloom_update_options {
  uint32_t struct_size;
  uint32_t max_probes; /* that are relit in a frame, in turn; 0: all that saw a change */
  uint32_t
      max_cells; /* whose E is computed in a frame, in turn; 0: all with a relit probe or a near field that changed */
  float epsilon; /* relative change of a surface element's radiance that counts; below 2^-19 none does */
  float epsilon_floor;   /* radiance below which a change is compared with epsilon * epsilon_floor instead */
  float smoothing;       /* E goes this share of the way to its new value each frame, (0, 1]; 0 means 1: at once */
  uint64_t upload_bytes; /* that a frame copies at most; 0: what the staging buffer holds */
  float fade;            /* as smoothing, but only for what a chunk in another detail changes; 0 means 1: at once */
  uint32_t reserved;     /* 0 */
} lightloom_update_options;

/* For the frames recorded from now on. */
LIGHTLOOM_API lightloom_result lightloom_set_update_options(lightloom_runtime* runtime,
                                                            const lightloom_update_options* options);

/* E = 0: the next frame starts from the first bounce. */
LIGHTLOOM_API lightloom_result lightloom_reset_feedback(lightloom_runtime* runtime);

/* Runs `frames` frames and waits for them; all pending uploads are done first. Each frame adds a bounce: it lights
 * the surfaces with the direct light, the emission and the E of the frame before, and computes a new E. Only on
 * runtimes of lightloom_create, which have a queue; else INVALID_ARGUMENT. */
LIGHTLOOM_API lightloom_result lightloom_update(lightloom_runtime* runtime, uint32_t frames);

/* E per surface element: indirect irradiance (pi times the reflected radiance of a white diffuse surface),
 * W/m2. Waits. `elements` must be S. As lightloom_update. */
LIGHTLOOM_API lightloom_result lightloom_read_irradiance(lightloom_runtime* runtime, float* rgb, uint64_t elements);

/* Of the frames since the asset was loaded that the GPU is known to have finished: those that were recorded
 * frames_in_flight or more frames ago, or all after lightloom_update. */
typedef struct lightloom_stats {
  uint32_t struct_size; /* in: sizeof; the fields that fit are filled */
  uint32_t timestamps;  /* 0: the queue has none and all times are 0 */
  uint64_t frames;
  /* GPU time stamps (CPU: a clock), milliseconds, summed over the frames: take differences. */
  double upload_ms;    /* copies of inputs and chunks */
  double direct_ms;    /* our own direct light pass */
  double radiosity_ms; /* light leaving every surface element */
  double select_ms;    /* which probes and cells are to be updated */
  double relight_ms;   /* radiance at the probes */
  double project_ms;   /* coefficients of the clusters */
  double receive_ms;   /* E of the receivers, and smoothing */
  double image_ms;     /* the lightmap image */
  /* Of the last finished frame. */
  uint32_t changed_tiles; /* groups of surface elements whose radiance changed */
  uint32_t updated_probes, updated_cells;
  uint32_t waiting_probes, waiting_cells; /* that saw a change but are not updated yet */
  uint32_t skipped;                       /* 1: nothing had changed, no pass ran */
  /* Asset bytes that the passes of the last finished frame read. */
  uint64_t relight_bytes, project_bytes, receive_bytes;
  uint64_t upload_bytes; /* of chunks that the last recorded frame copies */
} lightloom_stats;

LIGHTLOOM_API lightloom_result lightloom_get_stats(lightloom_runtime* runtime, lightloom_stats* stats);

#ifdef __cplusplus
}
#endif

#endif /* LIGHTLOOM_H */
