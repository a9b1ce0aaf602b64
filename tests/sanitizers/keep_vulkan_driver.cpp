// Linked into ASan builds of Vulkan tests. The loader unloads lavapipe and the validation layer at the end of the test;
// what they leaked (128 bytes in Mesa 22.3; the layer's own tables) would then be reported from an unknown module, which
// no suppression can name. RTLD_NODELETE keeps them mapped. Objects that a test forgets to destroy are still found: the
// layer itself reports those, and tests count its messages.
#include <dlfcn.h>

namespace {
[[maybe_unused]] void* const driver = dlopen("libvulkan_lvp.so", RTLD_NOW | RTLD_NODELETE);
[[maybe_unused]] void* const layer = dlopen("libVkLayer_khronos_validation.so", RTLD_NOW | RTLD_NODELETE);
}  // namespace
