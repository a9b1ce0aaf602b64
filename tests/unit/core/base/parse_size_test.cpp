#include "core/base/parse_size.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace lightloom {
namespace {

using testing::HasSubstr;

TEST(ParseSize, UnitsArePowersOf1024) {
  EXPECT_EQ(*parse_size("0"), 0u);
  EXPECT_EQ(*parse_size("17"), 17u);
  EXPECT_EQ(*parse_size("17B"), 17u);
  EXPECT_EQ(*parse_size("4K"), 4096u);
  EXPECT_EQ(*parse_size("500M"), 500u << 20);
  EXPECT_EQ(*parse_size("20G"), uint64_t{20} << 30);
  EXPECT_EQ(*parse_size("1.5G"), uint64_t{3} << 29);
  EXPECT_EQ(*parse_size("2T"), uint64_t{2} << 40);
  EXPECT_EQ(*parse_size("32MB"), uint64_t{32} << 20);
  EXPECT_EQ(*parse_size("3GiB"), uint64_t{3} << 30);
}

TEST(ParseSize, AnythingElseIsRefusedInOneLine) {
  for (const char* text : {"", "G", "-1", "+1", "1 G", "1Gb", "1BB", "1iB", "1GiBB", "1g", "1e3", "0x10", "nan", "inf",
                           "9999999999T", "1\n"}) {
    const auto size = parse_size(text);
    ASSERT_FALSE(size.ok()) << text;
    EXPECT_EQ(std::string(size.status().message()).find('\n'), std::string::npos);
    EXPECT_THAT(std::string(size.status().message()), HasSubstr("500M"));
  }
}

TEST(ParseSeconds, UnitsAreSecondsMinutesHoursAndDays) {
  EXPECT_EQ(*parse_seconds("0"), 0);
  EXPECT_EQ(*parse_seconds("90"), 90);
  EXPECT_EQ(*parse_seconds("90s"), 90);
  EXPECT_EQ(*parse_seconds("15m"), 900);
  EXPECT_EQ(*parse_seconds("12h"), 43'200);
  EXPECT_EQ(*parse_seconds("1.5d"), 129'600);
  for (const char* text : {"", "d", "-1d", "1w", "1 d", "1dd", "99999999999d"}) {
    const auto seconds = parse_seconds(text);
    ASSERT_FALSE(seconds.ok()) << text;
    EXPECT_THAT(std::string(seconds.status().message()), HasSubstr("30d"));
  }
}

TEST(SizeText, HasOneDigitAfterThePoint) {
  EXPECT_EQ(size_text(0), "0 B");
  EXPECT_EQ(size_text(1023), "1023 B");
  EXPECT_EQ(size_text(1536), "1.5 KiB");
  EXPECT_EQ(size_text(uint64_t{20} << 30), "20.0 GiB");
  EXPECT_EQ(size_text(uint64_t{5000} << 40), "5000.0 TiB");
}

}  // namespace
}  // namespace lightloom
