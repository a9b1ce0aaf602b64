#include "bake-server/grpc/blob_service.h"

#include <spdlog/spdlog.h>

#include <optional>

#include "bake-server/grpc/translate.h"
#include "proto/blob_service.grpc.pb.h"

namespace lightloom {
namespace {

constexpr uint64_t kPiece = uint64_t{1} << 20;
constexpr int kMostDigests = 8192;

/// NotFound, and so nobody asks for it once more.
absl::Status damaged(const Digest& digest) {
  return absl::NotFoundError("blob " + digest.hex() +
                             " was damaged on the server's disk and is set aside; submit the job again: what is "
                             "missing is baked anew");
}

/// Takes blobs piece by piece; what arrived before a cut is kept.
class Writing final : public grpc::ServerReadReactor<v1::WriteRequest> {
 public:
  Writing(BlobStore* store, v1::WriteResponse* response) : store_(store), response_(response) {
    const auto lock = hand_over_.hold();
    StartRead(&piece_);
  }

  void OnReadDone(bool ok) override {
    const auto lock = hand_over_.hold();
    if (!ok) {
      if (!status_) status_ = absl::InvalidArgumentError("a blob must begin with its name");
      Finish(to_grpc(*status_));
      return;
    }
    if (const absl::Status status = take(); !status.ok()) {
      Finish(to_grpc(status));
      return;
    }
    StartRead(&piece_);
  }
  void OnDone() override {
    hand_over_.hold().unlock();
    delete this;
  }

 private:
  absl::Status take() {
    if (piece_.data().size() > kPiece) return absl::InvalidArgumentError("a piece of a blob must be at most 1 MiB");
    if (!piece_.digest().empty()) {
      if (status_ && !status_->ok())
        return absl::InvalidArgumentError("a blob must not begin before the last one's end");
      LL_ASSIGN_OR_RETURN(digest_, to_digest(piece_.digest()));
      size_ = piece_.size();
      offset_ = piece_.offset();
      status_ = absl::DataLossError("the upload ended before its last byte; go on where it ended");
    } else if (!status_ || offset_ == size_) {
      return absl::InvalidArgumentError("a blob must begin with its name");
    }
    const auto* data = reinterpret_cast<const uint8_t*>(piece_.data().data());
    LL_RETURN_IF_ERROR(store_->append(digest_, size_, offset_, {data, piece_.data().size()}));
    offset_ += piece_.data().size();
    if (!status_->ok() && (offset_ == size_ || store_->has(digest_))) {
      status_ = absl::OkStatus();
      response_->set_blobs(response_->blobs() + 1);
    }
    return absl::OkStatus();
  }

  HandOver hand_over_;
  BlobStore* store_;
  v1::WriteResponse* response_;
  v1::WriteRequest piece_;
  Digest digest_;
  uint64_t size_ = 0, offset_ = 0;
  std::optional<absl::Status> status_;  // that it would end with now; none before the first piece
};

class Reading final : public grpc::ServerWriteReactor<v1::ReadResponse> {
 public:
  Reading(BlobStore* store, const v1::ReadRequest& request) : store_(store), offset_(request.offset()) {
    whole_ = offset_ == 0;
    const auto lock = hand_over_.hold();
    const auto digest = to_digest(request.digest());
    if (!digest.ok()) {
      Finish(to_grpc(digest.status()));
      return;
    }
    digest_ = *digest;
    // What is written here would be read after the constructor, by whom the lock does not hold up.
    StartSendInitialMetadata();
  }

  void OnSendInitialMetadataDone(bool ok) override { go_on(ok); }
  void OnWriteDone(bool ok) override { go_on(ok); }
  void OnDone() override {
    hand_over_.hold().unlock();
    delete this;
  }

 private:
  void go_on(bool ok) {
    const auto lock = hand_over_.hold();
    if (!ok) {
      Finish(grpc::Status::CANCELLED);
      return;
    }
    const auto bytes = store_->read(digest_, offset_, kPiece);
    if (!bytes.ok() || bytes->empty()) {
      Finish(to_grpc(bytes.ok() ? check() : bytes.status()));
      return;
    }
    if (whole_) hasher_.bytes(bytes->data(), bytes->size());
    offset_ += bytes->size();
    piece_.set_data(bytes->data(), bytes->size());
    StartWrite(&piece_);
  }

  absl::Status check() {
    if (!whole_ || hasher_.finish() == digest_) return absl::OkStatus();
    spdlog::error("blob " + digest_.hex() + " is damaged: its disk should be looked at");
    LL_RETURN_IF_ERROR(store_->set_damaged_aside(digest_));
    return damaged(digest_);
  }

  HandOver hand_over_;
  BlobStore* store_;
  Digest digest_;
  uint64_t offset_;
  bool whole_ = false;  // read from its beginning
  Hasher hasher_;       // of what was read
  v1::ReadResponse piece_;
};

class BlobService final : public v1::BlobService::CallbackService {
 public:
  explicit BlobService(BlobStore* store) : store_(store) {}

  grpc::ServerUnaryReactor* FindMissing(grpc::CallbackServerContext* context, const v1::FindMissingRequest* request,
                                        v1::FindMissingResponse* response) override {
    if (request->digests_size() > kMostDigests) {
      return finish(context, absl::InvalidArgumentError("FindMissing takes at most 8192 digests; ask in parts"));
    }
    for (const std::string& bytes : request->digests()) {
      const auto digest = to_digest(bytes);
      if (!digest.ok()) return finish(context, digest.status());
      if (!store_->has(*digest)) response->add_digests(bytes);
    }
    return finish(context, absl::OkStatus());
  }

  grpc::ServerUnaryReactor* GetUpload(grpc::CallbackServerContext* context, const v1::GetUploadRequest* request,
                                      v1::GetUploadResponse* response) override {
    const auto digest = to_digest(request->digest());
    if (!digest.ok()) return finish(context, digest.status());
    response->set_offset(store_->uploaded(*digest));
    response->set_complete(store_->has(*digest));
    return finish(context, absl::OkStatus());
  }

  grpc::ServerReadReactor<v1::WriteRequest>* Write(grpc::CallbackServerContext*, v1::WriteResponse* response) override {
    return new Writing(store_, response);
  }

  grpc::ServerWriteReactor<v1::ReadResponse>* Read(grpc::CallbackServerContext*,
                                                   const v1::ReadRequest* request) override {
    return new Reading(store_, *request);
  }

 private:
  BlobStore* store_;
};

}  // namespace

std::unique_ptr<grpc::Service> make_blob_service(BlobStore* store) { return std::make_unique<BlobService>(store); }

}  // namespace lightloom
