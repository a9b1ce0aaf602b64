#include "core/scene/gltf_warnings.h"

#include <algorithm>

namespace lightloom {

std::string shown(std::string_view name) {
  constexpr size_t kLongest = 64;
  std::string text(name.substr(0, kLongest));
  if (name.size() > kLongest) {
    while (!text.empty() && (static_cast<unsigned char>(text.back()) & 0xc0) == 0x80) text.pop_back();  // whole UTF-8
    if (!text.empty() && (static_cast<unsigned char>(text.back()) & 0x80)) text.pop_back();
    text += "…";
  }
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 32 || c == 127) c = '?';
  }
  return "\"" + text + "\"";
}

void GltfWarnings::add(std::string_view what, std::string_view name, uint64_t count) {
  constexpr size_t kNamesShown = 5;
  auto kind = std::find_if(kinds_.begin(), kinds_.end(), [&](const Kind& k) { return k.what == what; });
  if (kind == kinds_.end()) kind = kinds_.insert(kinds_.end(), Kind{std::string(what), 0, {}, 0, {}});
  kind->count += count;
  if (kind->elements > 0 && kind->last == name) return;
  kind->last = name;
  ++kind->elements;
  if (kind->names.size() < kNamesShown) kind->names.push_back(shown(name));
}

std::vector<std::string> GltfWarnings::lines() const {
  std::vector<std::string> out;
  for (const Kind& kind : kinds_) {
    std::string line = std::to_string(kind.count) + " " + kind.what + " (in ";
    for (size_t i = 0; i < kind.names.size(); ++i) line += (i ? ", " : "") + kind.names[i];
    if (kind.elements > kind.names.size()) {
      line += " and " + std::to_string(kind.elements - kind.names.size()) + " others";
    }
    out.push_back(line + ")");
  }
  return out;
}

}  // namespace lightloom
