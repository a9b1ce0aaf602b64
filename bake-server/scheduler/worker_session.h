// One worker's conversation with the coordinator: which of its Syncs count, and what it has. Pure.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace lightloom {

/// What a Sync says, as far as it matters here.
struct SyncFacts {
  uint64_t incarnation = 0;
  uint64_t sequence = 0;
  uint64_t seen = 0;          ///< highest answer that has arrived
  std::set<std::string> has;  ///< attempts that it runs, or reports as finished, failed or released
};

/// What follows from it.
struct SyncOutcome {
  bool stale = false;               ///< an old message that arrived late: say nothing, do nothing
  bool replaced = false;            ///< stale, and from a process that another one of that name has followed
  std::vector<std::string> gone;    ///< attempts that the worker cannot have any more: hand them back
  std::vector<std::string> resend;  ///< assignments whose answer may have been lost
};

/// An assignment is in the worker's hands once it says so; it may not have arrived while the worker has not seen the answer
/// that carried it. Only what it does not have although it saw that answer is gone.
class WorkerSession {
 public:
  SyncOutcome sync(const SyncFacts& facts);
  /// The number of the answer to the last Sync.
  uint64_t answer() { return ++answers_; }
  /// That answer number `answer` carries the attempt.
  void assigned(const std::string& attempt, uint64_t answer) { attempts_[attempt] = answer; }
  /// It is no longer this worker's.
  void forget(const std::string& attempt) { attempts_.erase(attempt); }

 private:
  uint64_t incarnation_ = 0, sequence_ = 0, answers_ = 0;
  std::set<uint64_t> ended_;                  // incarnations of which late messages may still come
  std::map<std::string, uint64_t> attempts_;  // and the answer that last carried each
};

}  // namespace lightloom
