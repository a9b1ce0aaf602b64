#include "core/base/parallel.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace lightloom {
namespace {

class ParallelFor : public ::testing::TestWithParam<int> {};

TEST_P(ParallelFor, RunsEachIndexOnce) {
  for (const uint64_t n : {0u, 1u, 2u, 7u, 1000u}) {
    std::vector<std::atomic<int>> runs(n);
    EXPECT_TRUE(parallel_for(n, {GetParam(), nullptr, {}}, [&](uint64_t i) { ++runs.at(i); }));
    for (uint64_t i = 0; i < n; ++i) EXPECT_EQ(runs[i], 1) << i << " of " << n;
  }
}

TEST_P(ParallelFor, RethrowsAnExceptionAndStops) {
  std::atomic<uint64_t> runs{0};
  const auto body = [&](uint64_t i) {
    ++runs;
    if (i == 3) throw std::runtime_error("three");
  };
  try {
    parallel_for(1000000, {GetParam(), nullptr, {}}, body);
    FAIL() << "nothing was thrown";
  } catch (const std::runtime_error& e) {
    EXPECT_EQ(std::string(e.what()), "three");
  }
  if (GetParam() == 1) {
    EXPECT_EQ(runs, 4u);
  }
}

TEST_P(ParallelFor, ThrowingEverywhereThrowsOnce) {
  EXPECT_THROW(parallel_for(100, {GetParam(), nullptr, {}}, [](uint64_t) { throw 1; }), int);
}

TEST_P(ParallelFor, StopsWhenCancelled) {
  CancelFlag cancel;
  std::atomic<uint64_t> runs{0};
  const auto body = [&](uint64_t i) {
    ++runs;
    if (i == 10) cancel.cancel();
    while (i > 10 && !cancel.cancelled()) std::this_thread::yield();
  };
  EXPECT_FALSE(parallel_for(1000000, {GetParam(), &cancel, {}}, body));
  EXPECT_GE(runs, 11u);
  EXPECT_LT(runs, 1000000u);
}

TEST_P(ParallelFor, DoesNothingWhenCancelledBefore) {
  CancelFlag cancel;
  cancel.cancel();
  uint64_t runs = 0;
  EXPECT_FALSE(parallel_for(5, {GetParam(), &cancel, {}}, [&](uint64_t) { ++runs; }));
  EXPECT_EQ(runs, 0u);
}

TEST_P(ParallelFor, CancellingInTheLastIterationIsTooLate) {
  CancelFlag cancel;
  std::atomic<int> runs{0};
  const auto body = [&](uint64_t) {
    if (++runs == 4) cancel.cancel();
  };
  // When the fourth body runs, all four have begun, and what has begun ends.
  EXPECT_TRUE(parallel_for(4, {GetParam(), &cancel, {}}, body));
}

TEST_P(ParallelFor, ProgressCountsUpToTheTotal) {
  std::vector<uint64_t> seen;  // one call at a time: needs no lock
  Parallel how{GetParam(), nullptr, {}};
  how.progress = [&](uint64_t done, uint64_t total) {
    EXPECT_EQ(total, 50u);
    seen.push_back(done);
  };
  EXPECT_TRUE(parallel_for(50, how, [](uint64_t) {}));
  ASSERT_EQ(seen.size(), 50u);
  for (size_t i = 0; i < seen.size(); ++i) EXPECT_EQ(seen[i], i + 1);
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && !defined(__clang__)  // they map terabytes
TEST(ParallelForLimits, GoesOnWithTheThreadsThatTheSystemGives) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    struct rlimit limit {};
    limit.rlim_cur = limit.rlim_max = rlim_t{256} << 20;  // room for a few stacks of 8 MiB
    if (::setrlimit(RLIMIT_AS, &limit) != 0) ::_exit(2);
    std::atomic<uint64_t> runs{0};
    const bool done = parallel_for(4000, {1000, nullptr, {}}, [&](uint64_t) { ++runs; });
    ::_exit(done && runs == 4000 ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0);
}
#endif

INSTANTIATE_TEST_SUITE_P(Threads, ParallelFor, ::testing::Values(0, 1, 2, 3, 8));

}  // namespace
}  // namespace lightloom
