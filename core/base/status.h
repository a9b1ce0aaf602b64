// Errors cross module boundaries as absl::Status / absl::StatusOr. A message is one line: what, where, how to mend.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <utility>

#define LL_RETURN_IF_ERROR(expression)                                               \
  do {                                                                               \
    if (absl::Status ll_status_ = (expression); !ll_status_.ok()) return ll_status_; \
  } while (0)

#define LL_CONCAT_INNER(a, b) a##b
#define LL_CONCAT(a, b) LL_CONCAT_INNER(a, b)
/// LL_ASSIGN_OR_RETURN(auto x, f()): x = f()'s value, or returns its error.
#define LL_ASSIGN_OR_RETURN(lhs, expression) LL_ASSIGN_IMPL(LL_CONCAT(ll_or_, __LINE__), lhs, expression)
#define LL_ASSIGN_IMPL(temporary, lhs, expression) \
  auto temporary = (expression);                   \
  if (!temporary.ok()) return temporary.status();  \
  lhs = std::move(*temporary)
