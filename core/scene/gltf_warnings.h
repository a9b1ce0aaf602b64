// What was mended in a level, gathered into one line per kind.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace lightloom {

/// A name from a file as messages show it: quoted, at most 64 bytes.
std::string shown(std::string_view name);

class GltfWarnings {
 public:
  /// `what` reads after a count: "triangles without area were left out". `name` is the element it happened
  /// in.
  void add(std::string_view what, std::string_view name, uint64_t count = 1);
  /// In order of first appearance: `3 triangles without area were left out (in "a", "b" and 4 others)`.
  std::vector<std::string> lines() const;

 private:
  struct Kind {
    std::string what;
    uint64_t count = 0;
    std::vector<std::string> names;  // the first few
    uint64_t elements = 0;
    std::string last;
  };
  std::vector<Kind> kinds_;
};

}  // namespace lightloom
