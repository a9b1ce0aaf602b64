// Fuzzed bytes as a file, for functions that take paths.
#pragma once

#include <stdlib.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>

namespace lightloom::fuzz {

/// In a folder of this process, overwritten by the next input.
inline std::filesystem::path input_file(std::span<const uint8_t> bytes, const std::string& name) {
  static const std::filesystem::path folder = [] {
    std::string pattern = (std::filesystem::temp_directory_path() / "lightloom-fuzz-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) std::abort();
    static std::string made = pattern;
    std::atexit([] { std::filesystem::remove_all(made); });
    return std::filesystem::path(made);
  }();
  const std::filesystem::path path = folder / name;
  std::ofstream(path, std::ios::binary | std::ios::trunc)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return path;
}

/// What must hold of an error: one line that says something.
inline void check_message(const std::string& message) {
  if (!message.empty() && message.find('\n') == message.npos) return;
  std::fprintf(stderr, "bad error message: '%s'\n", message.c_str());
  std::abort();
}

}  // namespace lightloom::fuzz
