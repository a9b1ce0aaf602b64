// Server and worker over a real connection: gRPC's in-process channel, and TCP on the loopback interface.
#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <chrono>
#include <filesystem>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "bake-server/grpc/server.h"
#include "bake-worker/join.h"
#include "proto/client.h"
#include "proto/job_service.grpc.pb.h"

namespace lightloom {
namespace {

using testing::HasSubstr;

constexpr std::chrono::seconds kPatience{30};  // never reached unless something hangs
const ServerInfo kInfo{
    .version = "9.9.9", .protocol_version = 1, .method_version = "method-a", .canary = sha256("canary")};

Introduction fitting_worker() {
  return {.version = "9.9.8",
          .protocol_version = 1,
          .method_version = "method-a",
          .avx2 = true,
          .threads = 2,
          .canary = sha256("canary")};
}

/// A folder for a farm, removed at the end.
class StateFolder {
 public:
  StateFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "lightloom-farm-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~StateFolder() { std::filesystem::remove_all(path_); }
  StateFolder(const StateFolder&) = delete;
  StateFolder& operator=(const StateFolder&) = delete;
  std::unique_ptr<Farm> open() const { return std::move(Farm::open(path_)).value(); }

 private:
  std::filesystem::path path_;
};

enum class Transport { kInProcess, kTcp };

class Handshake : public testing::TestWithParam<Transport> {
 protected:
  void SetUp() override {
    auto server = Server::start("127.0.0.1:0", kInfo, farm_.get());
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = std::move(*server);
    channel_ = GetParam() == Transport::kInProcess ? server_->in_process_channel() : dial(server_->address());
  }

  const StateFolder state_;
  std::unique_ptr<Farm> farm_ = state_.open();
  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
};

TEST_P(Handshake, AFittingWorkerIsAccepted) {
  const auto joined = join(channel_, fitting_worker(), kPatience);
  ASSERT_TRUE(joined.ok()) << joined.status();
  EXPECT_EQ(*joined, "9.9.9");
}

TEST_P(Handshake, JoiningTwiceIsHarmless) {
  ASSERT_TRUE(join(channel_, fitting_worker(), kPatience).ok());
  EXPECT_TRUE(join(channel_, fitting_worker(), kPatience).ok());
}

TEST_P(Handshake, AnotherMethodIsRefusedWithTheReason) {
  Introduction worker = fitting_worker();
  worker.method_version = "method-b";
  const auto joined = join(channel_, worker, kPatience);
  EXPECT_EQ(joined.status().code(), absl::StatusCode::kFailedPrecondition) << joined.status();
  EXPECT_THAT(std::string(joined.status().message()), HasSubstr("method-b"));
}

TEST_P(Handshake, ANewerProtocolIsRefused) {
  Introduction worker = fitting_worker();
  worker.protocol_version = 2;
  EXPECT_EQ(join(channel_, worker, kPatience).status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST_P(Handshake, AWorkerWithoutAvx2IsRefused) {
  Introduction worker = fitting_worker();
  worker.avx2 = false;
  const auto joined = join(channel_, worker, kPatience);
  EXPECT_EQ(joined.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(joined.status().message()), HasSubstr("AVX2"));
}

TEST_P(Handshake, AWorkerThatBakesOtherBytesIsRefused) {
  Introduction worker = fitting_worker();
  worker.canary = sha256("other");
  const auto joined = join(channel_, worker, kPatience);
  EXPECT_EQ(joined.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(joined.status().message()), HasSubstr("a tiny known bake has other bytes there"));
  worker.canary.reset();
  EXPECT_EQ(join(channel_, worker, kPatience).status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST_P(Handshake, ManyWorkersAtOnceGetTheirOwnAnswers) {
  std::vector<std::future<bool>> answers;
  answers.reserve(16);
  for (int i = 0; i < 16; ++i) {
    answers.push_back(std::async(std::launch::async, [this, i] {
      Introduction worker = fitting_worker();
      worker.avx2 = i % 2 == 0;
      return join(channel_, worker, kPatience).ok();
    }));
  }
  for (int i = 0; i < 16; ++i) EXPECT_EQ(answers[i].get(), i % 2 == 0) << i;
}

TEST_P(Handshake, TheServerSaysWhatItIs) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kPatience);
  v1::ServerInfo info;
  const grpc::Status status = v1::JobService::NewStub(channel_)->GetServerInfo(&context, {}, &info);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(info.version(), "9.9.9");
  EXPECT_EQ(info.protocol_version(), 1u);
  EXPECT_EQ(info.method_version(), "method-a");
}

TEST_P(Handshake, TheHealthServiceSaysServing) {
  // grpc.health.v1.HealthCheckRequest with no service, asked generically: Debian ships no stubs for it.
  grpc::GenericStub stub(channel_);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kPatience);
  const grpc::ByteBuffer request(nullptr, 0);
  grpc::ByteBuffer response;
  grpc::CompletionQueue queue;
  const auto call = stub.PrepareUnaryCall(&context, "/grpc.health.v1.Health/Check", request, &queue);
  call->StartCall();
  grpc::Status status;
  call->Finish(&response, &status, nullptr);
  void* tag = nullptr;
  bool event_ok = false;
  ASSERT_TRUE(queue.Next(&tag, &event_ok));
  ASSERT_TRUE(status.ok()) << status.error_message();
  grpc::Slice bytes;
  ASSERT_TRUE(response.DumpToSingleSlice(&bytes).ok());
  // HealthCheckResponse{status: SERVING}: field 1, varint 1.
  EXPECT_EQ(std::string(bytes.begin(), bytes.end()), "\x08\x01");
}

INSTANTIATE_TEST_SUITE_P(, Handshake, testing::Values(Transport::kInProcess, Transport::kTcp),
                         [](const auto& info) { return info.param == Transport::kTcp ? "Tcp" : "InProcess"; });

TEST(HandshakeErrors, AnUnreachableServerIsAnErrorWithinTheDeadline) {
  std::string address;
  {
    const StateFolder state;
    const auto farm = state.open();
    const auto server = Server::start("127.0.0.1:0", kInfo, farm.get());
    ASSERT_TRUE(server.ok()) << server.status();
    address = (*server)->address();
  }  // nobody listens there any more
  const auto joined = join(dial(address), fitting_worker(), std::chrono::milliseconds(200));
  EXPECT_EQ(joined.status().code(), absl::StatusCode::kUnavailable) << joined.status();
  EXPECT_THAT(std::string(joined.status().message()), HasSubstr("no answer within 200 ms"));
}

TEST(HandshakeErrors, APortIsNotSharedWithASecondServer) {
  const StateFolder state, other;
  const auto farm = state.open(), other_farm = other.open();
  const auto first = Server::start("127.0.0.1:0", kInfo, farm.get());
  ASSERT_TRUE(first.ok()) << first.status();
  const auto second = Server::start((*first)->address(), kInfo, other_farm.get());
  EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable) << second.status();
}

TEST(HandshakeErrors, AddressesOfOtherMachinesAreRefused) {
  const StateFolder state;
  const auto farm = state.open();
  EXPECT_EQ(Server::start("0.0.0.0:0", kInfo, farm.get()).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(HandshakeErrors, ThisMachineIsIntroducedWithThisProgramsVersions) {
  const Introduction self = introduce_this_machine(3);
  EXPECT_FALSE(self.version.empty());
  EXPECT_FALSE(self.method_version.empty());
  EXPECT_GE(self.protocol_version, 1u);
  EXPECT_EQ(self.threads, 3u);
}

}  // namespace
}  // namespace lightloom
