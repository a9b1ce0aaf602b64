// What a worker is called if nobody names it.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace lightloom {

/// HOST-PID-HHHH by the rule of proto/worker_name.h: what does not fit in a host's name becomes '-', and what is too
/// long is cut. HHHH: the low 16 bits of `random`, since containers may share host name and process id.
std::string worker_name(std::string_view host, pid_t pid, uint32_t random);

/// That of this process on this machine; another one with each call.
std::string default_worker_name();

}  // namespace lightloom
