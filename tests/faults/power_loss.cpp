#include "tests/faults/power_loss.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace power_loss {
namespace {

namespace fs = std::filesystem;
using FileId = std::pair<dev_t, ino_t>;

/// Undoes one write or truncation.
struct OldPart {
  off_t at = 0;
  std::string bytes;
  off_t size = 0;  // of the whole file
};

/// What the disk has, where it is not what the process sees.
struct Book {
  std::mutex mutex;
  const fs::path folder = fs::weakly_canonical(std::getenv("POWER_LOSS_FOLDER"));
  /// Keeps files alive that a loss would bring back: a link each.
  const fs::path attic = folder.string() + ".attic-" + std::to_string(::getpid());
  long kept = 0;
  std::map<fs::path, fs::path> names;  // changed ones: what each leads to on disk, in the attic; empty: to nothing
  std::map<FileId, std::vector<OldPart>> contents;  // oldest first
  std::set<FileId> mapped;

  Book() { fs::create_directory(attic); }
  bool has(const fs::path& path) const { return path.native().starts_with(folder.native() + "/") || path == folder; }
};

/// Made when first used, never destroyed: others open files before this library's globals are there, and after.
Book& book() {
  static Book& all = *new Book;
  return all;
}

thread_local bool at_work = false;

fs::path path_of(const char* name) {
  // As servers mostly say it. (No links lead about in the folder.)
  if (std::string_view(name).starts_with(book().folder.native() + "/")) return name;
  // The last part may be a link itself.
  const fs::path path = fs::absolute(name);
  std::error_code error;
  return fs::weakly_canonical(path.parent_path(), error) / path.filename();
}

fs::path path_of(int fd) {
  std::error_code error;
  return fs::read_symlink("/proc/self/fd/" + std::to_string(fd), error);
}

FileId id_of(const struct stat& s) { return {s.st_dev, s.st_ino}; }

/// Whether it is a regular file of the folder.
bool is_followed(int fd, struct stat* s) {
  return ::fstat(fd, s) == 0 && S_ISREG(s->st_mode) && book().has(path_of(fd));
}

[[noreturn]] void give_up(const std::string& why) {
  std::fprintf(stderr, "power_loss: %s\n", why.c_str());
  std::abort();
}

void keep_old(int fd, off_t at, size_t size) {
  struct stat s {};
  if (!is_followed(fd, &s)) return;
  OldPart old{at, {}, s.st_size};
  old.bytes.resize(static_cast<size_t>(std::clamp<off_t>(s.st_size - at, 0, static_cast<off_t>(size))));
  const ssize_t n = ::pread(fd, old.bytes.data(), old.bytes.size(), at);
  if (n != static_cast<ssize_t>(old.bytes.size()))
    give_up("cannot read what is overwritten in " + path_of(fd).string());
  book().contents[id_of(s)].push_back(std::move(old));
}

/// Returns how many changes these were.
size_t undo_contents(const fs::path& file) {
  struct stat s {};
  if (::lstat(file.c_str(), &s) != 0 || !S_ISREG(s.st_mode)) return 0;
  // Other threads still use what is mapped: it must not shrink.
  if (book().mapped.contains(id_of(s))) return 0;
  const auto all = book().contents.extract(id_of(s));
  if (all.empty()) return 0;
  const int fd = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
  for (auto old = all.mapped().rbegin(); old != all.mapped().rend(); ++old) {
    const ssize_t n = ::pwrite(fd, old->bytes.data(), old->bytes.size(), old->at);
    if (n != static_cast<ssize_t>(old->bytes.size()) || ::ftruncate(fd, old->size) != 0) {
      give_up("cannot undo a write to " + file.string());
    }
  }
  ::close(fd);
  return all.mapped().size();
}

size_t undo_contents_in(const fs::path& folder) {
  size_t undone = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) undone += undo_contents(entry.path());
  return undone;
}

/// Whether it had changed.
bool undo_name(const fs::path& path, const fs::path& old) {
  std::error_code error;
  if (old.empty()) return fs::remove_all(path, error) > 0;
  if (fs::equivalent(path, old, error)) return false;
  fs::remove(path, error);
  // Where its folder itself is gone, so is it.
  return ::link(old.c_str(), path.c_str()) == 0;
}

void remove_mapped() {
  std::vector<fs::path> lost;
  for (const auto& entry : fs::recursive_directory_iterator(book().folder)) {
    struct stat s {};
    if (::lstat(entry.path().c_str(), &s) == 0 && book().mapped.contains(id_of(s))) lost.push_back(entry.path());
  }
  for (const fs::path& path : lost) fs::remove(path);
}

struct AtEnd {
  ~AtEnd() {
    if (std::getenv("POWER_LOSS_FOLDER") == nullptr) return;
    const Turn turn;
    std::error_code error;
    fs::remove_all(book().attic, error);
  }
} at_end;

}  // namespace

Turn::Turn() : outer_(!at_work) {
  if (!outer_) return;
  at_work = true;
  book().mutex.lock();
}

Turn::~Turn() {
  if (!outer_) return;
  book().mutex.unlock();
  at_work = false;
}

bool is_followed(const char* path) { return book().has(path_of(path)); }

void before_name_changes(const char* name) {
  Book& all = book();
  const fs::path path = path_of(name);
  if (!all.has(path) || path == all.folder || all.names.contains(path)) return;
  struct stat s {};
  fs::path& old = all.names[path];
  if (::lstat(path.c_str(), &s) != 0) return;
  if (!S_ISREG(s.st_mode)) give_up(path.string() + " is no file: no book is kept of its name");
  old = all.attic / std::to_string(all.kept++);
  if (::link(path.c_str(), old.c_str()) != 0) give_up("cannot link " + path.string());
}

void before_write(int fd, off_t at, size_t size) {
  struct stat s {};
  if (at < 0 && ::fstat(fd, &s) == 0) {
    at = (::fcntl(fd, F_GETFL) & O_APPEND) != 0 ? s.st_size : ::lseek(fd, 0, SEEK_CUR);
  }
  keep_old(fd, at, size);
}

void before_truncate(int fd, off_t size) {
  struct stat s {};
  if (::fstat(fd, &s) == 0) keep_old(fd, size, static_cast<size_t>(std::max<off_t>(s.st_size - size, 0)));
}

void refuse(const char* call, const char* path) {
  if (is_followed(path)) give_up(std::string(call) + " of " + path + ": no book is kept of that");
}

void refuse(const char* call, int fd) {
  struct stat s {};
  if (is_followed(fd, &s)) give_up(std::string(call) + " of " + path_of(fd).string() + ": no book is kept of that");
}

/// Its number may have been that of a file that is gone.
void after_create(int fd) {
  struct stat s {};
  if (::fstat(fd, &s) != 0) return;
  book().contents.erase(id_of(s));
  book().mapped.erase(id_of(s));
}

void after_sync(int fd) {
  Book& all = book();
  struct stat s {};
  if (::fstat(fd, &s) != 0) return;
  all.contents.erase(id_of(s));
  if (!S_ISDIR(s.st_mode)) return;
  const fs::path folder = path_of(fd);
  std::erase_if(all.names, [&folder](const auto& name) {
    if (name.first.parent_path() != folder) return false;
    if (!name.second.empty()) fs::remove(name.second);
    return true;
  });
}

void after_map(int fd) {
  struct stat s {};
  if (is_followed(fd, &s)) book().mapped.insert(id_of(s));
}

void strike() {
  Book& all = book();
  size_t undone = undo_contents_in(all.folder) + undo_contents_in(all.attic);
  for (const auto& [path, old] : all.names) undone += undo_name(path, old);
  remove_mapped();
  fs::remove_all(all.attic);
  if (const char* const path = std::getenv("UNDONE_FILE_CHANGES")) {
    if (std::FILE* const file = std::fopen(path, "a")) {
      std::fprintf(file, "%zu\n", undone);
      std::fclose(file);
    }
  }
  ::kill(::getpid(), SIGKILL);
  for (;;) ::pause();
}

}  // namespace power_loss
