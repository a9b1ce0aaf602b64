#include "core/scene/builtin.h"

#include <array>

#include "core/scene/builtin_builder.h"

namespace lightloom {
namespace {

struct Entry {
  const char* name;
  Scene (*make)();
};
constexpr std::array<Entry, 5> kEntries{{{"cornell", make_cornell},
                                         {"flat", make_flat},
                                         {"maze", make_maze},
                                         {"town", make_town},
                                         {"gallery", make_gallery}}};

}  // namespace

const std::vector<std::string>& builtin_scene_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out;
    for (const Entry& e : kEntries) out.push_back(e.name);
    return out;
  }();
  return names;
}

absl::StatusOr<Scene> builtin_scene(std::string_view name) {
  std::string known;
  for (const Entry& e : kEntries) {
    if (name == e.name) return e.make();
    known += (known.empty() ? "" : ", ") + std::string(e.name);
  }
  return absl::NotFoundError("there is no built-in scene \"" + std::string(name) + "\"; choose from " + known);
}

}  // namespace lightloom
