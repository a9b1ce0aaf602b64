// A display without a screen, for programs with windows.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <memory>
#include <string>

#include "tests/support/process.h"

namespace lightloom::test {

/// Xvfb, on a number that no other display has; it ends with the object.
class Display {
 public:
  static constexpr const char* kProgram = "/usr/bin/Xvfb";
  static bool installed() { return ::access(kProgram, X_OK) == 0; }

  Display() : server_({kProgram, "-displayfd", "1", "-screen", "0", "1280x1024x24", "-nolisten", "tcp"}) {
    const std::string number = server_.line([](const std::string& line) {
      return !line.empty() &&
             std::all_of(line.begin(), line.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
    });
    if (!number.empty()) name_ = ":" + number;
  }
  /// For DISPLAY; empty: the server did not start.
  const std::string& name() const { return name_; }

 private:
  Process server_;
  std::string name_;
};

}  // namespace lightloom::test
