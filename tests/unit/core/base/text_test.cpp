#include "core/base/text.h"

#include <gtest/gtest.h>

namespace lightloom {
namespace {

TEST(Printable, KeepsPlainTextAndUtf8) { EXPECT_EQ(printable("a b/c.glb, 3 m² …"), "a b/c.glb, 3 m² …"); }

TEST(Printable, EscapesWhatWouldBreakALine) { EXPECT_EQ(printable("a\nb\t\x1b'"), "a\\nb\\t\\033\\'"); }

TEST(Printable, CutsLongText) { EXPECT_EQ(printable("abcdef", 3), "abc..."); }

TEST(Printable, DoesNotCutAtTheExactLength) { EXPECT_EQ(printable("abc", 3), "abc"); }

TEST(Printable, NeverCutsACharacterInHalf) {
  EXPECT_EQ(printable("aé", 2), "a...");  // é is two bytes
  EXPECT_EQ(printable("\x80\x80\x80", 1), "...");
}

TEST(EscapeControls, LeavesQuotesAndUtf8) {
  EXPECT_EQ(escape_controls("a\n\"b\" 'c' \x1b[1m \x7f …"), "a\\n\"b\" 'c' \\033[1m \\177 …");
}

}  // namespace
}  // namespace lightloom
