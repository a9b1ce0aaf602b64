// Whole-file reads and atomic writes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/status.h"

namespace lightloom {

/// What a change that was reported as made outlives.
enum class Durability {
  kPowerLoss,  ///< the end of the machine too: changes wait for the disk
  kProcess,    ///< the end of the process, however it comes
};

/// Reads a regular file whole; anything else, pipes too, is an error at once. Errors name the path and the system's
/// reason.
absl::StatusOr<std::vector<uint8_t>> read_file(const std::filesystem::path& path);

/// Writes `path` so that it holds all of `data` or what it held before: temporary beside it, fsync, rename, fsync of
/// the folder. Parent folders are created. Only regular files are replaced: a folder, a device, a pipe or a symbolic link
/// there (who made it may have meant another file) is an error.
absl::Status write_file_atomic(const std::filesystem::path& path, std::span<const uint8_t> data);
absl::Status write_file_atomic(const std::filesystem::path& path, std::string_view text);

/// Makes a folder, and those above it, so that they outlive a power loss; also where it is there already, as who made it may
/// not have come so far.
absl::Status make_durable_folder(const std::filesystem::path& folder);

/// Whether write_file_atomic would replace what is at `path`, if anything.
absl::Status check_replaceable(const std::filesystem::path& path);
/// Also tries to make a file in its folder, or the nearest one above that exists. Leaves nothing behind.
absl::Status check_writable(const std::filesystem::path& path);

/// A temporary name beside `path`, unique to this process and call: for libraries that write files by themselves.
std::filesystem::path temporary_beside(const std::filesystem::path& path);
/// fsync(temporary), rename to `path`, fsync the folder. Refuses what write_file_atomic refuses. Removes `temporary` on
/// failure.
absl::Status commit_file(const std::filesystem::path& temporary, const std::filesystem::path& path);

}  // namespace lightloom
