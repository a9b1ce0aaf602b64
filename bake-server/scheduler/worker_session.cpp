#include "bake-server/scheduler/worker_session.h"

#include <algorithm>

namespace lightloom {

SyncOutcome WorkerSession::sync(const SyncFacts& facts) {
  SyncOutcome out;
  const bool restarted = incarnation_ != 0 && facts.incarnation != incarnation_;
  if (ended_.contains(facts.incarnation) || (!restarted && facts.sequence <= sequence_)) {
    out.stale = true;
    out.replaced = ended_.contains(facts.incarnation);
    return out;
  }
  if (restarted) {
    // What the earlier process ran died with it, unless this one says otherwise.
    for (const auto& [attempt, answer] : attempts_) {
      if (!facts.has.contains(attempt)) out.gone.push_back(attempt);
    }
  } else {
    for (const auto& [attempt, answer] : attempts_) {
      if (facts.has.contains(attempt)) continue;
      (facts.seen >= answer ? out.gone : out.resend).push_back(attempt);
    }
  }
  for (const std::string& attempt : out.gone) attempts_.erase(attempt);
  if (restarted) ended_.insert(incarnation_);
  // After a restart of the coordinator the worker has seen answers that this one never gave: go on above them.
  answers_ = restarted ? 0 : std::max(answers_, facts.seen);
  incarnation_ = facts.incarnation;
  sequence_ = facts.sequence;
  return out;
}

}  // namespace lightloom
