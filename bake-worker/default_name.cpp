#include "bake-worker/default_name.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <random>

#include "proto/worker_name.h"

namespace lightloom {

std::string worker_name(std::string_view host, pid_t pid, uint32_t random) {
  std::string out(host.empty() ? "worker" : host.substr(0, 40));
  std::replace_if(
      out.begin(), out.end(), [](char c) { return !fits_worker_name(c); }, '-');
  char digits[5];
  std::snprintf(digits, sizeof digits, "%04x", random & 0xffffu);
  return out + "-" + std::to_string(pid) + "-" + digits;
}

std::string default_worker_name() {
  char host[256] = "";
  (void)::gethostname(host, sizeof host - 1);
  return worker_name(host, ::getpid(), std::random_device()());
}

}  // namespace lightloom
