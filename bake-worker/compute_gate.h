// Keeps every core busy while tasks wait for the network: more tasks are begun than may compute.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace lightloom {

/// Lets so many threads compute at once. Thread-safe.
class ComputeGate {
 public:
  explicit ComputeGate(uint32_t slots) : slots_(slots) {}

  /// Holds a slot while it lives.
  class Slot {
   public:
    explicit Slot(ComputeGate* gate) : gate_(*gate) { gate_.enter(false); }
    ~Slot() { gate_.leave(); }
    Slot(const Slot&) = delete;
    Slot& operator=(const Slot&) = delete;

   private:
    ComputeGate& gate_;
  };

  /// Gives the calling thread's slot away while it lives. Who comes back goes before who is new: it is nearer to its end.
  class Pause {
   public:
    explicit Pause(ComputeGate* gate) : gate_(*gate) { gate_.leave(); }
    ~Pause() { gate_.enter(true); }
    Pause(const Pause&) = delete;
    Pause& operator=(const Pause&) = delete;

   private:
    ComputeGate& gate_;
  };

 private:
  void enter(bool comes_back) {
    std::unique_lock lock(mutex_);
    if (comes_back) ++coming_back_;
    free_.wait(lock, [&] { return slots_ > 0 && (comes_back || coming_back_ == 0); });
    if (comes_back) --coming_back_;
    --slots_;
    if (slots_ > 0) free_.notify_all();
  }
  void leave() {
    const std::lock_guard lock(mutex_);
    ++slots_;
    free_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable free_;
  uint32_t slots_, coming_back_ = 0;
};

}  // namespace lightloom
