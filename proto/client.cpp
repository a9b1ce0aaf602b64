#include "proto/client.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>

#include "core/base/text.h"
#include "proto/blob_service.grpc.pb.h"
#include "proto/digest.h"

namespace lightloom {
namespace {

constexpr size_t kPiece = size_t{1} << 20;
constexpr std::chrono::seconds kServerStops{2};
/// Another try may find the server there, or the upload where it is.
bool is_worth_another_try(const grpc::Status& status) {
  switch (status.error_code()) {
    case grpc::StatusCode::UNAVAILABLE:
    case grpc::StatusCode::DEADLINE_EXCEEDED:
    case grpc::StatusCode::ABORTED:
    case grpc::StatusCode::DATA_LOSS:
    case grpc::StatusCode::CANCELLED:  // by a server that stops: who cancels here gives up, too
      return true;
    default:
      return false;
  }
}

}  // namespace

std::shared_ptr<grpc::Channel> dial(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  // A server that comes back is found within a second.
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 200);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
  // A connection whose other end is gone without a word is noticed.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 20'000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10'000);
  return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
}

absl::Status from_grpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED) {
    return absl::UnimplementedError("what answers there is no lightloom-server of this protocol; check the address");
  }
  return {static_cast<absl::StatusCode>(status.error_code()), printable(status.error_message(), 500)};
}

absl::Status call_with_retries(const Patience& patience,
                               const std::function<grpc::Status(grpc::ClientContext*)>& call) {
  const auto begun = std::chrono::steady_clock::now(), end = begun + patience.total;
  auto pause = std::chrono::milliseconds(50);
  for (;;) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + patience.call);
    const grpc::Status status = call(&context);
    const auto now = std::chrono::steady_clock::now();
    const bool full = patience.wait_for_room && status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED;
    // So gRPC answers calls that come while its server stops; else something other listens there.
    const bool stopping = status.error_code() == grpc::StatusCode::UNIMPLEMENTED && now < begun + kServerStops;
    if ((!is_worth_another_try(status) && !full && !stopping) || now + pause > end ||
        (patience.give_up && patience.give_up())) {
      return from_grpc(status);
    }
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable().wait_for(lock, pause);
    pause = std::min(2 * pause, std::chrono::milliseconds(1000));
  }
}

absl::StatusOr<Digest> BlobClient::upload(std::span<const uint8_t> bytes,
                                          const std::function<void(uint64_t)>& progress) const {
  const auto stub = v1::BlobService::NewStub(channel_);
  const Digest digest = sha256(bytes);
  bool ask = bytes.size() > kPiece;  // how much is there: a small blob is sent sooner
  LL_RETURN_IF_ERROR(call_with_retries(patience_, [&](grpc::ClientContext* context) {
    size_t at = 0;
    if (ask) {
      v1::GetUploadRequest question;
      question.set_digest(to_bytes(digest));
      v1::GetUploadResponse there;
      if (const grpc::Status status = stub->GetUpload(context, question, &there); !status.ok()) return status;
      if (there.complete()) return grpc::Status::OK;
      at = std::min<size_t>(there.offset(), bytes.size());
    }
    ask = true;

    grpc::ClientContext stream;
    stream.set_deadline(std::chrono::system_clock::now() + patience_.call + std::chrono::seconds(bytes.size() >> 20));
    stream.set_initial_metadata_corked(true);  // goes out with the first piece
    v1::WriteResponse response;
    const auto writer = stub->Write(&stream, &response);
    v1::WriteRequest piece;
    piece.set_digest(to_bytes(digest));
    piece.set_size(bytes.size());
    piece.set_offset(at);
    do {
      const auto data = bytes.subspan(at, std::min(kPiece, bytes.size() - at));
      piece.set_data(data.data(), data.size());
      at += data.size();
      grpc::WriteOptions options;
      if (at == bytes.size()) options.set_last_message();
      if (patience_.give_up && patience_.give_up()) stream.TryCancel();
      if (!writer->Write(piece, options)) break;
      if (progress) progress(at);
      piece.Clear();
    } while (at < bytes.size());
    return writer->Finish();
  }));
  return digest;
}

absl::Status BlobClient::upload(const std::vector<std::vector<uint8_t>>& blobs) const {
  if (upload_together(blobs)) return absl::OkStatus();
  // Too big, or cut, or some are there in part: one after the other, each from where it is.
  for (const std::vector<uint8_t>& blob : blobs) LL_RETURN_IF_ERROR(upload(std::span(blob)).status());
  return absl::OkStatus();
}

bool BlobClient::upload_together(const std::vector<std::vector<uint8_t>>& blobs) const {
  uint64_t bytes = 0;
  for (const std::vector<uint8_t>& blob : blobs) {
    if (blob.size() > kPiece) return false;
    bytes += blob.size();
  }
  if (blobs.empty()) return true;
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + patience_.call + std::chrono::seconds(bytes >> 20));
  context.set_initial_metadata_corked(true);  // goes out with the first piece
  v1::WriteResponse response;
  const auto stub = v1::BlobService::NewStub(channel_);
  const auto writer = stub->Write(&context, &response);
  for (const std::vector<uint8_t>& blob : blobs) {
    v1::WriteRequest whole;
    whole.set_digest(to_bytes(sha256(blob)));
    whole.set_size(blob.size());
    whole.set_data(blob.data(), blob.size());
    grpc::WriteOptions options;
    if (&blob == &blobs.back()) options.set_last_message();
    if (patience_.give_up && patience_.give_up()) context.TryCancel();
    if (!writer->Write(whole, options)) break;
  }
  return writer->Finish().ok();
}

absl::StatusOr<std::vector<Digest>> BlobClient::find_missing(std::span<const Digest> digests) const {
  constexpr size_t kMost = 8192;  // in one call
  const auto stub = v1::BlobService::NewStub(channel_);
  std::vector<Digest> missing;
  for (; !digests.empty(); digests = digests.subspan(std::min(kMost, digests.size()))) {
    v1::FindMissingRequest request;
    for (const Digest& digest : digests.first(std::min(kMost, digests.size()))) request.add_digests(to_bytes(digest));
    v1::FindMissingResponse response;
    LL_RETURN_IF_ERROR(call_with_retries(
        patience_, [&](grpc::ClientContext* context) { return stub->FindMissing(context, request, &response); }));
    for (const std::string& bytes : response.digests()) {
      LL_ASSIGN_OR_RETURN(const Digest digest, to_digest(bytes));
      missing.push_back(digest);
    }
  }
  return missing;
}

absl::StatusOr<std::vector<uint8_t>> BlobClient::download(const Digest& digest) const {
  const auto stub = v1::BlobService::NewStub(channel_);
  std::vector<uint8_t> bytes;
  LL_RETURN_IF_ERROR(call_with_retries(patience_, [&](grpc::ClientContext* context) {
    v1::ReadRequest request;
    request.set_digest(to_bytes(digest));
    request.set_offset(bytes.size());  // a cut download goes on
    const auto reader = stub->Read(context, request);
    v1::ReadResponse piece;
    while (reader->Read(&piece)) bytes.insert(bytes.end(), piece.data().begin(), piece.data().end());
    const grpc::Status status = reader->Finish();
    if (status.ok() && sha256(bytes) != digest) {
      bytes.clear();
      return grpc::Status(grpc::StatusCode::DATA_LOSS, "blob " + digest.hex() + " arrived with other bytes");
    }
    return status;
  }));
  return bytes;
}

}  // namespace lightloom
