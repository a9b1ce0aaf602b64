// Benchmarks end with one line where tests would fail.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>

#include "core/base/status.h"

namespace lightloom::bench {

inline void or_exit(const absl::Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "%s\n", std::string(status.message()).c_str());
  std::exit(1);
}

template <class T>
T or_exit(absl::StatusOr<T> value) {
  or_exit(value.status());
  return *std::move(value);
}

}  // namespace lightloom::bench
