// `lightloom bake` in a process of its own, so that the window stays alive and a bake can be stopped.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

#include "core/base/status.h"

namespace lightloom::view {

/// What a line that the bake prints says of its progress.
struct BakeProgress {
  std::string stage;
  uint64_t done = 0, total = 0;
};
/// False: the line says something else.
bool parse_progress(const std::string& line, BakeProgress* progress);

class ChildBake {
 public:
  ChildBake() = default;
  ~ChildBake();
  ChildBake(const ChildBake&) = delete;
  ChildBake& operator=(const ChildBake&) = delete;

  /// REQUIRES: !running(). `program`: what to run.
  absl::Status start(const std::string& program, const std::string& scene, const std::string& loom);
  bool running() const { return child_ > 0; }
  /// Takes in what it has said; does not wait. True once, when it has ended: see result().
  bool poll();
  /// It stops after what it is at, and is not done.
  void cancel();

  const BakeProgress& progress() const { return progress_; }
  /// Of the bake that ended last. Cancelled: by cancel().
  const absl::Status& result() const { return result_; }

 private:
  void take(const char* bytes, size_t size);

  pid_t child_ = -1;
  int from_ = -1;
  bool cancelled_ = false;
  std::string partial_, last_line_;
  BakeProgress progress_;
  absl::Status result_;
};

}  // namespace lightloom::view
