#include "bake-server/scheduler/decide.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>

namespace lightloom {
namespace {

using ::testing::ElementsAre;

JobView job(int64_t id, int tasks, const std::string& client = "a", int priority = 0) {
  JobView out;
  out.id = id;
  out.client = client;
  out.priority = priority;
  for (int i = 0; i < tasks; ++i) out.ready.push_back({1000 * id + i, i});
  return out;
}
std::vector<int64_t> orders(const std::vector<Decision>& decisions, const std::string& worker) {
  std::vector<int64_t> out;
  for (const Decision& d : decisions) {
    if (d.worker == worker) out.push_back(d.order);
  }
  return out;
}
std::map<int64_t, int> per_job(const std::vector<Decision>& decisions) {
  std::map<int64_t, int> out;
  for (const Decision& d : decisions) ++out[d.job];
  return out;
}

TEST(Decide, NothingToDoOrNobodyThere) {
  EXPECT_TRUE(decide({}, {{"w", 4}}, 0).empty());
  EXPECT_TRUE(decide({job(1, 3)}, {}, 0).empty());
  EXPECT_TRUE(decide({job(1, 3)}, {{"w", 0}}, 0).empty());
}

TEST(Decide, NoTaskTwiceAndRoomIsKept) {
  const auto decisions = decide({job(1, 20), job(2, 20)}, {{"v", 7}, {"w", 5}}, 0);
  std::set<int64_t> tasks;
  for (const Decision& d : decisions) tasks.insert(d.task);
  EXPECT_EQ(tasks.size(), 12u);
  EXPECT_EQ(orders(decisions, "v").size(), 7u);
  EXPECT_EQ(orders(decisions, "w").size(), 5u);
}

TEST(Decide, AnUrgentJobComesFirst) {
  const auto decisions = decide({job(1, 100), job(2, 10, "a", 5)}, {{"w", 12}}, 0);
  ASSERT_EQ(decisions.size(), 12u);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(decisions[static_cast<size_t>(i)].job, 2);
  EXPECT_EQ(decisions[10].job, 1);
}

TEST(Decide, WhoFailedATaskGetsItNoMoreWhileOthersAreThere) {
  JobView view = job(1, 2);
  view.ready[0].failed_by = {"v"};
  EXPECT_THAT(orders(decide({view}, {{"v", 2}}, 0, {}, {"v", "w"}), "v"), ElementsAre(1));
  EXPECT_THAT(orders(decide({view}, {{"v", 1}, {"w", 1}}, 0), "w"), ElementsAre(0));
  EXPECT_THAT(orders(decide({view}, {{"v", 2}}, 0, {}, {"v"}), "v"), ElementsAre(0, 1)) << "there is nobody else";
  view.ready[0].failed_by = {"v", "w"};
  EXPECT_THAT(orders(decide({view}, {{"v", 2}}, 0, {}, {"v", "w"}), "v"), ElementsAre(0, 1)) << "all have";
  // A job with nothing for this worker is no reason to leave it idle.
  view.ready = {{7, 0, {"v"}}};
  view.priority = 9;
  EXPECT_EQ(decide({view, job(2, 1)}, {{"v", 1}}, 0, {}, {"w"}).front().job, 2);
}

TEST(Decide, AnUrgentTaskOvertakesWhatIsQueued) {
  // Two threads, four tasks of job 1; two more urgent ones start next, a third one would have to wait for those.
  const Demand full{.worker = "w", .room = 0, .threads = 2, .held = {1, 1, 1, 1}};
  EXPECT_THAT(per_job(decide({job(1, 9), job(2, 3, "a", 5)}, {full}, 0)), ElementsAre(std::pair(2, 2)));
  Demand urgent = full;
  urgent.held = {1, 1, 2, 2};
  EXPECT_TRUE(decide({job(1, 9), job(2, 3, "a", 5)}, {urgent}, 0).empty());
  EXPECT_EQ(decide({job(1, 9), job(2, 3, "a", 5), job(3, 1, "a", 6)}, {urgent}, 0).front().job, 3);
  EXPECT_TRUE(decide({job(1, 9), job(2, 3, "a", 0)}, {full}, 0).empty()) << "it is not more urgent";
}

TEST(Decide, ClientsShareEvenlyHoweverManyJobsTheyHave) {
  const auto decisions = decide({job(1, 50, "a"), job(2, 50, "a"), job(3, 50, "a"), job(4, 50, "b")}, {{"w", 12}}, 0);
  const auto n = per_job(decisions);
  EXPECT_EQ(n.at(4), 6);
  EXPECT_EQ(n.at(1), 2);
  EXPECT_EQ(n.at(2), 2);
  EXPECT_EQ(n.at(3), 2);
}

TEST(Decide, WhatIsOutCountsForTheShare) {
  JobView first = job(1, 10, "a");
  for (int i = 0; i < 4; ++i) first.running.push_back({500 + i, 100 + i, 1, 0, {"v"}});
  first.live = 4;
  EXPECT_EQ(per_job(decide({first, job(2, 10, "b")}, {{"w", 4}}, 0)).at(2), 4);
}

TEST(Decide, WorkersStayInRunsOfTheirOwn) {
  DecideOptions options;
  options.run = 4;
  const auto decisions = decide({job(1, 40)}, {{"v", 6}, {"w", 6}}, 0, options);
  EXPECT_THAT(orders(decisions, "v"), ElementsAre(0, 1, 2, 3, 8, 9));
  EXPECT_THAT(orders(decisions, "w"), ElementsAre(4, 5, 6, 7, 12, 13));
  // One that comes back goes on where it was.
  JobView later = job(1, 0);
  for (int i = 0; i < 8; ++i) later.ready.push_back({i, 20 + i});
  EXPECT_THAT(orders(decide({later}, {{"w", 2, 1, 25}}, 0, options), "w"), ElementsAre(24, 25));
}

TEST(Decide, WhatHasFailedIsNotForSuspects) {
  JobView once = job(1, 2);
  once.ready[0].failed_by = {"broken"};
  const std::set<std::string> suspects{"broken", "also broken"};
  const std::vector<std::string> others{"broken", "sound"};
  EXPECT_THAT(orders(decide({once}, {{"also broken", 2}}, 0, {}, others, suspects), "also broken"), ElementsAre(1));
  EXPECT_THAT(orders(decide({once}, {{"also broken", 2}}, 0, {}, others), "also broken"), ElementsAre(0, 1));
  EXPECT_THAT(orders(decide({once}, {{"sound", 2}}, 0, {}, {"broken"}, suspects), "sound"), ElementsAre(0, 1));
  // If the sound ones have failed it too, or are gone, it is for anyone.
  once.ready[0].failed_by = {"broken", "sound"};
  EXPECT_EQ(decide({once}, {{"also broken", 2}}, 0, {}, others, suspects).size(), 2u);
  EXPECT_EQ(decide({once}, {{"also broken", 2}}, 0, {}, {"broken"}, suspects).size(), 2u);
}

TEST(Decide, StragglersAreLeasedOnceMoreWhenNothingElseIsLeft) {
  JobView end = job(1, 0);
  end.running = {{7, 0, 1, 5'000, {"v"}}, {8, 1, 1, 1'000, {"v"}}, {9, 2, 2, 0, {"u", "v"}}, {10, 3, 1, 0, {"w"}}};
  DecideOptions options;
  options.straggler_ms = 60'000;
  EXPECT_TRUE(decide({end}, {{"w", 4}}, 60'000, options).empty());
  const auto decisions = decide({end}, {{"w", 4}}, 66'000, options);
  ASSERT_EQ(decisions.size(), 2u) << "not its own, and none a third time";
  EXPECT_EQ(decisions[0].task, 8) << "the oldest first";
  EXPECT_EQ(decisions[1].task, 7);
  end.ready.push_back({11, 4});
  EXPECT_EQ(decide({end}, {{"w", 1}}, 66'000, options).front().task, 11);
}

}  // namespace
}  // namespace lightloom
