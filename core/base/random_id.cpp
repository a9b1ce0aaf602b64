#include "core/base/random_id.h"

#include <cstdio>
#include <random>

namespace lightloom {

std::string random_id() {
  std::random_device random;
  char text[33];
  std::snprintf(text, sizeof text, "%08x%08x%08x%08x", random(), random(), random(), random());
  return text;
}

}  // namespace lightloom
