#include "cli/eval/method.h"

#include <sys/resource.h>

#include <string>

namespace lightloom::eval {

const std::vector<std::unique_ptr<Method>>& all_methods() {
  static const auto* methods = [] {
    auto* all = new std::vector<std::unique_ptr<Method>>;
    all->push_back(loom_method(BakeMethod::kDefault));
    all->push_back(tuned_method());
    all->push_back(loom_method(BakeMethod::kSl17));
    all->push_back(sh_method());
    all->push_back(ddgi_method());
    all->push_back(static_lightmap_method());
    return all;
  }();
  return *methods;
}

std::string plain(double number) {
  std::string text = std::to_string(number);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

std::string times(double factor) { return "×" + plain(factor); }

double processor_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace lightloom::eval
