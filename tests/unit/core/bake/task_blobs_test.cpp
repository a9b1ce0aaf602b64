// What tasks say to each other decodes to what was encoded, or not at all.
#include "core/bake/task_blobs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/bake/task_list.h"
#include "tests/unit/core/bake/hostile_bytes.h"

namespace lightloom {
namespace {

using test::with;
using ::testing::HasSubstr;

std::vector<FinishedTask> some_tasks() {
  return {{"cell", {1, 2, 3}, {sha256("a"), sha256("b")}}, {"plan", {}, {sha256("c")}}, {"x", {9}, {}}};
}

TEST(TaskList, RoundTrip) {
  const auto tasks = decode_task_list(encode_task_list(some_tasks()));
  ASSERT_TRUE(tasks.ok()) << tasks.status();
  EXPECT_EQ(*tasks, some_tasks());
  EXPECT_TRUE(decode_task_list(encode_task_list({}))->empty());
}

TEST(TaskList, RefusesOtherLengthsAndCounts) {
  const auto bytes = encode_task_list(some_tasks());
  test::expect_exact_length(bytes, decode_task_list);
  for (const size_t offset : {0, 4, 8}) test::expect_count_checked(bytes, offset, decode_task_list);
  // How the text is shared out is for its readers to check: it must only stay inside.
  for (const size_t offset : {16, 20, 24}) {
    for (const uint32_t wrong : {40u, 0x7fffffffu, 0xffffffffu}) {
      EXPECT_FALSE(decode_task_list(with(bytes, offset, wrong)).ok()) << wrong << " at " << offset;
    }
  }
}

TEST(TaskBlobs, RoundTrip) {
  BakePayload payload{sha256("scene"), sl17_params()};
  payload.params.seed = 12345;
  EXPECT_EQ(*decode_payload(encode_payload(payload)), payload);
  const TaskArgument argument{sha256("plan"), 3, 16};
  EXPECT_EQ(*decode_argument(encode_argument(argument)), argument);
  const PlanSummary summary{sha256("plan"), 1000, 7, 20, 3};
  EXPECT_EQ(*decode_plan_summary(encode_plan_summary(summary)), summary);
  const std::vector<ChunkRef> refs{{sha256("a"), 1}, {}, {sha256("b"), 2}};
  EXPECT_EQ(*decode_chunk_refs(encode_chunk_refs(refs)), refs);
  const EarlierResults earlier{sha256("traces"), 0.25};
  EXPECT_EQ(*decode_earlier_results(encode_earlier_results(earlier)), earlier);
  const ReusedResults reused{sha256("traces"), {{3, 0.5f}, {}}, {{0, 0}}};
  EXPECT_EQ(*decode_reused_results(encode_reused_results(reused)), reused);
}

TEST(TaskBlobs, RefuseOtherLengths) {
  test::expect_exact_length(encode_payload({}), decode_payload);
  test::expect_exact_length(encode_argument({}), decode_argument);
  test::expect_exact_length(encode_plan_summary({}), decode_plan_summary);
  const auto refs = encode_chunk_refs({{sha256("a"), 1}, {sha256("b"), 2}});
  test::expect_exact_length(refs, decode_chunk_refs);
  test::expect_count_checked(refs, 8, decode_chunk_refs);
  test::expect_count_checked(refs, 12, decode_chunk_refs);
  test::expect_exact_length(encode_earlier_results({}), decode_earlier_results);
  EXPECT_FALSE(decode_earlier_results(with(encode_earlier_results({}), 40, 1.5)).ok()) << "a tolerance is a share";
  const auto reused = encode_reused_results({{}, {{3, 0.5f}, {}}, {{0, 0}}});
  test::expect_exact_length(reused, decode_reused_results);
  test::expect_count_checked(reused, 40, decode_reused_results);
  test::expect_count_checked(reused, 44, decode_reused_results);
  EXPECT_FALSE(decode_reused_results(with(reused, 52, -1.0f)).ok()) << "staleness is a share";
}

TEST(TaskBlobs, PayloadRefusesBadParametersAndOtherMethods) {
  const auto error = [](const std::vector<uint8_t>& bytes) {
    const std::string message(decode_payload(bytes).status().message());
    EXPECT_EQ(message.find('\n'), message.npos);
    return message;
  };
  const auto bytes = encode_payload({});
  EXPECT_THAT(error(with(bytes, 40, 7u)), HasSubstr("payload: --method"));
  EXPECT_THAT(error(with(bytes, 44, 100)), HasSubstr("payload: --order"));
  EXPECT_THAT(error(with(bytes, 48, std::numeric_limits<float>::quiet_NaN())), HasSubstr("payload: --spacing"));
  EXPECT_THAT(error(with(bytes, 52, -2.0f)), HasSubstr("payload: --near-field"));
  EXPECT_THAT(error(with(bytes, 64, -1)), HasSubstr("payload: --rays"));
  EXPECT_THAT(error(with(bytes, 112, '\n')), HasSubstr("asks for method '\\n"));
  EXPECT_THAT(error(with(bytes, 104, 0u)), HasSubstr("length"));
  EXPECT_THAT(error(with(bytes, 104, 0xffffffffu)), HasSubstr("length"));
  EXPECT_THAT(error({}), HasSubstr("payload is corrupt"));
}

}  // namespace
}  // namespace lightloom
