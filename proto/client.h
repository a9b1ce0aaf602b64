// What clients and workers share to talk to lightloom-server: channels, deadlines, retries, blobs.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/hash.h"
#include "core/base/status.h"

namespace grpc {
class Channel;
class ClientContext;
class Status;
}  // namespace grpc

namespace lightloom {

/// A connection to the server at `address` (HOST:PORT), made when first used. Not encrypted; ignores HTTP proxies.
std::shared_ptr<grpc::Channel> dial(const std::string& address);

/// The same code and message; nothing but one line of printable text comes through from the other side.
absl::Status from_grpc(const grpc::Status& status);

/// How long a call is repeated while the server cannot be reached: gRPC's own retries are not made for that.
struct Patience {
  std::chrono::milliseconds total{30'000};
  std::chrono::milliseconds call{10'000};  ///< deadline of one try
  std::function<bool()> give_up;           ///< null: never earlier
  bool wait_for_room = false;              ///< the other side's full disk, too, is worth another try
};

/// Calls until it succeeds, fails for a reason that another try cannot mend, or patience ends. REQUIRES: repeating it is
/// harmless.
absl::Status call_with_retries(const Patience& patience, const std::function<grpc::Status(grpc::ClientContext*)>& call);

/// Blobs on the server. Thread-safe.
class BlobClient {
 public:
  explicit BlobClient(std::shared_ptr<grpc::Channel> channel, Patience patience = {})
      : channel_(std::move(channel)), patience_(std::move(patience)) {}

  /// Sends the blob if the server lacks it; an upload that was cut goes on. `progress`: bytes that are there.
  absl::StatusOr<Digest> upload(std::span<const uint8_t> bytes,
                                const std::function<void(uint64_t)>& progress = nullptr) const;
  /// Sends all of these: in one call, if none is large.
  absl::Status upload(const std::vector<std::vector<uint8_t>>& blobs) const;
  /// Those that the server lacks. What it has is kept for a while after.
  absl::StatusOr<std::vector<Digest>> find_missing(std::span<const Digest> digests) const;
  /// The blob, its digest checked. NotFound.
  absl::StatusOr<std::vector<uint8_t>> download(const Digest& digest) const;

 private:
  bool upload_together(const std::vector<std::vector<uint8_t>>& blobs) const;

  std::shared_ptr<grpc::Channel> channel_;
  Patience patience_;
};

}  // namespace lightloom
