// The contract of what keeps a Store in bounds, for every implementation.
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <thread>

#include "bake-server/store/store.h"
#include "tests/unit/bake-server/store_backends.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::test {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

class StoreUpkeep : public testing::TestWithParam<StoreBackend> {
 protected:
  void SetUp() override { store_ = value(GetParam().open(folder_.path())); }

  /// A job of one task that is done at `at_ms`, with this output.
  JobId done_job(const std::string& request, int64_t at_ms, int64_t output, const std::string& client = "c") {
    NewJob request_of = new_job(request, {cell(0, output)});
    request_of.client = client;
    request_of.inputs = {digest(1000 + output)};
    const JobId id = value(store_->submit(request_of, at_ms)).id;
    const TaskId task = value(store_->view(1)).at(0).ready.at(0).task;
    EXPECT_TRUE(value(store_->lease({task, "w", request, at_ms + 100, 1}, at_ms)));
    EXPECT_EQ(value(store_->complete(request, {digest(output)}, {}, at_ms)), Completion::kAccepted);
    return id;
  }
  std::vector<JobId> ids() {
    std::vector<JobId> out;
    for (const Job& job : value(store_->jobs(0, 1000))) out.push_back(job.id);
    return out;
  }
  std::vector<Digest> referenced() {
    std::vector<Digest> out;
    value(store_->referenced([&](const Digest& d) {
      out.push_back(d);
      return true;
    }));
    return out;
  }

  TemporaryFolder folder_;
  std::unique_ptr<Store> store_;
};

TEST_P(StoreUpkeep, JobsThatEndedBeforeAreForgottenWhole) {
  const JobId early = done_job("a", 10, 1), late = done_job("b", 20, 2);
  const JobId running = value(store_->submit(new_job("c", {cell(0, 3)}), 1)).id;
  const JobId cancelled = value(store_->submit(new_job("d", {cell(0, 4)}), 1)).id;
  value(store_->cancel(cancelled, 15));
  EXPECT_EQ(value(store_->forget_ended(10, 1000)).jobs, 0u) << "it ended at 10, not before";
  const Forgotten forgotten = value(store_->forget_ended(20, 1000));
  EXPECT_EQ(forgotten.jobs, 2u);
  EXPECT_FALSE(forgotten.more);
  EXPECT_THAT(ids(), UnorderedElementsAre(late, running));
  EXPECT_EQ(store_->job(early).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store_->events(early, 0, 10).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store_->task(1).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(value(store_->complete("a", {digest(1)}, {}, 30)), Completion::kUnknown)
      << "late news of what is forgotten";
  EXPECT_THAT(referenced(), UnorderedElementsAre(digest(2), digest(1002)));
}

TEST_P(StoreUpkeep, TheSameRequestIsANewJobOnceTheOldOneIsForgotten) {
  const JobId first = done_job("a", 10, 1);
  EXPECT_EQ(value(store_->forget_ended(11, 1000)).jobs, 1u);
  const JobId second = done_job("a", 20, 1);
  EXPECT_GT(second, first) << "no number is given twice";
  EXPECT_EQ(value(store_->job(second)).state, JobState::kDone);
}

TEST_P(StoreUpkeep, ALargeJobGoesAFewRowsAtATime) {
  std::vector<NewTask> tasks;
  for (int i = 0; i < 500; ++i) tasks.push_back(cell(static_cast<uint32_t>(i % 3), i));
  const JobId large = value(store_->submit(new_job("large", tasks), 1)).id;
  value(store_->cancel(large, 5));
  const JobId small = done_job("small", 6, 1);
  int calls = 1;
  for (; value(store_->forget_ended(6, 50)).more; ++calls) {
    EXPECT_EQ(value(store_->job(large)).state, JobState::kCancelled) << "it is there until its last row";
    ASSERT_LT(calls, 100);
  }
  EXPECT_GE(calls, 10);
  EXPECT_THAT(ids(), ElementsAre(small));
  EXPECT_FALSE(value(store_->forget_ended(6, 50)).more);
}

TEST_P(StoreUpkeep, ReferencesAreInputsOfJobsAndOutputsOfTasks) {
  EXPECT_THAT(referenced(), IsEmpty());
  done_job("a", 10, 1);
  done_job("b", 10, 2, "other");
  NewJob running = new_job("c", {cell(0, 3), cell(0, 4)});
  running.inputs = {digest(7), digest(8)};
  value(store_->submit(running, 20));
  EXPECT_THAT(referenced(),
              UnorderedElementsAre(digest(1), digest(1001), digest(2), digest(1002), digest(7), digest(8)));
  int visits = 0;
  value(store_->referenced([&](const Digest&) { return ++visits < 2; }));
  EXPECT_EQ(visits, 2);
}

TEST_P(StoreUpkeep, ReferencesOfAClientAreDistinct) {
  done_job("a", 10, 1);
  done_job("b", 10, 2, "other");
  NewJob again = new_job("c", {cell(0, 3)});
  again.inputs = {digest(1001), digest(1)};
  value(store_->submit(again, 20));
  EXPECT_THAT(value(store_->references_of("c")), UnorderedElementsAre(digest(1), digest(1001)));
  EXPECT_THAT(value(store_->references_of("other")), UnorderedElementsAre(digest(2), digest(1002)));
  EXPECT_THAT(value(store_->references_of("nobody")), IsEmpty());
  const auto sorted = value(store_->references_of("c"));
  EXPECT_TRUE(std::is_sorted(sorted.begin(), sorted.end()));
}

TEST_P(StoreUpkeep, OthersGoOnWhileReferencesAreVisited) {
  for (int i = 0; i < 20; ++i) done_job(absl::StrCat("r", i), 10, i);
  std::vector<Digest> seen;
  value(store_->referenced([&](const Digest& d) {
    // In the middle of the visit: what comes and what goes belongs to another moment.
    if (seen.empty()) {
      std::thread([&] {
        done_job("late", 20, 99);
        value(store_->forget_ended(11, 1000));
      }).join();
    }
    seen.push_back(d);
    return true;
  }));
  std::vector<Digest> expected;
  for (int i = 0; i < 20; ++i) {
    expected.push_back(digest(i));
    expected.push_back(digest(1000 + i));
  }
  EXPECT_THAT(seen, testing::UnorderedElementsAreArray(expected));
  EXPECT_THAT(referenced(), UnorderedElementsAre(digest(99), digest(1099)));
}

INSTANTIATE_TEST_SUITE_P(, StoreUpkeep, testing::ValuesIn(store_backends()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace lightloom::test
