// Linked into ASan builds of Vulkan tests. The loader unloads lavapipe at the end of the test; what it leaked
// (128 bytes, Mesa 22.3) would then be reported from an unknown module, which no suppression can name.
// RTLD_NODELETE keeps it mapped.
#include <dlfcn.h>

namespace {
[[maybe_unused]] void* const kept = dlopen("libvulkan_lvp.so", RTLD_NOW | RTLD_NODELETE);
}
