#include "bake-worker/default_name.h"

#include <gtest/gtest.h>

#include <string>

#include "proto/worker_name.h"

namespace lightloom {
namespace {

TEST(DefaultName, HostProcessAndRandomDigits) {
  EXPECT_EQ(worker_name("node-7.farm_a", 12, 0xabc00f1), "node-7.farm_a-12-00f1");
  EXPECT_EQ(worker_name("", 1, 0xffff), "worker-1-ffff");
}

TEST(DefaultName, KeepsToTheRuleWhateverTheHostIsCalled) {
  EXPECT_EQ(worker_name("m\xc3\xbc hle!", 1, 0), "m---hle--1-0000");
  EXPECT_TRUE(is_worker_name(worker_name(std::string(253, '~'), 4194304, 0xffffffff)));
  EXPECT_TRUE(is_worker_name(default_worker_name()));
}

TEST(WorkerName, OneTo64LettersDigitsDotsDashesUnderscores) {
  EXPECT_TRUE(is_worker_name("Az09._-"));
  EXPECT_TRUE(is_worker_name(std::string(64, 'x')));
  for (const std::string& bad : {std::string(), std::string(65, 'x'), std::string("a b"), std::string("\xc3\xbc"),
                                 std::string("a/b"), std::string("a\0", 2)}) {
    EXPECT_FALSE(is_worker_name(bad)) << bad;
  }
}

}  // namespace
}  // namespace lightloom
