// As PowerLossFarm.Anywhere, at many more places.
#include <gtest/gtest.h>

#include "tests/faults/power_loss_farm.h"

namespace lightloom::test {
namespace {

TEST_F(PowerLossFarm, AtManyPlaces) { lose_power_at(300); }

}  // namespace
}  // namespace lightloom::test
