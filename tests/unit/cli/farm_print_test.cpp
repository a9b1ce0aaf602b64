#include "cli/farm_print.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cli/progress.h"

namespace lightloom {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

RemoteJob running_job() {
  RemoteJob job;
  job.id = 7;
  job.state = "running";
  job.tasks = 650;
  job.done = 12;
  return job;
}

TEST(FarmPrint, ARunningJobInALine) {
  RemoteJob job = running_job();
  EXPECT_EQ(progress_line(job), "12 of 650 tasks, waiting for a worker");
  job.running = 2;
  job.workers = 1;
  EXPECT_EQ(progress_line(job), "12 of 650 tasks, 2 running on 1 worker");
  job.running = 0;
  EXPECT_EQ(progress_line(job), "12 of 650 tasks, waiting for a worker") << "who worked on it may be gone";
  job.running = 2;
  job.reused = 5;
  job.failed = 1;
  job.workers = 2;
  job.rays_per_second = 2'310'000;
  EXPECT_EQ(progress_line(job), "12 of 650 tasks (5 reused), 1 failed, 2 running on 2 workers, 2.31 Mrays/s");
  job.state = "partial";
  EXPECT_EQ(progress_line(job), "12 of 650 tasks (5 reused), 1 failed");
}

TEST(FarmPrint, HowAJobEnded) {
  RemoteJob job = running_job();
  job.state = "done";
  EXPECT_TRUE(how_it_ended(job, "farm:7000").ok());
  job.state = "failed";
  job.error = "level.glb is cut";
  EXPECT_EQ(how_it_ended(job, "farm:7000").message(),
            "job 7 ended failed: level.glb is cut; see lightloom events 7 --server farm:7000");
}

TEST(FarmPrint, AWorkerInALine) {
  RemoteWorker worker;
  worker.id = "anna-1";
  worker.threads = 8;
  worker.running = 2;
  worker.silent_ms = 60'000;
  EXPECT_THAT(worker_line(worker), StartsWith("anna-1 "));
  EXPECT_THAT(worker_line(worker), HasSubstr("  2 of 8 threads busy, heard "));
  worker.draining = true;
  EXPECT_THAT(worker_line(worker), EndsWith(" ago, leaving"));
  worker.silent_ms = 60'001;
  EXPECT_THAT(worker_line(worker), HasSubstr("  gone, heard "));
  EXPECT_THAT(worker_line(worker), EndsWith(" ago"));
}

TEST(Eta, IsSaidOnceSomethingWasDone) {
  Eta eta;
  EXPECT_EQ(eta.text(3, 10), "");
  EXPECT_THAT(eta.text(4, 10), StartsWith("ETA "));
  EXPECT_EQ(eta.text(4, 20), "") << "more to do than was thought: what went before says nothing";
  EXPECT_THAT(eta.text(5, 20), HasSubstr("ETA"));
  EXPECT_EQ(eta.text(20, 20), "");
}

}  // namespace
}  // namespace lightloom
