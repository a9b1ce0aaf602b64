#include "bake-worker/memory_limits.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace lightloom {
namespace fs = std::filesystem;
namespace {

std::optional<uint64_t> number_in(const fs::path& file) {
  uint64_t value = 0;
  if (std::ifstream in(file); in >> value) return value;  // "max" is no number
  return std::nullopt;
}

bool has(const fs::path& file) {
  std::error_code ignored;
  return fs::exists(file, ignored);
}

}  // namespace

MemoryGroup::MemoryGroup(const fs::path& proc, const fs::path& mount) {
  // Lines "ID:CONTROLLERS:PATH"; version 2 has ID 0 and no controllers.
  std::ifstream in(proc);
  std::string v1, v2;
  for (std::string line; std::getline(in, line);) {
    const size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    std::string path = line.substr(std::min(second + 2, line.size()));
    if (controllers == ",,") v2 = std::move(path);
    if (controllers.find(",memory,") != std::string::npos) v1 = std::move(path);
  }
  // In a container the path may be the host's, while the group itself is mounted.
  for (const fs::path& folder : {mount / v2, mount}) {
    if (has(folder / "memory.events")) {
      mount_ = mount, folder_ = folder, v2_ = true;
      return;
    }
  }
  for (const fs::path& folder : {mount / "memory" / v1, mount / "memory"}) {
    if (has(folder / "memory.oom_control")) {
      mount_ = mount / "memory", folder_ = folder;
      return;
    }
  }
}

uint64_t MemoryGroup::kills() const {
  std::ifstream in(folder_ / (v2_ ? "memory.events" : "memory.oom_control"));
  std::string key;
  for (uint64_t value = 0; in >> key >> value;) {
    if (key == "oom_kill") return value;
  }
  return 0;
}

std::optional<uint64_t> MemoryGroup::limit() const {
  if (folder_.empty()) return std::nullopt;
  std::optional<uint64_t> least;
  for (fs::path folder = folder_;; folder = folder.parent_path()) {
    const auto own = number_in(folder / (v2_ ? "memory.max" : "memory.limit_in_bytes"));
    if (own) least = std::min(least.value_or(*own), *own);
    if (folder == mount_ || folder == folder.parent_path()) return least;
  }
}

uint64_t usable_memory() {
  const uint64_t machine =
      static_cast<uint64_t>(::sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(::sysconf(_SC_PAGE_SIZE));
  return std::min(machine, MemoryGroup().limit().value_or(machine));
}

}  // namespace lightloom
