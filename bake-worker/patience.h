// How long a task waits for its server. For .cpp files.
#pragma once

#include <chrono>
#include <functional>
#include <utility>

#include "proto/client.h"

namespace lightloom {

/// A server that restarts, or (`wait_for_room`) has a full disk for a while, should not cost the work of minutes.
inline Patience patience_of_tasks(std::function<bool()> give_up, bool wait_for_room) {
  Patience p;
  p.total = std::chrono::minutes(10);
  p.call = std::chrono::seconds(60);
  p.wait_for_room = wait_for_room;
  p.give_up = std::move(give_up);
  return p;
}

}  // namespace lightloom
