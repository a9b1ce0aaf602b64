// Of the bounds, 0.022 (1 bounce) and 0.044 (32) are the noise of the bakes. A known difference remains in
// the ratio, +0.3 %: where an interpolated normal leans, Cycles loses the directions that enter the surface;
// leave() mirrors them.
#include "tests/statistical/against_cycles.h"

namespace lightloom {
namespace {

class SponzaAgainstCycles : public testing::TestWithParam<test::CyclesCase> {};

TEST_P(SponzaAgainstCycles, Agrees) { test::check_against_cycles(GetParam()); }

INSTANTIATE_TEST_SUITE_P(Bakes, SponzaAgainstCycles,
                         testing::Values(test::CyclesCase{"sponza", 1, 256, 1024, 0.05},
                                         test::CyclesCase{"sponza", 32, 256, 512, 0.08}),
                         test::case_name);

}  // namespace
}  // namespace lightloom
