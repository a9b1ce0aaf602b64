// What a machine that loses power forgets. The files of one folder, as this process changes them: what was not synced since
// is undone, names (open, mkdir, rename, link, unlink) until their folder is synced, contents until the file is.
// Environment:
//   POWER_LOSS_FOLDER     the folder; it is there, and holds no link, and no folder that is renamed or removed
//   UNDONE_FILE_CHANGES   a file that gets a line with the number of changes that a power loss undid
//
// A disk may keep more than that, in any order. This one keeps as little as it may.
#pragma once

#include <sys/types.h>

#include <cstddef>

namespace power_loss {

/// Held around each change, so that a loss meets none halfway. What the holder's own thread calls meanwhile is no change.
class Turn {
 public:
  Turn();
  ~Turn();
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;
  /// Whether an outer one of this thread is at work.
  bool is_inner() const { return !outer_; }

 private:
  bool outer_;
};

// All of these within a Turn, the first four right before what they speak of. Other files do not matter.
void before_name_changes(const char* path);
/// `at`: -1: where the descriptor stands.
void before_write(int fd, off_t at, size_t size);
void before_truncate(int fd, off_t size);
/// A call that no book is kept of: ends the program if it is about that file.
void refuse(const char* call, const char* path);
void refuse(const char* call, int fd);
void after_create(int fd);
void after_sync(int fd);
/// Nobody knows when what is written through a map reaches the disk: a loss takes the file.
void after_map(int fd);

/// Whether old contents must be readable where a program only writes.
bool is_followed(const char* path);

[[noreturn]] void strike();

}  // namespace power_loss
