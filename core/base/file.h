// Whole-file reads and atomic writes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/status.h"

namespace lightloom {

/// Reads a regular file whole. Errors name the path and the system's reason.
absl::StatusOr<std::vector<uint8_t>> read_file(const std::filesystem::path& path);

/// Writes `path` so that it holds all of `data` or what it held before: temporary beside it, fsync, rename, fsync of
/// the folder. Parent folders are created.
absl::Status write_file_atomic(const std::filesystem::path& path, std::span<const uint8_t> data);
absl::Status write_file_atomic(const std::filesystem::path& path, std::string_view text);

/// A temporary name beside `path`, unique to this process and call: for libraries that write files by themselves.
std::filesystem::path temporary_beside(const std::filesystem::path& path);
/// fsync(temporary), rename to `path`, fsync the folder. Removes `temporary` on failure.
absl::Status commit_file(const std::filesystem::path& temporary, const std::filesystem::path& path);

}  // namespace lightloom
