#include "bake-server/scheduler/worker_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lightloom {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(WorkerSession, AnAssignmentWhoseAnswerWasLostIsSentAgain) {
  WorkerSession session;
  EXPECT_FALSE(session.sync({1, 1, 0, {}}).stale);
  session.assigned("x", session.answer());
  const SyncOutcome lost = session.sync({1, 2, 0, {}});
  EXPECT_THAT(lost.resend, ElementsAre("x"));
  EXPECT_THAT(lost.gone, IsEmpty());
  session.assigned("x", session.answer());
  EXPECT_THAT(session.sync({1, 3, 2, {"x"}}).resend, IsEmpty());
}

TEST(WorkerSession, WhatAWorkerSawAndDoesNotHaveIsGone) {
  WorkerSession session;
  session.sync({1, 1, 0, {}});
  session.assigned("x", session.answer());
  EXPECT_THAT(session.sync({1, 2, 1, {}}).gone, ElementsAre("x"));
  EXPECT_THAT(session.sync({1, 3, 1, {}}).gone, IsEmpty()) << "once";
}

TEST(WorkerSession, LateMessagesAreStale) {
  WorkerSession session;
  session.sync({1, 5, 0, {}});
  session.assigned("x", session.answer());
  EXPECT_TRUE(session.sync({1, 5, 0, {}}).stale) << "a repetition";
  EXPECT_TRUE(session.sync({1, 4, 9, {}}).stale) << "one that was overtaken";
  EXPECT_THAT(session.sync({1, 6, 1, {"x"}}).gone, IsEmpty()) << "neither took anything away";
}

TEST(WorkerSession, AWorkerThatRestartedHasNothing) {
  WorkerSession session;
  session.sync({1, 7, 0, {}});
  session.assigned("x", session.answer());
  EXPECT_THAT(session.sync({2, 1, 0, {}}).gone, ElementsAre("x"));
  EXPECT_FALSE(session.sync({2, 1, 0, {}}).replaced) << "a repetition";
  EXPECT_TRUE(session.sync({1, 8, 1, {"x"}}).stale) << "the dead process's last words";
  EXPECT_TRUE(session.sync({1, 9, 1, {"x"}}).replaced) << "or it is not dead";
  EXPECT_FALSE(session.sync({2, 2, 0, {}}).stale);
}

TEST(WorkerSession, ACoordinatorThatRestartedGoesOnAboveTheAnswersThatWereSeen) {
  WorkerSession session;
  session.sync({1, 80, 70, {"old"}});
  const uint64_t answer = session.answer();
  EXPECT_GT(answer, 70u);
  session.assigned("new", answer);
  EXPECT_THAT(session.sync({1, 81, 70, {"old"}}).resend, ElementsAre("new"));
}

}  // namespace
}  // namespace lightloom
