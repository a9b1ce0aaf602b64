#include "core/asset/chunk.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/base/sampling.h"
#include "tests/unit/core/asset/samples.h"

namespace lightloom {
namespace {

using ::lightloom::testing::sample_cell;
using ::lightloom::testing::sample_relight;
using ::lightloom::testing::sample_surface;

void expect_equal(const CellChunk& a, const CellChunk& b) {
  EXPECT_EQ(a.order, b.order);
  EXPECT_EQ(a.probe_count, b.probe_count);
  EXPECT_EQ(a.objects, b.objects);
  EXPECT_EQ(a.receivers, b.receivers);
  EXPECT_EQ(a.uniform, b.uniform);
  EXPECT_EQ(a.near_counts, b.near_counts);
  EXPECT_EQ(a.near_texels, b.near_texels);
  EXPECT_EQ(a.near_weights, b.near_weights);
  ASSERT_EQ(a.clusters.size(), b.clusters.size());
  for (size_t i = 0; i < a.clusters.size(); ++i) {
    const CellChunk::Cluster &c = a.clusters[i], &d = b.clusters[i];
    EXPECT_EQ(c.first_receiver, d.first_receiver) << i;
    EXPECT_EQ(c.receivers, d.receivers) << i;
    EXPECT_EQ(c.probes, d.probes) << i;
    EXPECT_EQ(c.correction, d.correction) << i;
    EXPECT_EQ(c.projection, d.projection) << i;
    EXPECT_EQ(c.reconstruction, d.reconstruction) << i;
    EXPECT_EQ(c.bounds.lo, d.bounds.lo) << i;
    EXPECT_EQ(c.bounds.hi, d.bounds.hi) << i;
    EXPECT_EQ(c.error, d.error) << i;
  }
}

void expect_cell_round_trip(const CellChunk& c) {
  const auto back = decode_cell(encode_cell(c));
  ASSERT_TRUE(back.ok()) << back.status();
  expect_equal(c, *back);
}

TEST(CellChunk, RoundTrip) { expect_cell_round_trip(sample_cell()); }

TEST(CellChunk, EmptyRoundTrip) { expect_cell_round_trip({}); }

TEST(CellChunk, EveryOrderRoundTrips) {
  for (uint32_t order = 0; order <= kMaxShOrder; ++order) {
    CellChunk c = sample_cell();
    c.order = order;
    const size_t stride = static_cast<size_t>(sh_stride(static_cast<int>(order)));
    for (CellChunk::Cluster& k : c.clusters) {
      k.projection.assign(k.rank() * k.probes.size() * stride, float_to_half(0.5f));
    }
    expect_cell_round_trip(c);
  }
}

TEST(CellChunk, SingleReceiverAndRank0RoundTrip) {
  CellChunk c;
  c.order = 7;
  c.objects = {{lightloom::testing::digest_of(1), 1, 1}};
  c.receivers = {{0, 1}};
  c.uniform = {12345};
  c.near_counts = {0};
  c.clusters.resize(1);
  c.clusters[0].receivers = 1;
  c.clusters[0].bounds.extend({1, 2, 3});
  expect_cell_round_trip(c);  // without probes either
  c.probe_count = 2;
  c.clusters[0].probes = {1, 0};
  expect_cell_round_trip(c);
}

TEST(CellChunk, ArraysStartAtMultiplesOf16) {
  const auto bytes = encode_cell(sample_cell());
  // 2 objects, 5 receivers, 2 clusters, 3 cluster probes, 3 columns, 40 and 24 halfs; 5 counts of 3 near texels.
  EXPECT_EQ(bytes.size(), 64u + 80 + 48 + 16 + 96 + 16 + 16 + 80 + 48 + 16 + 16 + 6);
}

TEST(RelightChunk, RoundTrip) {
  const RelightChunk c = sample_relight();
  const auto back = decode_relight(encode_relight(c));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->position, c.position);
  EXPECT_EQ(back->objects, c.objects);
  EXPECT_EQ(back->rays, c.rays);
}

TEST(RelightChunk, EmptyAndSingleRayRoundTrip) {
  const auto empty = decode_relight(encode_relight({}));
  ASSERT_TRUE(empty.ok()) << empty.status();
  EXPECT_TRUE(empty->rays.empty());
  RelightChunk sky;
  sky.rays = {RelightChunk::kSky};
  const auto one = decode_relight(encode_relight(sky));
  ASSERT_TRUE(one.ok()) << one.status();
  EXPECT_EQ(one->rays, sky.rays);
}

TEST(SurfaceChunk, RoundTrip) {
  const SurfaceChunk c = sample_surface();
  const auto back = decode_surface(encode_surface(c));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->object, c.object);
  EXPECT_EQ(back->keys, c.keys);
  EXPECT_EQ(back->positions, c.positions);
  EXPECT_EQ(back->normals, c.normals) << "axes are exact";
  EXPECT_EQ(back->areas, c.areas);
}

TEST(SurfaceChunk, EmptyRoundTrip) {
  SurfaceChunk c;
  c.object = {lightloom::testing::digest_of(2), 16384, 16384};
  const auto back = decode_surface(encode_surface(c));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_TRUE(back->keys.empty());
}

TEST(SurfaceChunk, NormalsComeBackWithin1e4) {
  SurfaceChunk c;
  c.object = {lightloom::testing::digest_of(2), 100, 100};
  Rng rng(1);
  for (uint32_t i = 0; i < 20000; ++i) {
    const float u = rng.next_float();
    Vec3 n = square_to_sphere(u, rng.next_float());
    if (i % 4 == 1) n = normalize({n.x, n.y, 0});  // the fold
    c.keys.push_back(i);
    c.normals.push_back(n);
    c.positions.push_back({});
    c.areas.push_back(1);
  }
  const auto back = decode_surface(encode_surface(c));
  ASSERT_TRUE(back.ok()) << back.status();
  for (size_t i = 0; i < c.normals.size(); ++i) {
    ASSERT_LT(length(back->normals[i] - c.normals[i]), 1e-4f) << i;
    ASSERT_NEAR(length(back->normals[i]), 1, 1e-6f) << i;
  }
}

}  // namespace
}  // namespace lightloom
