// CHECK for bugs of ours. Never for input from outside: that gets an absl::Status.
#pragma once

#include <cstdio>
#include <cstdlib>

#define LL_CHECK(condition)                                                              \
  do {                                                                                   \
    if (!(condition)) {                                                                  \
      std::fprintf(stderr, "%s:%d: check failed: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                      \
    }                                                                                    \
  } while (0)
