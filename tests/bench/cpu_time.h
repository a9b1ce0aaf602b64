// Of the calling thread: others on the machine must not count.
#pragma once

#include <time.h>

namespace lightloom::bench {

inline double cpu_milliseconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

}  // namespace lightloom::bench
