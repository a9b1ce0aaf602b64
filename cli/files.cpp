#include "cli/files.h"

#include <absl/strings/str_cat.h>
#include <sys/stat.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>

#include "core/base/file.h"
#include "core/scene/gltf_container.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

std::string canonical(const std::string& path) {
  std::error_code error;
  return fs::weakly_canonical(path, error).string();
}

/// Of the file that is there now.
std::optional<std::pair<uint64_t, uint64_t>> inode(const std::string& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return std::nullopt;
  return std::pair<uint64_t, uint64_t>(info.st_dev, info.st_ino);
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

absl::Status missing(const std::string& path, const std::string& mend) {
  return absl::NotFoundError("there is no " + path + "; " + mend);
}

}  // namespace

std::vector<std::string> linked_files(const std::string& gltf) {
  constexpr uintmax_t kMaxBytes = uintmax_t{256} << 20;
  std::error_code error;
  if (!(gltf.ends_with(".gltf") || gltf.ends_with(".glb")) || fs::file_size(gltf, error) > kMaxBytes || error)
    return {};
  const auto bytes = read_file(gltf);
  const auto parts = bytes.ok() ? gltf_parts(*bytes) : bytes.status();
  if (!parts.ok()) return {};
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
  [[maybe_unused]] const Json nothing = Json::parse(parts->json, collect, /*allow_exceptions=*/false);
  return files;
}

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

OutputCheck::OutputCheck(const std::vector<std::string>& inputs) {
  for (const std::string& input : inputs) {
    if (input.empty()) continue;
    use(input);
    for (const std::string& linked : linked_files(input)) use(linked);
  }
}

void OutputCheck::use(const std::string& path) {
  by_name_.emplace(canonical(path), path);
  if (const auto file = inode(path)) by_inode_.emplace(*file, path);
}

absl::Status OutputCheck::unused(const std::string& option, const std::string& path) {
  const auto file = inode(path);
  const auto same_file = file ? by_inode_.find(*file) : by_inode_.end();
  const auto same_name = by_name_.find(canonical(path));
  if (same_file == by_inode_.end() && same_name == by_name_.end()) {
    use(path);
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(option, " ", path, " would replace ",
                                                 same_file != by_inode_.end() ? same_file->second : same_name->second,
                                                 ", which this command reads or writes itself; choose another name"));
}

absl::Status OutputCheck::file(const std::string& option, const std::string& path,
                               std::initializer_list<const char*> suffixes) {
  if (std::none_of(suffixes.begin(), suffixes.end(), [&](const char* s) { return path.ends_with(s); })) {
    std::string list;
    for (const char* s : suffixes) list.append(list.empty() ? "" : " or ").append(s);
    return absl::InvalidArgumentError(option + " '" + path + "' must end in " + list);
  }
  LL_RETURN_IF_ERROR(unused(option, path));
  // One file shows that the folder takes new ones: a sequence has thousands.
  const bool first = folders_.insert(fs::path(path).parent_path().string()).second;
  return first ? check_writable(path) : check_replaceable(path);
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
