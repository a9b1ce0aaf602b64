// What memory this process may use, and whether the kernel has killed for lack of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace lightloom {

/// The control group of this process, version 2 or 1.
class MemoryGroup {
 public:
  /// Where /proc/self/cgroup and /sys/fs/cgroup are.
  explicit MemoryGroup(const std::filesystem::path& proc = "/proc/self/cgroup",
                       const std::filesystem::path& mount = "/sys/fs/cgroup");

  /// Processes of the group that were killed for lack of memory since it was made. 0 if there is no group.
  uint64_t kills() const;
  /// Bytes that the group may use: the least of its own limit and those of the groups around it.
  std::optional<uint64_t> limit() const;

 private:
  std::filesystem::path mount_, folder_;
  bool v2_ = false;
};

/// Bytes: the machine's memory, or what the control group allows of it.
uint64_t usable_memory();

}  // namespace lightloom
