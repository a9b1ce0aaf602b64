#include "core/bake/canary.h"

#include <gtest/gtest.h>

#include "tests/support/baked_level.h"

namespace lightloom {
namespace {

TEST(Canary, IsTheKnownOneEachTimeOnAnyNumberOfThreads) {
  for (const int threads : {1, 2, 1}) {
    EXPECT_EQ(test::value_or_die(bake_canary(threads)).hex(), kCanary.hex())
        << "bakes have other bytes: change kMethodVersion, then kCanary to this";
  }
}

TEST(Canary, AnyChangeOfTheBakeChangesIt) {
  BakeParams params = canary_params();
  params.seed = 1;
  EXPECT_NE(test::value_or_die(bake_canary(2, params)), kCanary);
  params = canary_params();
  params.threshold *= 2;
  EXPECT_NE(test::value_or_die(bake_canary(2, params)), kCanary);
}

}  // namespace
}  // namespace lightloom
