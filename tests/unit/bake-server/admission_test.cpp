#include "bake-server/scheduler/admission.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lightloom {
namespace {

using testing::HasSubstr;
using testing::Not;

const ServerInfo kServer{.version = "9.9.9", .protocol_version = 3, .method_version = "7"};

WorkerInfo fitting_worker() { return {.protocol_version = 3, .method_version = "7", .avx2 = true, .threads = 4}; }

TEST(Admission, AcceptsAWorkerThatFits) {
  const Admission admission = admit(fitting_worker(), kServer);
  EXPECT_TRUE(admission.accepted());
  EXPECT_EQ(admission.message, "");
}

TEST(Admission, AcceptsTheProtocolBeforeItsOwn) {
  WorkerInfo worker = fitting_worker();
  worker.protocol_version = 2;
  EXPECT_TRUE(admit(worker, kServer).accepted());
}

TEST(Admission, RefusesOlderAndNewerProtocols) {
  WorkerInfo worker = fitting_worker();
  for (const uint32_t version : {0u, 1u, 4u, 0xFFFFFFFFu}) {
    worker.protocol_version = version;
    const Admission admission = admit(worker, kServer);
    EXPECT_EQ(admission.refusal, Refusal::kProtocolVersion) << version;
    EXPECT_THAT(admission.message, HasSubstr(version < 3 ? "upgrade the worker" : "upgrade the server"));
  }
}

TEST(Admission, TheFirstProtocolHasNoPredecessor) {
  ServerInfo server = kServer;
  server.protocol_version = 1;
  WorkerInfo worker = fitting_worker();
  worker.protocol_version = 0;
  EXPECT_EQ(admit(worker, server).refusal, Refusal::kProtocolVersion);
  worker.protocol_version = 1;
  EXPECT_TRUE(admit(worker, server).accepted());
}

TEST(Admission, RefusesAnotherMethodAndNamesBoth) {
  WorkerInfo worker = fitting_worker();
  worker.method_version = "6";
  const Admission admission = admit(worker, kServer);
  EXPECT_EQ(admission.refusal, Refusal::kMethodVersion);
  EXPECT_THAT(admission.message, HasSubstr("'6'"));
  EXPECT_THAT(admission.message, HasSubstr("'7'"));
}

TEST(Admission, AHostileVersionStringStaysOneShortLine) {
  WorkerInfo worker = fitting_worker();
  worker.method_version = "\n\x1b[31m" + std::string(100'000, 'x');
  const Admission admission = admit(worker, kServer);
  EXPECT_EQ(admission.refusal, Refusal::kMethodVersion);
  EXPECT_LT(admission.message.size(), 300u);
  EXPECT_THAT(admission.message, Not(HasSubstr("\n")));
  EXPECT_THAT(admission.message, Not(HasSubstr("\x1b")));
}

TEST(Admission, RefusesWithoutAvx2) {
  WorkerInfo worker = fitting_worker();
  worker.avx2 = false;
  EXPECT_EQ(admit(worker, kServer).refusal, Refusal::kMissingAvx2);
}

TEST(Admission, RefusesWithoutThreads) {
  WorkerInfo worker = fitting_worker();
  worker.threads = 0;
  EXPECT_EQ(admit(worker, kServer).refusal, Refusal::kNoThreads);
}

TEST(Admission, RefusesOtherBytesForAKnownBake) {
  ServerInfo server = kServer;
  WorkerInfo worker = fitting_worker();
  server.canary = sha256("known");
  EXPECT_EQ(admit(worker, server).refusal, Refusal::kCanary) << "it does not say";
  worker.canary = sha256("other");
  const Admission admission = admit(worker, server);
  EXPECT_EQ(admission.refusal, Refusal::kCanary);
  EXPECT_THAT(admission.message, HasSubstr(worker.canary->hex().substr(0, 12)));
  worker.canary = server.canary;
  EXPECT_TRUE(admit(worker, server).accepted());
  server.canary.reset();
  worker.canary = sha256("other");
  EXPECT_TRUE(admit(worker, server).accepted()) << "a server that does not ask";
}

}  // namespace
}  // namespace lightloom
