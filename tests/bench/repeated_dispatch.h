// Vulkan's functions, but the passes of the runtime that are dispatched indirectly may be dispatched several times in a
// frame: what one of them costs is the difference to a frame that dispatches it once, by any clock.
#pragma once

#include "runtime/include/lightloom_vulkan.h"

namespace lightloom::bench {

enum class RepeatedPass { kNone, kRelight, kProject, kReceive };

/// From the next recorded frame on, `pass` is dispatched `more` times more. The passes only read what others write, so that
/// the numbers stay.
void repeat_pass(RepeatedPass pass, uint32_t more);

/// Lets lightloom_vulkan_create see the repeating functions. One device at a time.
void repeat_dispatches(const lightloom_vulkan_device& device, lightloom_vulkan_create_info* info);

}  // namespace lightloom::bench
