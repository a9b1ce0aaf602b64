#include "core/base/version.h"

namespace lightloom {

constinit const std::string_view kVersion = LIGHTLOOM_VERSION;

}  // namespace lightloom
