#include "cli/files.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>

#include "core/base/file.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

bool same_file(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::equivalent(a, b, error)) return true;
  const fs::path canonical_a = fs::weakly_canonical(a, error), canonical_b = fs::weakly_canonical(b, error);
  return !error && canonical_a == canonical_b;
}

std::string percent_decoded(const std::string& uri) {
  std::string out;
  for (size_t i = 0; i < uri.size(); ++i) {
    unsigned byte = 0;
    const char* digits = uri.data() + i + 1;
    if (uri[i] == '%' && i + 2 < uri.size() && std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2) {
      out += static_cast<char>(byte);
      i += 2;
    } else {
      out += uri[i];
    }
  }
  return out;
}

/// Buffers and textures beside a .gltf. Whatever cannot be read names nothing: the loader will say why.
std::vector<std::string> linked_files(const std::string& gltf) {
  constexpr uintmax_t kMaxBytes = uintmax_t{256} << 20;
  std::error_code error;
  if (!gltf.ends_with(".gltf") || fs::file_size(gltf, error) > kMaxBytes || error) return {};
  const auto bytes = read_file(gltf);
  if (!bytes.ok()) return {};
  using Json = nlohmann::json;
  std::vector<std::string> files;
  std::string key;
  const auto collect = [&](int, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::key) key = parsed.get<std::string>();
    if (event == Json::parse_event_t::value && key == "uri" && parsed.is_string()) {
      const auto uri = parsed.get<std::string>();
      if (!uri.starts_with("data:")) files.push_back((fs::path(gltf).parent_path() / percent_decoded(uri)).string());
    }
    return event != Json::parse_event_t::value;  // nothing is kept
  };
  [[maybe_unused]] const Json nothing = Json::parse(bytes->begin(), bytes->end(), collect, /*allow_exceptions=*/false);
  return files;
}

absl::Status missing(const std::string& path, const std::string& mend) {
  return absl::NotFoundError("there is no " + path + "; " + mend);
}

}  // namespace

absl::Status check_input(const std::string& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::not_found) return missing(path, "check the path");
  if (error) return absl::UnavailableError("cannot read " + path + ": " + error.message() + "; check the path");
  if (!fs::is_regular_file(status)) {
    return absl::FailedPreconditionError(path + " is not a regular file; give one");
  }
  return absl::OkStatus();
}

absl::Status check_loom(const std::string& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::not_found) return missing(path, "make it with: lightloom bake SCENE -o " + path);
  if (error) return absl::UnavailableError("cannot read " + path + ": " + error.message() + "; check the path");
  if (!fs::is_directory(status)) {
    return absl::FailedPreconditionError(path + " is a file; give the .loom folder that lightloom bake makes");
  }
  if (!fs::exists(fs::path(path) / "manifest", error)) {
    return absl::FailedPreconditionError(path +
                                         " holds no manifest, so it is no baked asset; bake again, or give the "
                                         ".loom folder that lightloom bake makes");
  }
  return absl::OkStatus();
}

OutputCheck::OutputCheck(std::vector<std::string> inputs) : used_(std::move(inputs)) {
  for (size_t i = 0, n = used_.size(); i < n; ++i) {
    for (std::string& linked : linked_files(used_[i])) used_.push_back(std::move(linked));
  }
}

absl::Status OutputCheck::unused(const std::string& option, const std::string& path) {
  for (const std::string& other : used_) {
    if (!other.empty() && same_file(path, other)) {
      return absl::InvalidArgumentError(option + " " + path + " would replace " + other +
                                        ", which this command reads or writes itself; choose another name");
    }
  }
  used_.push_back(path);
  return absl::OkStatus();
}

absl::Status OutputCheck::file(const std::string& option, const std::string& path,
                               std::initializer_list<const char*> suffixes) {
  if (std::none_of(suffixes.begin(), suffixes.end(), [&](const char* s) { return path.ends_with(s); })) {
    std::string list;
    for (const char* s : suffixes) list += (list.empty() ? "" : " or ") + std::string(s);
    return absl::InvalidArgumentError(option + " '" + path + "' must end in " + list);
  }
  LL_RETURN_IF_ERROR(unused(option, path));
  return check_writable(path);
}

absl::Status OutputCheck::loom(const std::string& option, const std::string& path) {
  if (path.empty()) return absl::InvalidArgumentError(option + " is empty; give the name of a folder, like level.loom");
  LL_RETURN_IF_ERROR(unused(option, path));
  const fs::path folder(path);
  std::error_code error;
  if (!fs::exists(folder, error) && !fs::is_symlink(folder, error)) return check_writable(folder);
  if (!fs::is_directory(folder, error)) {
    return absl::FailedPreconditionError(path + " exists and is not a folder; choose another name, or remove it first");
  }
  const bool baked = fs::exists(folder / "manifest", error) || fs::exists(folder / "chunks", error);
  if (!baked && !fs::is_empty(folder, error)) {
    return absl::FailedPreconditionError(path + " holds other files, not a baked asset; choose another name, like " +
                                         (folder / "level.loom").string());
  }
  if (fs::exists(folder / "chunks", error) && !fs::is_directory(folder / "chunks", error)) {
    return absl::FailedPreconditionError((folder / "chunks").string() + " is not a folder; remove it first");
  }
  LL_RETURN_IF_ERROR(check_writable(folder / "manifest"));
  return check_writable(folder / "chunks" / "a chunk");
}

}  // namespace lightloom
