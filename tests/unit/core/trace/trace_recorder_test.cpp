// Whatever segment was written down, every cell that it passes through is in the trace.
#include "core/trace/trace_recorder.h"

#include <gtest/gtest.h>

#include <vector>

#include "core/base/rng.h"
#include "core/base/sampling.h"

namespace lightloom {
namespace {

constexpr Aabb kLevel{{-4, 0, -3}, {6, 5, 7}};

WorldGrid grid() { return WorldGrid::around(kLevel, 2); }

Vec3 somewhere(Rng* rng, const Aabb& box) {
  Vec3 p;
  for (int a = 0; a < 3; ++a) p[a] = box.lo[a] + (box.hi[a] - box.lo[a]) * rng->next_float();
  return p;
}

std::vector<uint8_t> shares_of(const Trace& trace) {
  std::vector<uint8_t> shares(trace.grid.cells(), 0);
  trace.for_each_run([&](uint32_t at, uint32_t cells, uint8_t share) {
    for (uint32_t i = 0; i < cells; ++i) shares[at + i] = share;
  });
  return shares;
}

/// Cells along the segment, within the grid, that the trace lacks.
int missing(const Trace& trace, Vec3 from, Vec3 to) {
  const std::vector<uint8_t> shares = shares_of(trace);
  constexpr int kSteps = 500;
  int count = 0;
  for (int i = 0; i <= kSteps; ++i) {
    const GridCell cell = trace.grid.cell_at(from + (to - from) * (static_cast<float>(i) / kSteps));
    if (trace.grid.contains(cell)) count += shares[trace.grid.index(cell)] == 0;
  }
  return count;
}

TEST(TraceRecorder, HoldsEveryRayToWhatItHit) {
  Rng rng(1);
  for (int n = 0; n < 200; ++n) {
    TraceRecorder recorder(grid(), 0);
    std::vector<std::pair<Vec3, Vec3>> rays;
    for (int i = 0; i < 5; ++i) {
      const Vec3 from = somewhere(&rng, kLevel), to = somewhere(&rng, kLevel);
      recorder.from({from, from});
      recorder.hit(to, 0);
      rays.push_back({from, to});
    }
    const Trace trace = recorder.finish({});
    EXPECT_EQ(trace.sky, 0);
    for (const auto& [from, to] : rays) ASSERT_EQ(missing(trace, from, to), 0);
  }
}

TEST(TraceRecorder, HoldsEveryRayToTheSky) {
  Rng rng(2);
  for (uint32_t n = 0; n < 300; ++n) {
    TraceRecorder recorder(grid(), 0);
    const Vec3 from = somewhere(&rng, kLevel), direction = sphere_direction(n, 300);
    recorder.from({from, from});
    recorder.sky(direction);
    const Trace trace = recorder.finish({});
    EXPECT_EQ(trace.sky, kWholeShare);
    ASSERT_EQ(missing(trace, from, from + direction * 30), 0) << n;
  }
}

TEST(TraceRecorder, HoldsTheWayOfEveryProbeThatWasAsked) {
  Rng rng(3);
  for (int n = 0; n < 100; ++n) {
    std::vector<Vec3> probes;
    for (int i = 0; i < 70; ++i) probes.push_back(somewhere(&rng, kLevel));
    TraceRecorder recorder(grid(), probes.size());
    const Vec3 from = somewhere(&rng, kLevel), hit = somewhere(&rng, kLevel);
    const float reach = 0.7f;
    recorder.from({from, from});
    const auto place = recorder.hit(hit, reach);
    recorder.ask(place, 3);
    recorder.ask(place, 69);
    const auto sky = recorder.sky({0, 1, 0});
    recorder.ask(sky, 10);
    const Trace trace = recorder.finish(probes);
    ASSERT_EQ(missing(trace, from, hit), 0);
    for (int i = 0; i < 10; ++i) {
      const Vec3 near = hit + sphere_direction(static_cast<uint32_t>(i), 10) * reach;
      ASSERT_EQ(missing(trace, near, probes[3]), 0);
      ASSERT_EQ(missing(trace, near, probes[69]), 0);
    }
    ASSERT_EQ(missing(trace, probes[10], probes[10] + Vec3{0, 30, 0}), 0);
  }
}

TEST(TraceRecorder, SaysThatSomethingLeftTheGrid) {
  // A probe that stands outside, and a search that reaches out; rays to the sky there are none.
  const Vec3 inside{0, 1, 0}, outside{9.5f, 2, 0};
  TraceRecorder asked(grid(), 1);
  asked.from({inside, inside});
  const auto place = asked.hit({5.9f, 1, 0}, 0);
  asked.ask(place, 0);
  EXPECT_EQ(asked.finish({&outside, 1}).sky, 1);

  TraceRecorder searched(grid(), 0);
  searched.from({inside, inside});
  searched.hit({5.9f, 1, 0}, 3);
  EXPECT_EQ(searched.finish({}).sky, 1);

  TraceRecorder neither(grid(), 1);
  neither.from({inside, inside});
  neither.ask(neither.hit({5.9f, 1, 0}, 0.5f), 0);
  EXPECT_EQ(neither.finish({&inside, 1}).sky, 0);
}

TEST(TraceRecorder, SaysLittleMoreThanIsTrue) {
  TraceRecorder recorder(grid(), 0);
  recorder.from({{-3.5f, 0.5f, 0.5f}, {-3.5f, 0.5f, 0.5f}});
  recorder.hit({5.5f, 0.5f, 0.5f}, 0);
  uint64_t crossed = 0;
  for (const uint8_t share : shares_of(recorder.finish({}))) crossed += share > 0;
  EXPECT_GE(crossed, 10u);
  EXPECT_LE(crossed, 100u) << "a straight ray along ten cells";
}

TEST(TraceRecorder, CellsHaveTheShareOfTheirRays) {
  TraceRecorder recorder(grid(), 0);
  const Vec3 from{0.5f, 0.5f, 0.5f};
  recorder.from({from, from});
  for (int i = 0; i < 3; ++i) recorder.hit({0.5f, 4.5f, 0.5f}, 0);
  recorder.hit({5.5f, 0.5f, 0.5f}, 0);
  const Trace trace = recorder.finish({});
  const std::vector<uint8_t> shares = shares_of(trace);
  const auto share_at = [&](Vec3 p) { return share_of(shares[trace.grid.index(trace.grid.cell_at(p))]); };
  EXPECT_EQ(share_at(from), 1);
  EXPECT_EQ(share_at({0.5f, 4.5f, 0.5f}), 0.5);  // of three quarters, the power of two below
  EXPECT_EQ(share_at({5.5f, 0.5f, 0.5f}), 0.25);
  EXPECT_EQ(share_at({-3.5f, 0.5f, 0.5f}), 0);
}

TEST(Trace, RoundTrip) {
  TraceRecorder recorder(grid(), 0);
  recorder.from(kLevel);
  recorder.hit({1, 1, 1}, 0);
  recorder.sky({0, 1, 0});
  const Trace trace = recorder.finish({});
  ByteWriter writer;
  write_trace(trace, &writer);
  const auto bytes = std::move(writer).take();
  ByteReader reader(bytes);
  const auto read = read_trace(&reader);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_TRUE(reader.at_end());
  EXPECT_EQ(*read, trace);
}

}  // namespace
}  // namespace lightloom
