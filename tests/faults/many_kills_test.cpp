// As kills_test.cpp, twenty of each over four jobs or more.
#include "tests/faults/kills.h"

namespace lightloom::test {
namespace {

constexpr int kKills = 20;
constexpr size_t kJobs = 4;

TEST_F(Kills, ManyWorkers) { kill_workers(kKills, kJobs); }
TEST_F(Kills, ManyCoordinators) { kill_servers(kKills, kJobs); }
TEST_F(Kills, ManyOfBothAtOnce) { kill_both(kKills, kJobs); }

}  // namespace
}  // namespace lightloom::test
