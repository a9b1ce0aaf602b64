// The streaming functions of lightloom.h: a streamer, and the thread that drives it.
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <memory>
#include <thread>

#include "runtime/boundary.h"
#include "runtime/streaming/streamer.h"

namespace lightloom {
namespace {

/// Runs a streamer until it is destroyed; wake() when something may be new to it.
class StreamThread {
 public:
  explicit StreamThread(Streamer* streamer) : streamer_(streamer), thread_([this] { run(); }) {}
  ~StreamThread() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    woken_.notify_all();
    thread_.join();
  }
  void wake() {
    {
      const std::lock_guard lock(mutex_);
      awake_ = true;
    }
    woken_.notify_all();
  }

 private:
  void run() {
    for (;;) {
      {
        std::unique_lock lock(mutex_);
        woken_.wait(lock, [this] { return stop_ || awake_; });
        if (stop_) return;
        awake_ = false;
      }
      while (step()) {
      }
    }
  }
  bool step() {
    {
      const std::lock_guard lock(mutex_);
      if (stop_) return false;
    }
    try {
      return streamer_->step() == Streamer::Progress::kStep;
    } catch (...) {
      return false;  // no memory; the next view tries again
    }
  }

  Streamer* const streamer_;
  std::mutex mutex_;
  std::condition_variable woken_;
  bool stop_ = false, awake_ = true;
  std::thread thread_;
};

}  // namespace
}  // namespace lightloom

struct lightloom_stream {
  lightloom::Messages messages;
  std::unique_ptr<lightloom::Streamer> streamer;
  std::unique_ptr<lightloom::StreamThread> thread;  ///< after the streamer, so that it ends first
};

namespace lightloom {
namespace {

absl::Status check_info(const lightloom_stream_info* info) {
  if (info == nullptr || info->struct_size < sizeof *info || info->read_chunk == nullptr ||
      (info->flags & ~uint32_t{LIGHTLOOM_STREAM_NO_THREAD}) != 0) {
    return absl::InvalidArgumentError(
        "lightloom_stream_info is null, its struct_size or a flag is wrong, or read_chunk is missing");
  }
  return absl::OkStatus();
}

bool finite(const float* values, size_t count) {
  return std::all_of(values, values + count, [](float v) { return std::isfinite(v); });
}

Vec3 vec(const float v[3]) { return {v[0], v[1], v[2]}; }

}  // namespace
}  // namespace lightloom

using lightloom::guarded;

extern "C" {

lightloom_result lightloom_stream_create(lightloom_runtime* runtime, const lightloom_stream_info* info,
                                         lightloom_stream** out) {
  if (out == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  *out = nullptr;
  return lightloom::with_asset(runtime, [&](lightloom::Backend& backend) -> absl::Status {
    LL_RETURN_IF_ERROR(lightloom::check_info(info));
    const lightloom_counts counts = backend.counts();
    if (counts.resident_cells + counts.resident_probes > 0) {
      return absl::InvalidArgumentError(
          "a stream loads all itself: load the manifest anew, or unload what is resident");
    }
    auto stream = std::make_unique<lightloom_stream>();
    stream->messages = runtime->messages;
    lightloom::StreamOptions options;
    if (info->byte_budget != 0) options.budget = info->byte_budget;
    if (info->queue_bytes != 0) options.queue_bytes = info->queue_bytes;
    options.report = [messages = runtime->messages](const absl::Status& status) {
      messages.send(LIGHTLOOM_MESSAGE_ERROR, std::string(status.message()));
    };
    const auto read = [read_chunk = info->read_chunk, user = info->read_user](
                          const lightloom::ChunkRef& ref, std::span<uint8_t> bytes) -> absl::Status {
      if (read_chunk(user, ref.digest.bytes.data(), ref.size, bytes.data()) == 0) return absl::OkStatus();
      return lightloom::unreadable_chunk(ref);
    };
    stream->streamer = std::make_unique<lightloom::Streamer>(&backend, read, std::move(options));
    if ((info->flags & LIGHTLOOM_STREAM_NO_THREAD) == 0) {
      stream->thread = std::make_unique<lightloom::StreamThread>(stream->streamer.get());
    }
    *out = stream.release();
    return absl::OkStatus();
  });
}

void lightloom_stream_destroy(lightloom_stream* stream) { delete stream; }

lightloom_result lightloom_stream_set_view(lightloom_stream* stream, const lightloom_stream_view* view) {
  if (stream == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  return guarded(stream->messages, [&]() -> absl::Status {
    if (view == nullptr || view->struct_size < sizeof *view || view->reserved != 0 ||
        !lightloom::finite(view->position, 3) || !lightloom::finite(view->velocity, 3)) {
      return absl::InvalidArgumentError("lightloom_stream_view is null, its struct_size is wrong or it is not finite");
    }
    stream->streamer->set_view({lightloom::vec(view->position), lightloom::vec(view->velocity)});
    if (stream->thread != nullptr) stream->thread->wake();
    return absl::OkStatus();
  });
}

lightloom_result lightloom_stream_pin(lightloom_stream* stream, const float* lo, const float* hi, uint32_t count) {
  if (stream == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  return guarded(stream->messages, [&]() -> absl::Status {
    if (count > 0 && (lo == nullptr || hi == nullptr || !lightloom::finite(lo, size_t{3} * count) ||
                      !lightloom::finite(hi, size_t{3} * count))) {
      return absl::InvalidArgumentError("the boxes are null or not finite");
    }
    std::vector<lightloom::Aabb> boxes;
    for (size_t b = 0; b < count; ++b) boxes.push_back({lightloom::vec(lo + 3 * b), lightloom::vec(hi + 3 * b)});
    stream->streamer->pin(std::move(boxes));
    if (stream->thread != nullptr) stream->thread->wake();
    return absl::OkStatus();
  });
}

lightloom_result lightloom_stream_work(lightloom_stream* stream, uint64_t bytes, uint32_t* more) {
  if (stream == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  return guarded(stream->messages, [&]() -> absl::Status {
    if (stream->thread != nullptr)
      return absl::InvalidArgumentError("the stream has a thread; create it with NO_THREAD");
    using Progress = lightloom::Streamer::Progress;
    const uint64_t begin = stream->streamer->state().read_bytes;
    Progress progress = Progress::kStep;
    while (progress == Progress::kStep && stream->streamer->state().read_bytes - begin < bytes) {
      progress = stream->streamer->step();
    }
    if (more != nullptr) *more = progress == Progress::kDone ? 0 : 1;
    return absl::OkStatus();
  });
}

lightloom_result lightloom_stream_get_state(lightloom_stream* stream, lightloom_stream_state* state) {
  if (stream == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  return guarded(stream->messages, [&] {
    const lightloom::StreamState s = stream->streamer->state();
    lightloom_stream_state out{};
    out.done = s.done ? 1 : 0;
    out.base_cells = s.base_cells;
    out.some_cells = s.some_cells;
    out.all_cells = s.all_cells;
    out.base_probes = s.base_probes;
    out.all_probes = s.all_probes;
    out.failing = s.failing;
    out.bytes = s.bytes;
    out.read_bytes = s.read_bytes;
    out.read_chunks = s.read_chunks;
    out.drops = s.drops;
    return lightloom::fill(out, state);
  });
}

lightloom_result lightloom_stream_get_levels(lightloom_stream* stream, uint8_t* levels, uint32_t cells) {
  if (stream == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  return guarded(stream->messages, [&]() -> absl::Status {
    const std::vector<lightloom::CellLevel> all = stream->streamer->cell_levels();
    if (cells != all.size() || (levels == nullptr && cells > 0)) {
      return absl::InvalidArgumentError("the array is null or has another length than the cells");
    }
    std::transform(all.begin(), all.end(), levels, [](auto level) { return static_cast<uint8_t>(level); });
    return absl::OkStatus();
  });
}

}  // extern "C"
