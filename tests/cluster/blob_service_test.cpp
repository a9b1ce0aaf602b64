// Blobs over a real connection: many in one call, and what the service refuses.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "bake-server/grpc/server.h"
#include "proto/blob_service.grpc.pb.h"
#include "proto/client.h"
#include "proto/digest.h"
#include "tests/support/baked_level.h"

namespace lightloom {
namespace {

using test::value_or_die;
using testing::HasSubstr;

using Bytes = std::vector<uint8_t>;

class BlobServiceTest : public testing::Test {
 protected:
  /// One call to Write with these messages.
  grpc::Status write(const std::vector<v1::WriteRequest>& messages, v1::WriteResponse* response) {
    grpc::ClientContext context;
    const auto writer = stub_->Write(&context, response);
    for (const v1::WriteRequest& m : messages) {
      if (!writer->Write(m)) break;
    }
    writer->WritesDone();
    return writer->Finish();
  }
  static v1::WriteRequest first_piece(const std::string& blob, const std::string& piece) {
    v1::WriteRequest message;
    message.set_digest(to_bytes(digest_of(blob)));
    message.set_size(blob.size());
    message.set_data(piece);
    return message;
  }
  static v1::WriteRequest piece(const std::string& piece) {
    v1::WriteRequest message;
    message.set_data(piece);
    return message;
  }
  static Digest digest_of(const std::string& blob) { return sha256(blob); }
  bool there(const std::string& blob) { return client_.download(digest_of(blob)).ok(); }

  const test::TemporaryFolder folder_;
  const std::unique_ptr<Farm> farm_ = value_or_die(Farm::open(folder_.path()));
  const std::unique_ptr<Server> server_ = value_or_die(Server::start("127.0.0.1:0", {}, farm_.get()));
  const std::shared_ptr<grpc::Channel> channel_ = dial(server_->address());
  const std::unique_ptr<v1::BlobService::Stub> stub_ = v1::BlobService::NewStub(channel_);
  const BlobClient client_{channel_};
  v1::WriteResponse response_;
};

TEST_F(BlobServiceTest, ManyAreSentTogether) {
  std::vector<Bytes> blobs{Bytes(), Bytes(3'000'000, 7)};
  for (uint8_t i = 0; i < 200; ++i) blobs.push_back(Bytes(30'000, i));
  blobs.push_back(blobs.back());
  ASSERT_TRUE(client_.upload(blobs).ok());
  ASSERT_TRUE(client_.upload(blobs).ok()) << "again";
  ASSERT_TRUE(client_.upload(std::vector<Bytes>()).ok());
  for (const Bytes& blob : blobs) EXPECT_EQ(value_or_die(client_.download(sha256(blob))), blob);
}

TEST_F(BlobServiceTest, ManyGoOnWhereOneOfThemWasCut) {
  const std::string cut = "cut short by a server that was killed";
  EXPECT_EQ(write({first_piece(cut, "cut short")}, &response_).error_code(), grpc::StatusCode::DATA_LOSS);
  const auto blob = [](const std::string& s) { return Bytes(s.begin(), s.end()); };
  ASSERT_TRUE(client_.upload({blob("before"), blob(cut), blob("after")}).ok());
  for (const std::string& s : {std::string("before"), cut, std::string("after")}) EXPECT_TRUE(there(s)) << s;
}

TEST_F(BlobServiceTest, OneCallTakesOneBlobAfterTheOther) {
  EXPECT_TRUE(
      write({first_piece("one blob", "one "), piece("blob"), first_piece("another", "another")}, &response_).ok());
  EXPECT_EQ(response_.blobs(), 2u);
  EXPECT_TRUE(there("one blob"));
  EXPECT_TRUE(there("another"));
  // As when somebody else was faster: what still comes of a blob is taken and forgotten.
  EXPECT_TRUE(write({first_piece("one blob", "one "), piece("blob"), first_piece("third", "third")}, &response_).ok());
  EXPECT_TRUE(there("third"));
}

TEST_F(BlobServiceTest, ABlobBeginsWithItsNameAfterTheLastOnesEnd) {
  grpc::Status status = write({piece("nameless")}, &response_);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("must begin with its name"));
  status = write({}, &response_);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  status = write({first_piece("whole", "whole"), piece("more")}, &response_);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_TRUE(there("whole"));
  status = write({first_piece("begun", "be"), first_piece("next", "next")}, &response_);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("before the last one's end"));
  EXPECT_FALSE(there("next"));
}

TEST_F(BlobServiceTest, WhatCameBeforeAnErrorIsKept) {
  grpc::Status status = write({first_piece("good", "good"), first_piece("asked", "other")}, &response_);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_TRUE(there("good"));
  EXPECT_FALSE(there("asked"));

  status = write({first_piece("cut short", "cut")}, &response_);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::DATA_LOSS);
  v1::GetUploadRequest question;
  question.set_digest(to_bytes(digest_of("cut short")));
  v1::GetUploadResponse answer;
  grpc::ClientContext context;
  ASSERT_TRUE(stub_->GetUpload(&context, question, &answer).ok());
  EXPECT_EQ(answer.offset(), 3u);
  v1::WriteRequest rest = first_piece("cut short", " short");
  rest.set_offset(3);
  EXPECT_TRUE(write({rest}, &response_).ok());
  EXPECT_TRUE(there("cut short"));
}

}  // namespace
}  // namespace lightloom
