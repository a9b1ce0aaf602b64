// A worker beside a server whose answers the test writes, over real gRPC; and tasks that ask for very many others.
#include "bake-worker/worker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <latch>
#include <mutex>
#include <set>

#include "proto/worker_service.grpc.pb.h"
#include "tests/cluster/farm_fixture.h"

namespace lightloom {
namespace {

using test::FarmTest;
using test::RunningWorker;
using test::value_or_die;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using OnSync = std::function<grpc::Status(const v1::SyncRequest&, v1::SyncResponse*)>;
using OnTask = std::function<absl::StatusOr<TaskOutput>(const BakeTask&, const BakeControl&)>;

/// Answers Syncs by `on_sync`, and acknowledges what each of them reports.
class ScriptedServer final : public v1::WorkerService::Service {
 public:
  explicit ScriptedServer(OnSync on_sync) : on_sync_(std::move(on_sync)) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  ~ScriptedServer() override { server_->Shutdown(std::chrono::system_clock::now()); }
  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }

  grpc::Status Sync(grpc::ServerContext*, const v1::SyncRequest* request, v1::SyncResponse* response) override {
    const std::lock_guard lock(mutex_);
    response->set_sequence(++answers_);
    for (const auto& f : request->finished()) response->add_acknowledged(f.attempt());
    for (const auto& f : request->failed()) response->add_acknowledged(f.attempt());
    for (const std::string& r : request->released()) response->add_acknowledged(r);
    return on_sync_(*request, response);
  }

 private:
  const OnSync on_sync_;
  std::mutex mutex_;
  uint64_t answers_ = 0;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

class ScriptedExecutor final : public TaskExecutor {
 public:
  explicit ScriptedExecutor(OnTask on_task) : on_task_(std::move(on_task)) {}
  absl::StatusOr<TaskOutput> run(const BakeTask& task, const BakeControl& control) override {
    return on_task_(task, control);
  }

 private:
  const OnTask on_task_;
};

absl::StatusOr<TaskOutput> until_cancelled(const BakeControl& control) {
  while (!control.cancel->cancelled()) std::this_thread::yield();
  return absl::CancelledError("cancelled");
}

void assign(const std::string& attempt, const std::string& payload, v1::SyncResponse* response) {
  auto* a = response->add_assignments();
  a->set_attempt(attempt);
  a->set_kind(attempt);
  a->set_payload(payload);
}

/// A worker of one thread, and what it said of trouble.
class ScriptedTest : public testing::Test {
 protected:
  /// Until the script drains it.
  absl::Status run_worker(const OnSync& on_sync, const OnTask& on_task) {
    ScriptedServer server(on_sync);
    ScriptedExecutor executor(on_task);
    Worker worker(dial(server.address()), &executor, {"worker", introduce_this_machine(1), [&](const auto& what) {
                                                        const std::lock_guard lock(mutex_);
                                                        troubles_.push_back(what);
                                                      }});
    worker_ = &worker;
    ready_.count_down();
    return worker.run();
  }
  Worker& worker() {
    ready_.wait();
    return *worker_;
  }

  std::vector<std::string> troubles_;

 private:
  std::mutex mutex_;
  std::latch ready_{1};
  Worker* worker_ = nullptr;
};

TEST_F(ScriptedTest, TroubleIsToldOnceForEachReasonAndThatItEnds) {
  int calls = 0;
  const absl::Status ended = run_worker(
      [&](const v1::SyncRequest&, v1::SyncResponse*) -> grpc::Status {
        switch (++calls) {
          case 1:
          case 3:
            return {grpc::StatusCode::RESOURCE_EXHAUSTED, "too long"};
          case 2:
            return {grpc::StatusCode::ABORTED, "a newer Sync is here"};
          case 4:
            return {grpc::StatusCode::UNAVAILABLE, "database is locked"};
          case 6:
            worker().drain();
            return grpc::Status::OK;
          default:
            return grpc::Status::OK;
        }
      },
      [](const BakeTask&, const BakeControl&) { return TaskOutput(); });
  EXPECT_TRUE(ended.ok()) << ended;
  EXPECT_THAT(troubles_, ElementsAre(HasSubstr("until it does: too long"),
                                     HasSubstr("until it does: database is locked"), "the server answers again"));
}

TEST_F(ScriptedTest, WhatArrivesWhileItDrainsIsHandedBack) {
  std::set<std::string> ran, released;
  const absl::Status ended = run_worker(
      [&](const v1::SyncRequest& request, v1::SyncResponse* response) {
        released.insert(request.released().begin(), request.released().end());
        if (request.sequence() == 1) assign("first", "level", response);
        if (request.finished_size() > 0) {
          worker().drain();
          assign("late", "level", response);
          response->add_warm("another level");
        }
        return grpc::Status::OK;
      },
      [&](const BakeTask& task, const BakeControl&) {
        ran.insert(task.kind);
        return TaskOutput();
      });
  EXPECT_TRUE(ended.ok()) << ended;
  EXPECT_THAT(ran, ElementsAre("first"));
  EXPECT_THAT(released, ElementsAre("late"));
  EXPECT_THAT(troubles_, IsEmpty());
}

TEST_F(ScriptedTest, AWarmUpEndsWhenWorkOfAnotherLevelComes) {
  std::latch warming(1), cancelled(1);
  std::atomic<bool> warm_ended{false};
  bool other_given = false;
  const absl::Status ended = run_worker(
      [&](const v1::SyncRequest& request, v1::SyncResponse* response) {
        if (request.sequence() == 1) {
          response->add_warm("level");
          return grpc::Status::OK;
        }
        warming.wait();
        for (const auto& f : request.finished()) {
          if (f.attempt() == "other") worker().drain();
        }
        if (request.sequence() == 2) {
          EXPECT_EQ(request.room(), 1u) << "a warm-up takes no room";
          EXPECT_EQ(request.running_size(), 0);
          assign("same", "level", response);
        } else if (request.room() > 0 && !other_given) {
          other_given = true;
          assign("other", "another level", response);
        }
        return grpc::Status::OK;
      },
      [&](const BakeTask& task, const BakeControl& control) -> absl::StatusOr<TaskOutput> {
        if (task.kind == "warm") {
          warming.count_down();
          const auto output = until_cancelled(control);
          warm_ended = true;
          cancelled.count_down();
          return output;
        }
        EXPECT_FALSE(task.kind == "same" && warm_ended) << "it is of use";
        if (task.kind == "other") cancelled.wait();
        return TaskOutput();
      });
  EXPECT_TRUE(ended.ok()) << ended;
  EXPECT_TRUE(warm_ended);
}

TEST_F(ScriptedTest, ManyFailuresInARowAreToldOnce) {
  constexpr int kTasks = 12;
  int given = 0, failed = 0;
  const absl::Status ended = run_worker(
      [&](const v1::SyncRequest& request, v1::SyncResponse* response) {
        failed += request.failed_size();
        if (failed == kTasks) worker().drain();
        for (uint32_t i = 0; i < request.room() && given < kTasks; ++i) {
          assign(std::to_string(given++), "level", response);
        }
        return grpc::Status::OK;
      },
      [](const BakeTask&, const BakeControl&) { return absl::NotFoundError("no such level"); });
  EXPECT_TRUE(ended.ok()) << ended;
  EXPECT_THAT(troubles_, ElementsAre("10 tasks in a row failed here, the last one: no such level"));
}

/// A farm whose tasks are of no method.
class ManyTasksTest : public FarmTest {
 protected:
  static std::unique_ptr<TaskExecutor> plans(uint32_t count) {
    return std::make_unique<ScriptedExecutor>(
        [count](const BakeTask& task, const BakeControl& control) -> absl::StatusOr<TaskOutput> {
          if (task.kind != "plan") return until_cancelled(control);
          TaskOutput output;
          for (uint32_t i = 0; i < count; ++i) {
            output.spawned.push_back({"cell", 1, std::vector<uint8_t>(40, static_cast<uint8_t>(i)), i});
          }
          return output;
        });
  }
};

TEST_F(ManyTasksTest, ATaskMayAskForFiftyThousand) {
  const RunningWorker worker(dial(address()), plans(50'000), "worker", 1);
  FarmClient client(address());
  uint64_t tasks = 0;
  const RemoteJob job = watch(submit().id, [&](const RemoteJob& now) {
    if (now.tasks <= 1 || tasks > 0) return;
    tasks = now.tasks;
    value_or_die(client.cancel(now.id));
  });
  EXPECT_EQ(job.state, "cancelled") << job.error;
  EXPECT_EQ(tasks, 50'001u);
  EXPECT_EQ(job.done, 1u);
}

TEST_F(ManyTasksTest, AListThatIsMissingOrNoneFailsTheAttempt) {
  const RemoteJob job = submit();
  const auto stub = v1::WorkerService::NewStub(dial(address()));
  const std::string text = "\xff no list";
  const Digest other = value_or_die(farm_->blobs().put(std::vector<uint8_t>(text.begin(), text.end())));
  v1::SyncRequest request;
  to_proto(introduce_this_machine(1), request.mutable_who());
  request.set_worker("talks");
  request.set_incarnation(1);
  request.set_room(1);
  request.set_wait_ms(30'000);
  for (const std::string& blob : {to_bytes(sha256("missing")), to_bytes(other), std::string("short")}) {
    request.set_sequence(request.sequence() + 1);
    grpc::ClientContext first, second;
    v1::SyncResponse given, heard;
    ASSERT_TRUE(stub->Sync(&first, request, &given).ok());
    ASSERT_EQ(given.assignments_size(), 1);
    v1::SyncRequest finished = request;
    finished.set_sequence(request.sequence() + 1);
    finished.set_seen(given.sequence());
    finished.set_room(0);
    auto* f = finished.add_finished();
    f->set_attempt(given.assignments(0).attempt());
    f->set_tasks_blob(blob);
    ASSERT_TRUE(stub->Sync(&second, finished, &heard).ok());
    EXPECT_THAT(heard.acknowledged(), ElementsAre(f->attempt()));
    request.set_sequence(finished.sequence());
    request.set_seen(heard.sequence());
  }
  FarmClient client(address());
  std::vector<std::string> failures;
  for (const RemoteEvent& e : value_or_die(client.events(job.id))) {
    if (e.what.starts_with("failed")) failures.push_back(e.what);
  }
  EXPECT_THAT(failures, ElementsAre(HasSubstr("there is no blob"), HasSubstr("is no list of tasks"),
                                    HasSubstr("a digest must have 32 bytes")));
}

}  // namespace
}  // namespace lightloom
