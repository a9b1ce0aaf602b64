#include "bake-worker/join.h"

#include <absl/strings/str_cat.h>
#include <grpcpp/grpcpp.h>

#include "core/base/text.h"
#include "core/base/version.h"
#include "proto/protocol_version.h"
#include "proto/worker_service.grpc.pb.h"

namespace lightloom {

Introduction introduce_this_machine(uint32_t threads) {
  return {.version = std::string(kVersion),
          .protocol_version = kProtocolVersion,
          .method_version = std::string(kMethodVersion),
          // What -march=x86-64-v3 lets the compiler use beyond SSE4.2; Embree needs avx2, fma and f16c of it.
          .avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
                  __builtin_cpu_supports("bmi2"),
          .threads = threads,
          .canary = std::nullopt};
}

absl::StatusOr<std::string> join(const std::shared_ptr<grpc::Channel>& channel, const Introduction& self,
                                 std::chrono::milliseconds deadline) {
  v1::JoinRequest request;
  to_proto(self, &request);

  constexpr int kTries = 5;  // connections may be cut
  const auto end = std::chrono::system_clock::now() + deadline;
  v1::JoinResponse response;
  grpc::Status status;
  for (int i = 0; i == 0 || (i < kTries && status.error_code() == grpc::StatusCode::UNAVAILABLE); ++i) {
    grpc::ClientContext context;
    context.set_deadline(end);
    context.set_wait_for_ready(true);  // a worker may be up before its server
    status = v1::WorkerService::NewStub(channel)->Join(&context, request, &response);
  }
  if (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) {
    return absl::UnavailableError(
        absl::StrCat("no answer within ", deadline.count(), " ms: is lightloom-server running there?"));
  }
  if (!status.ok()) {
    return absl::UnavailableError(absl::StrCat("the server cannot be asked: ", printable(status.error_message()),
                                               " (gRPC code ", static_cast<int>(status.error_code()), ")"));
  }
  switch (response.outcome_case()) {
    case v1::JoinResponse::kAccepted:
      return printable(response.accepted().server_version(), 64);
    case v1::JoinResponse::kRefused:
      return absl::FailedPreconditionError(absl::StrCat("refused: ", printable(response.refused().message(), 400)));
    case v1::JoinResponse::OUTCOME_NOT_SET:
      break;
  }
  return absl::UnavailableError("the server's answer is empty: it is not a lightloom-server of this protocol");
}

}  // namespace lightloom
