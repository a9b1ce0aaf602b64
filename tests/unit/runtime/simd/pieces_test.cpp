// The small parts: threads and turns.
#include <gtest/gtest.h>

#include <vector>

#include "runtime/simd/turns.h"
#include "runtime/simd/worker_pool.h"

namespace lightloom::simd {
namespace {

TEST(WorkerPool, EachTaskOnceRoundAfterRound) {
  for (const int threads : {1, 2, 5}) {
    WorkerPool pool(threads);
    for (uint32_t tasks = 0; tasks < 200; ++tasks) {
      std::vector<std::atomic<int>> done(tasks);
      pool.run(tasks, [&](uint32_t i) { done[i].fetch_add(1); });
      for (const auto& d : done) ASSERT_EQ(d.load(), 1);
    }
  }
}

std::vector<uint32_t> taken(Turns* turns, uint32_t most) {
  const auto span = turns->take(most);
  return {span.begin(), span.end()};
}

TEST(Turns, RoundRobin) {
  Turns turns(std::pmr::new_delete_resource(), 5);
  for (const uint32_t i : {0u, 1u, 3u, 4u, 3u}) turns.add(i);
  EXPECT_EQ(turns.waiting(), 4u);
  EXPECT_EQ(taken(&turns, 2), (std::vector<uint32_t>{0, 1}));
  // 0 waits again, but those that have waited longer come first.
  turns.add(0);
  EXPECT_EQ(taken(&turns, 2), (std::vector<uint32_t>{3, 4}));
  turns.add(2);
  turns.remove(2);
  EXPECT_EQ(taken(&turns, 0), (std::vector<uint32_t>{0}));
  EXPECT_EQ(turns.waiting(), 0u);
  EXPECT_TRUE(taken(&turns, 3).empty());
}

}  // namespace
}  // namespace lightloom::simd
