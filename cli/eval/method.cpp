#include "cli/eval/method.h"

#include <sys/resource.h>

namespace lightloom::eval {

const std::vector<std::unique_ptr<Method>>& all_methods() {
  static const auto* methods = [] {
    auto* all = new std::vector<std::unique_ptr<Method>>;
    all->push_back(loom_method(BakeMethod::kDefault));
    all->push_back(tuned_method());
    all->push_back(loom_method(BakeMethod::kSl17));
    all->push_back(static_lightmap_method());
    return all;
  }();
  return *methods;
}

double processor_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace lightloom::eval
