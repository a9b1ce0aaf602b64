#include "runtime/decoder.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/base/sh.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom {
namespace {

using testing::SyntheticAsset;

constexpr double kPiD = 3.14159265358979323846;

/// One 3 × 1 object whose front texels 0 and 2 and back texel 1 (key 4) are surface: elements 0, 1, 2 are
/// keys 0, 2, 4. Two probes with two rays each, along z = +1/2 and z = -1/2:
///   probe 0: element 0, element 2;   probe 1: the sky, nothing.
/// One cell whose probe list is {1, 0}, with the receivers key 4 and key 0. One cluster of one column.
struct Tiny {
  SyntheticAsset asset;
  CellChunk cell;

  explicit Tiny(int order) : asset(testing::empty_asset(order, 2)) {
    const ChunkObject object = asset.add_object(3, 1, {0, 2, 4});
    RelightChunk probe;
    probe.objects = {object};
    probe.rays = {0, 4};
    asset.add_probe(probe);
    probe.position = {1, 0, 0};
    probe.rays = {RelightChunk::kSky, RelightChunk::kDead};
    asset.add_probe(probe);

    cell.order = static_cast<uint32_t>(order);
    cell.probe_count = 2;
    cell.objects = {object};
    cell.receivers = {{0, 4}, {0, 0}};
    cell.uniform = {65535, 13107};  // 1 and 1/5
    cell.near_counts = {0, 0};
    CellChunk::Cluster cluster;
    cluster.receivers = 2;
    cluster.probes = {1, 0};  // of the cell's list: manifest probes 0 and 1
    cluster.bounds.extend({0, 0, 0});
    cluster.correction = {0.25f};
    cluster.projection.assign(2 * static_cast<size_t>(sh_stride(order)), 0);
    cluster.reconstruction.assign(8, 0);
    cluster.reconstruction[0] = float_to_half(2);
    cluster.reconstruction[1] = float_to_half(-0.5f);
    cell.clusters = {cluster};
  }
  /// projection[0][i][j]
  Half& projection(size_t i, size_t j) {
    return cell.clusters[0].projection[i * static_cast<size_t>(sh_stride(asset.manifest.params.order)) + j];
  }
  DecodedFrame decode(const SurfaceLight& light, const std::vector<Vec3>& previous) {
    asset.add_cell(cell, {1, 0});
    const auto source = asset.open();
    EXPECT_TRUE(source.ok()) << source.status();
    const auto loaded = load_decoder_asset(*source);
    EXPECT_TRUE(loaded.ok()) << loaded.status();
    return decode_frame(*loaded, light, previous);
  }
};

SurfaceLight dark(size_t elements) {
  SurfaceLight light;
  light.direct.resize(elements);
  light.albedo.resize(elements);
  light.emission.resize(elements);
  return light;
}

void expect_near(Vec3 actual, double x, double y, double z) {
  EXPECT_NEAR(actual.x, x, 2e-6 * (1 + std::abs(x)));
  EXPECT_NEAR(actual.y, y, 2e-6 * (1 + std::abs(y)));
  EXPECT_NEAR(actual.z, z, 2e-6 * (1 + std::abs(z)));
}

TEST(Decoder, RadiosityIsReflectedDirectAndIndirectPlusEmission) {
  SurfaceLight light = dark(3);
  light.direct[1] = {2, 0, 1};
  light.albedo[1] = {0.5f, 0.5f, 0.25f};
  light.emission[1] = {0, 3, 1};
  const DecodedFrame frame = Tiny(0).decode(light, {{}, {4, 6, 3}, {}});
  // 0.5/π·(2+4); 0.5/π·(0+6) + 3; 0.25/π·(1+3) + 1
  expect_near(frame.radiosity[1], 3 / kPiD, 3 / kPiD + 3, 1 / kPiD + 1);
  expect_near(frame.radiosity[0], 0, 0, 0);
}

TEST(Decoder, OneCellByHand) {
  Tiny tiny(0);
  tiny.projection(0, 0) = float_to_half(0.5f);    // manifest probe 0
  tiny.projection(1, 0) = float_to_half(-0.25f);  // manifest probe 1
  SurfaceLight light = dark(3);
  light.emission[0] = {1, 0, 0};
  light.emission[2] = {3, 2, 0};
  light.environment = {0, 4, 8};
  const DecodedFrame frame = tiny.decode(light, std::vector<Vec3>(3));

  // λ_0 = 4π/2 · 1/√(4π) · ΣL = √π · ΣL: probe 0 sees (1,0,0) + (3,2,0), probe 1 (0,4,8) + nothing.
  const double root_pi = std::sqrt(kPiD);
  ASSERT_EQ(frame.lambda.size(), 2u);
  expect_near(frame.lambda[0], 4 * root_pi, 2 * root_pi, 0);
  expect_near(frame.lambda[1], 0, 4 * root_pi, 8 * root_pi);
  // c_0 = √(4π)·Σλ ÷ (4π·2) = ¼·Σ of the ΣL = (1, 1.5, 2).
  // c_1 = ½λ_0 − ¼λ_1 − ¼c_0.
  const double c1[] = {2 * root_pi - 0.25, 0 - 0.375, -2 * root_pi - 0.5};
  // Receiver 0 is key 4, element 2: E = π·c_0 + 2·c_1. Receiver 1 is key 0, element 0: E = π/5·c_0 − ½·c_1.
  expect_near(frame.irradiance[2], kPiD + 2 * c1[0], 1.5 * kPiD + 2 * c1[1], 2 * kPiD + 2 * c1[2]);
  expect_near(frame.irradiance[0], kPiD / 5 - c1[0] / 2, 0.3 * kPiD - c1[1] / 2, 0.4 * kPiD - c1[2] / 2);
  // Element 1 has no receiver.
  expect_near(frame.irradiance[1], 0, 0, 0);
}

TEST(Decoder, NearFieldByHand) {
  Tiny tiny(0);
  tiny.cell.near_counts = {1, 2};
  tiny.cell.near_texels = {0, 2, 4};  // elements 0, 1, 2
  tiny.cell.near_weights = {13107, 6553, 26214};
  SurfaceLight light = dark(3);
  light.emission = {{1, 0, 0}, {0, 2, 0}, {0, 0, 5}};
  const DecodedFrame without = Tiny(0).decode(light, std::vector<Vec3>(3));
  const DecodedFrame frame = tiny.decode(light, std::vector<Vec3>(3));
  // Receiver 0 is element 2, receiver 1 is element 0.
  const Vec3 first = frame.irradiance[2] - without.irradiance[2], second = frame.irradiance[0] - without.irradiance[0];
  expect_near(first, kPiD / 5, 0, 0);
  expect_near(second, 0, 2 * kPiD * 6553 / 65535, 5 * kPiD * 0.4);
}

TEST(Decoder, FirstBandByHand) {
  Tiny tiny(1);
  tiny.projection(0, 2) = float_to_half(1);  // Y_10 = √(3/4π)·z
  tiny.cell.clusters[0].correction = {0};
  SurfaceLight light = dark(3);
  light.emission[0] = {1, 1, 1};
  light.emission[2] = {5, 3, 1};
  const DecodedFrame frame = tiny.decode(light, std::vector<Vec3>(3));
  // λ_10 of probe 0 = 4π/2 · √(3/4π) · ½ · (L_up − L_down) = ½·√(3π)·(1−5, 1−3, 0)
  const double half_root = std::sqrt(3 * kPiD) / 2;
  expect_near(frame.lambda[2], -4 * half_root, -2 * half_root, 0);
  // c_0 = ¼·ΣL = (1.5, 1, 0.5); E of element 2 = π·c_0 + 2·λ_10.
  expect_near(frame.irradiance[2], 1.5 * kPiD - 8 * half_root, kPiD - 4 * half_root, 0.5 * kPiD);
}

TEST(Decoder, UniformFieldIsExactWhateverTheMatricesHold) {
  testing::RandomAssetOptions options;
  options.order = 4;
  options.closed = true;
  const SyntheticAsset asset = testing::random_asset(options);
  const auto loaded = load_decoder_asset(*asset.open());
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  SurfaceLight light = dark(loaded->surface_elements);
  for (Vec3& e : light.emission) e = {1, 2, 4};
  const DecodedFrame frame = decode_frame(*loaded, light, std::vector<Vec3>(loaded->surface_elements));
  for (const Vec3 e : frame.irradiance) expect_near(e, kPiD, 2 * kPiD, 4 * kPiD);
}

TEST(Decoder, FurnaceConvergesToTheGeometricSum) {
  testing::RandomAssetOptions options;
  options.closed = true;
  const SyntheticAsset asset = testing::random_asset(options);
  const auto loaded = load_decoder_asset(*asset.open());
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  SurfaceLight light = dark(loaded->surface_elements);
  for (Vec3& l : light.emission) l = {1, 1, 2};
  for (Vec3& a : light.albedo) a = {0.5f, 0.8f, 0};
  std::vector<Vec3> e(loaded->surface_elements);
  for (int i = 0; i < 60; ++i) e = decode_frame(*loaded, light, e).irradiance;
  // E = πL ÷ (1 − a); 0.8^60 < 2e-6.
  for (const Vec3 v : e) {
    EXPECT_NEAR(v.x, 2 * kPiD, 1e-4);
    EXPECT_NEAR(v.y, 5 * kPiD, 1e-4);
    EXPECT_NEAR(v.z, 2 * kPiD, 1e-4);
  }
}

TEST(Decoder, ThreadsDoNotChangeTheResult) {
  const SyntheticAsset asset = testing::random_asset({});
  const auto loaded = load_decoder_asset(*asset.open());
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  const SurfaceLight light = testing::random_light(loaded->surface_elements, 3);
  const std::vector<Vec3> none(loaded->surface_elements);
  Parallel one, three;
  one.threads = 1;
  three.threads = 3;
  EXPECT_EQ(decode_frame(*loaded, light, none, one).irradiance, decode_frame(*loaded, light, none, three).irradiance);
}

}  // namespace
}  // namespace lightloom
