// Names every function of the C API, so that the linker takes it out of the static library into liblightloom.so.
#include "runtime/include/lightloom_vulkan.h"

namespace lightloom {

extern const void* const kApi[];
const void* const kApi[] = {
#define LL_FUNCTION(name) reinterpret_cast<const void*>(&name)
    LL_FUNCTION(lightloom_create),
    LL_FUNCTION(lightloom_result_string),
    LL_FUNCTION(lightloom_stream_create),
    LL_FUNCTION(lightloom_vulkan_check),
    LL_FUNCTION(lightloom_vulkan_make_device),
#undef LL_FUNCTION
};

}  // namespace lightloom
