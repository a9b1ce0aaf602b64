/* The public header and library from C99: what a C engine would write. Called by vulkan_test.cpp. */
#include <lightloom.h>
#include <lightloom_vulkan.h>

#include <stddef.h>
#include <string.h>

#if __STDC_VERSION__ != 199901L
#error "compile as C99"
#endif

int c99_program(void);

static int read_nothing(void* user, const uint8_t digest[32], uint64_t size, void* out) {
  (void)user, (void)digest, (void)size, (void)out;
  return 1;
}

/* 0, or the number of the step that did not behave. */
int c99_program(void) {
  lightloom_create_info create;
  lightloom_asset_info asset;
  lightloom_runtime* runtime = NULL;
  const char not_a_manifest[] = "LOON";

  if (lightloom_version() >> 22 != LIGHTLOOM_VERSION_MAJOR) return 1;
  memset(&create, 0, sizeof create);
  create.struct_size = sizeof create;
  if (lightloom_create(&create, &runtime) != LIGHTLOOM_OK) return 2;
  memset(&asset, 0, sizeof asset);
  asset.struct_size = sizeof asset;
  asset.manifest = not_a_manifest;
  asset.manifest_bytes = sizeof not_a_manifest;
  asset.read_chunk = read_nothing;
  if (lightloom_load(runtime, &asset) != LIGHTLOOM_ERROR_CORRUPT_ASSET) return 3;
  if (lightloom_update(runtime, 1) != LIGHTLOOM_ERROR_NO_ASSET) return 4;
  if (strcmp(lightloom_result_string(LIGHTLOOM_OK), "ok") != 0) return 5;
  lightloom_destroy(runtime);
  return 0;
}
