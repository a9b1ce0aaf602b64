// A bake farm, to the commands: plain structs and calls.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/asset/manifest.h"
#include "core/base/parallel.h"
#include "core/base/status.h"

namespace grpc {
class Channel;
}

namespace lightloom {

class ChunkStore;
struct EarlierBake;
struct SpawnedTask;

struct RemoteJob {
  uint64_t id = 0;
  std::string name, client;
  int32_t priority = 0;
  std::string state;  ///< running, done, partial, failed, cancelled
  int64_t created_ms = 0, finished_ms = 0;
  uint64_t tasks = 0, done = 0, running = 0, failed = 0, rays = 0;
  uint64_t reused = 0;  ///< of those done: taken from an earlier job
  double rays_per_second = 0;
  uint32_t workers = 0;
  uint64_t revision = 0;
  std::string error;
  std::vector<Digest> outputs;

  bool ended() const { return state != "running"; }
};

struct RemoteWorker {
  std::string id, version;
  uint32_t threads = 0, running = 0;
  int64_t silent_ms = 0;
  bool draining = false;
};

struct RemoteEvent {
  uint64_t id = 0;
  int64_t at_ms = 0;
  std::string task, worker, what;
};

/// Calls wait for a server that is not there, for as long as `patience`; errors name its address.
class FarmClient {
 public:
  /// `cancel`, if any, ends uploads, and waiting for a server: Cancelled.
  explicit FarmClient(const std::string& server, std::chrono::milliseconds patience = std::chrono::seconds(30),
                      const CancelFlag* cancel = nullptr);
  /// Over a channel that is at hand; `server` names it in errors.
  FarmClient(std::shared_ptr<grpc::Channel> channel, std::string server);
  ~FarmClient();

  /// A job of this payload that begins with `first`, whose input blobs are there. The same request id again is the same job.
  absl::StatusOr<RemoteJob> submit(const std::string& request_id, std::span<const uint8_t> payload,
                                   const SpawnedTask& first, const std::vector<Digest>& inputs, const std::string& name,
                                   int32_t priority);
  /// Uploads the level, unless it is there, and submits its bake. `progress`: bytes of `scene` that are there. Of the
  /// earlier bake, if any, goes up what the farm lacks, since the new asset will name it.
  absl::StatusOr<RemoteJob> submit(std::span<const uint8_t> scene, const BakeParams& params, const EarlierBake* earlier,
                                   const std::string& name, int32_t priority,
                                   const std::function<void(uint64_t)>& progress);
  /// Whether it answers, and bakes as this program does; submit() asks too.
  absl::Status check_server();
  absl::StatusOr<Digest> upload(std::span<const uint8_t> blob);
  absl::StatusOr<RemoteJob> job(uint64_t id);
  absl::StatusOr<std::vector<RemoteJob>> jobs();
  absl::StatusOr<RemoteJob> cancel(uint64_t id);
  absl::StatusOr<RemoteJob> set_priority(uint64_t id, int32_t priority);
  absl::StatusOr<std::vector<RemoteWorker>> workers();
  absl::StatusOr<std::vector<RemoteEvent>> events(uint64_t job);
  /// Calls back with each state until the job ends, and ten times a second with the last one meanwhile. Returns the last
  /// one. Goes on over a server that restarts. Cancelled: the job goes on.
  absl::StatusOr<RemoteJob> watch(uint64_t id, const CancelFlag& cancel,
                                  const std::function<void(const RemoteJob&)>& changed);
  /// Writes a finished job's asset; chunks that are there already are not fetched. FailedPrecondition unless it is done.
  /// `progress`: chunks there, of all.
  absl::StatusOr<Manifest> fetch(uint64_t id, const std::string& loom, const CancelFlag& cancel,
                                 const std::function<void(uint64_t, uint64_t)>& progress);

 private:
  struct Connection;
  absl::Status fetch_chunks(const ChunkStore& store, const std::vector<ChunkRef>& chunks, const CancelFlag& cancel,
                            const std::function<void(uint64_t, uint64_t)>& progress) const;
  absl::Status upload_chunks(const EarlierBake& earlier, std::vector<Digest>* inputs) const;
  absl::Status in_words(const absl::Status& status) const;

  std::string server_;
  std::unique_ptr<Connection> connection_;
};

}  // namespace lightloom
