// The farm as its users run it: lightloom-server, lightloom-worker and lightloom as processes. Whatever happens on the way,
// the asset has the bytes of `lightloom bake`; what cannot be done is said in one line.
#include <fstream>
#include <map>
#include <memory>
#include <sstream>

#include "tests/support/loopback.h"
#include "tests/support/process.h"
#include "tests/support/program.h"
#include "tests/support/small_disk.h"
#include "tests/support/tcp_proxy.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using test::Process;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// Of a line of JSON.
int64_t number(const std::string& json, const std::string& key) {
  const size_t at = json.find("\"" + key + "\":");
  return at == std::string::npos ? -1 : std::stoll(json.substr(at + key.size() + 3));
}

/// Whether the process has a handler for the signal.
bool catches(pid_t process, int signal) {
  std::ifstream status("/proc/" + std::to_string(process) + "/status");
  for (std::string word; status >> word;) {
    if (word != "SigCgt:") continue;
    status >> word;
    return (std::stoull(word, nullptr, 16) >> (signal - 1) & 1) != 0;
  }
  return false;
}

using Words = std::vector<std::string>;

Words join(Words a, const Words& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

class ServerProgram {
 public:
  explicit ServerProgram(const Words& command) : process_(command) {
    const std::string line = process_.line_with("listening on ");
    EXPECT_NE(line, "") << process_.output();
    address_ = line.substr(line.rfind(' ') + 1);
  }
  const std::string& address() const { return address_; }
  Process& process() { return process_; }

 private:
  Process process_;
  std::string address_;
};

class Programs : public test::ProgramTest {
 protected:
  std::unique_ptr<ServerProgram> start_server(const std::string& state = "state", const Words& more = {}) {
    return std::make_unique<ServerProgram>(
        join({LIGHTLOOM_SERVER, "--listen", "127.0.0.1:0", "--state", path(state)}, more));
  }
  /// Of one thread; it has joined.
  static std::unique_ptr<Process> start_worker(const std::string& server, const std::string& name) {
    auto worker = std::make_unique<Process>(
        Words{LIGHTLOOM_WORKER, "--server", server, "--threads", "1", "--name", name, "--timeout", "60"});
    EXPECT_NE(worker->line_with(name + " joined"), "") << worker->output();
    return worker;
  }
  /// Follows a job.
  static std::unique_ptr<Process> start_watch(const std::string& server, const std::string& job) {
    return std::make_unique<Process>(Words{LIGHTLOOM_PROGRAM, "watch", job, "--server", server, "--json"});
  }
  static void wait_for_tasks_done(Process* watch, int64_t tasks) {
    EXPECT_NE(watch->line([&](const std::string& line) { return number(line, "tasks_done") >= tasks; }), "")
        << watch->output();
  }

  Words how(int rays = 64) const {
    return {"--texels-per-metre", "3",  "--relight-rays", "256", "--rays", std::to_string(rays),
            "--cell-receivers",   "128"};
  }
  /// The job's number, in words.
  std::string submit(const std::string& server, const std::string& scene, const Words& options) {
    const Result r = run(join({"submit", scene, "--server", server}, options));
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_THAT(r.out, StartsWith("job "));
    return r.out.substr(4, r.out.size() - 5);
  }
  void watch_to_its_end(const std::string& server, const std::string& job) {
    const Result r = run({"watch", job, "--server", server});
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_THAT(r.out, HasSubstr("job " + job + ": done after "));
  }
  static std::map<std::string, std::string> files_of(const fs::path& loom) {
    std::map<std::string, std::string> out;
    for (const auto& file : fs::recursive_directory_iterator(loom)) {
      if (file.is_regular_file()) out[fs::relative(file.path(), loom)] = test::text_of(file.path());
    }
    return out;
  }
  void expect_as_baked_here(const std::string& loom) {
    if (baked_.empty()) {
      const Result r = run(join({"bake", scene_, "-o", path("here.loom")}, how()));
      ASSERT_EQ(r.code, 0) << r.err;
      baked_ = files_of(path("here.loom"));
    }
    EXPECT_EQ(files_of(loom), baked_);
  }
  void expect_fetched_as_baked_here(const std::string& server, const std::string& job) {
    const std::string loom = path("fetched" + job + ".loom");
    const Result r = run({"fetch", job, "--server", server, "-o", loom});
    ASSERT_EQ(r.code, 0) << r.err;
    expect_as_baked_here(loom);
  }
  std::vector<Words> commands_on_job(const std::string& job) const {
    return {{"watch", job},
            {"events", job},
            {"cancel", job},
            {"set-priority", job, "2"},
            {"fetch", job, "-o", path("out.loom")}};
  }
  /// Each fails with one line that holds `what`, and leaves nothing.
  void all_fail(const std::string& server, const std::vector<Words>& commands, const std::string& what) {
    for (const Words& command : commands) {
      SCOPED_TRACE(command.front());
      fails(1, join(command, {"--server", server, "--timeout", "1"}), what);
    }
    EXPECT_FALSE(fs::exists(path("out.loom")));
  }
  void nobody_answers(const std::string& server) {
    std::vector<Words> commands = commands_on_job("1");
    commands.insert(commands.end(),
                    {{"list"}, {"workers"}, {"submit", scene_}, {"bake", scene_, "-o", path("out.loom")}});
    all_fail(server, commands, "is lightloom-server running there?");
  }
  /// The level, made long by bytes that mean nothing: a chunk of an unknown kind, which readers skip.
  std::string long_level(size_t bytes) {
    std::string glb = test::text_of(scene_);
    const auto word = [](uint32_t n) { return std::string(reinterpret_cast<const char*>(&n), sizeof n); };
    uint32_t state = 1;
    glb += word(static_cast<uint32_t>(bytes)) + "PADD";
    for (size_t i = 0; i < bytes; i += sizeof state) glb += word(state = state * 1664525 + 1013904223);
    glb.replace(8, 4, word(static_cast<uint32_t>(glb.size())));
    test::write(path("long.glb"), glb);
    return path("long.glb");
  }

  std::map<std::string, std::string> baked_;
};

TEST_F(Programs, OneTwoAndFourWorkersGiveTheSameBytes) {
  for (const int count : {1, 2, 4}) {
    // Each on a state of its own: nothing can be used again.
    const auto server = start_server("state" + std::to_string(count));
    std::vector<std::unique_ptr<Process>> workers;
    for (int i = 0; i < count; ++i) workers.push_back(start_worker(server->address(), "worker-" + std::to_string(i)));
    const std::string job = submit(server->address(), scene_, how());
    watch_to_its_end(server->address(), job);
    expect_fetched_as_baked_here(server->address(), job);
    for (const auto& worker : workers) EXPECT_EQ(worker->stop(SIGTERM), 0) << worker->output();
    EXPECT_EQ(server->process().stop(SIGTERM), 0) << server->process().output();
    fs::remove_all(path("fetched" + job + ".loom"));
  }
}

TEST_F(Programs, WorkersLeaveAndJoinOnTheWay) {
  const auto server = start_server();
  const std::string job = submit(server->address(), scene_, how());
  const auto watch = start_watch(server->address(), job);
  const auto first = start_worker(server->address(), "first");
  wait_for_tasks_done(watch.get(), 2);
  const auto second = start_worker(server->address(), "second");
  EXPECT_EQ(first->stop(SIGTERM), 0) << first->output();
  EXPECT_THAT(first->output(), HasSubstr("left "));
  wait_for_tasks_done(watch.get(), 6);
  const auto third = start_worker(server->address(), "third");
  EXPECT_EQ(watch->wait(), 0) << watch->output();
  expect_fetched_as_baked_here(server->address(), job);
  const std::string events = run({"events", job, "--server", server->address()}).out;
  EXPECT_THAT(events, HasSubstr("first"));
  EXPECT_THAT(events, HasSubstr("second"));
}

TEST_F(Programs, AKilledWorkerThatComesBackLosesNothingThatIsOnRecord) {
  const auto server = start_server();
  const std::string job = submit(server->address(), scene_, how());
  const auto watch = start_watch(server->address(), job);
  const auto worker = start_worker(server->address(), "worker");
  wait_for_tasks_done(watch.get(), 2);
  EXPECT_EQ(worker->stop(SIGKILL), -SIGKILL);
  // Under its old name it says that what it ran is lost; else the leases would have to end first.
  const auto again = start_worker(server->address(), "worker");
  EXPECT_EQ(watch->wait(), 0) << watch->output();
  expect_fetched_as_baked_here(server->address(), job);
}

TEST_F(Programs, AServerThatIsStoppedOrKilledGoesOnWhereItWas) {
  auto server = start_server();
  const std::string address = server->address(), job = submit(address, scene_, how());
  const auto watch = start_watch(address, job);
  const auto worker = start_worker(address, "worker");
  for (const int signal : {SIGTERM, SIGKILL}) {
    wait_for_tasks_done(watch.get(), signal == SIGTERM ? 2 : 4);
    EXPECT_EQ(server->process().stop(signal), signal == SIGTERM ? 0 : -SIGKILL);
    server = std::make_unique<ServerProgram>(Words{LIGHTLOOM_SERVER, "--listen", address, "--state", path("state")});
  }
  EXPECT_EQ(watch->wait(), 0) << watch->output();
  expect_fetched_as_baked_here(address, job);
}

TEST_F(Programs, BakeOnAFarmIsOneCommand) {
  const auto server = start_server();
  const auto worker = start_worker(server->address(), "worker");
  const Result r = run(join({"bake", scene_, "-o", path("farm.loom"), "--server", server->address(), "--json"}, how()));
  EXPECT_EQ(r.code, 0);
  EXPECT_EQ(r.err, "");
  EXPECT_EQ(number(r.out, "job"), 1);
  EXPECT_GT(number(r.out, "receivers"), 0);
  EXPECT_EQ(number(r.out, "transport"), -1) << "that is the workers' time";
  expect_as_baked_here(path("farm.loom"));
  const Result text =
      run(join({"bake", scene_, "-o", path("farm.loom"), "--fresh", "--server", server->address()}, how()));
  EXPECT_THAT(text.out, HasSubstr("as job 2: "));
  expect_as_baked_here(path("farm.loom"));

  fails(2, {"bake", scene_, "-o", path("x.loom"), "--server", server->address(), "--threads", "2"}, "--threads");
  fails(2, {"list", "--server", server->address(), "--timeout", "0"}, "--timeout");
  fails(2, {"bake", scene_, "-o", path("x.loom"), "--server", "localhost"}, "must be HOST:PORT");
}

TEST_F(Programs, CtrlCCancelsABakeOnAFarmAndASecondLeavesAtOnce) {
  const auto server = start_server();
  const Words bake =
      join({LIGHTLOOM_PROGRAM, "bake", scene_, "-o", path("out.loom"), "--server", server->address()}, how());
  const auto wait_for_job = [&](const std::string& id) {
    while (run({"list", "--server", server->address(), "--json"}).out.find("\"job\":" + id + ",") ==
           std::string::npos) {
    }
  };
  Process first(bake);
  wait_for_job("1");
  EXPECT_EQ(first.stop(SIGINT), 128 + SIGINT);
  EXPECT_EQ(std::count(first.output().begin(), first.output().end(), '\n'), 1) << first.output();
  EXPECT_THAT(first.output(), HasSubstr("job 1 at " + server->address() + " is cancelled"));
  EXPECT_THAT(run({"list", "--server", server->address()}).out, HasSubstr("cancelled"));
  EXPECT_FALSE(fs::exists(path("out.loom")));

  Process second(bake);
  wait_for_job("2");
  server->process().signal(SIGSTOP);  // so that it cannot answer the cancelling
  second.signal(SIGINT);
  while (catches(second.pid(), SIGINT)) {
  }
  EXPECT_EQ(second.stop(SIGINT), -SIGINT);
  server->process().signal(SIGCONT);
}

TEST_F(Programs, CancelEndsAJobAndFreesItsWorker) {
  const auto server = start_server();
  const auto worker = start_worker(server->address(), "worker");
  const std::string job = submit(server->address(), scene_, how(/*rays=*/16384));
  const auto watch = start_watch(server->address(), job);
  EXPECT_NE(watch->line([](const std::string& line) {
    return number(line, "tasks_done") >= 1 && number(line, "tasks_running") >= 1;
  }),
            "");
  EXPECT_EQ(run({"cancel", job, "--server", server->address()}).out, "job " + job + ": cancelled\n");
  EXPECT_EQ(watch->wait(), 1);
  EXPECT_THAT(watch->output(), HasSubstr("ended cancelled"));
  EXPECT_THAT(watch->output(), HasSubstr("lightloom events " + job + " --server " + server->address()));
  fails(1, {"fetch", job, "--server", server->address(), "-o", path("x.loom")}, "is cancelled");
  EXPECT_FALSE(fs::exists(path("x.loom")));

  const std::string next = submit(server->address(), scene_, how());
  watch_to_its_end(server->address(), next);
  expect_fetched_as_baked_here(server->address(), next);
}

TEST_F(Programs, JobsAndWorkersAreShown) {
  const auto server = start_server();
  const Words at = {"--server", server->address()};
  EXPECT_EQ(run(join({"list"}, at)).out, "no jobs\n");
  EXPECT_EQ(run(join({"workers"}, at)).out, "no workers\n");
  EXPECT_EQ(submit(server->address(), scene_, join(how(), {"--name", "hall"})), "1");
  EXPECT_THAT(run(join({"list"}, at)).out, HasSubstr("hall  0 of 1 tasks, waiting for a worker\n"));
  EXPECT_EQ(run(join({"set-priority", "1", "-7"}, at)).out, "job 1: priority -7\n");
  EXPECT_EQ(number(run(join({"list", "--json"}, at)).out, "priority"), -7);

  const auto worker = start_worker(server->address(), "worker");
  watch_to_its_end(server->address(), "1");
  EXPECT_THAT(run(join({"workers"}, at)).out, HasSubstr("worker "));
  EXPECT_EQ(number(run(join({"workers", "--json"}, at)).out, "threads"), 1);
  EXPECT_THAT(run(join({"events", "1"}, at)).out, HasSubstr("assemble"));
  const Result again = run(join({"watch", "1"}, at));
  EXPECT_THAT(again.out, StartsWith("job 1: done after "));
}

TEST_F(Programs, WhatWatchPrintsWithoutATerminal) {
  const auto server = start_server();
  // Too long to be done between two lines.
  const std::string job = submit(server->address(), scene_, how(/*rays=*/16384));
  Process watch({LIGHTLOOM_PROGRAM, "watch", job, "--server", server->address()});
  EXPECT_EQ(watch.line_with("tasks"), "0 of 1 tasks, waiting for a worker");
  const auto worker = start_worker(server->address(), "worker");
  EXPECT_NE(watch.line_with(" running on 1 worker"), "") << watch.output();
  run({"cancel", job, "--server", server->address()});
  EXPECT_EQ(watch.wait(), 1);
  EXPECT_THAT(watch.output(), HasSubstr("job 1: cancelled after "));
}

TEST_F(Programs, WhatIsNoAddressIsNotCalled) {
  std::vector<Words> commands = commands_on_job("1");
  commands.insert(commands.end(), {{"list"}, {"workers"}, {"submit", scene_}});
  for (const Words& command : commands) {
    SCOPED_TRACE(command.front());
    for (const char* server : {"", "localhost", "localhost:", ":7000", "host:0", "host:65536", "host:http", "::1:7000",
                               "unix:/a/socket:1"}) {
      fails(2, join(command, {"--server", server}), "must be HOST:PORT");
    }
  }
}

TEST_F(Programs, AWorkersCommandLineIsCheckedBeforeAnyServerIsAsked) {
  const std::vector<std::pair<Words, std::string>> bad = {
      {{}, "--server is required; see lightloom-worker --help\n"},
      {{"--server", "x", "--threads", "0"}, "--threads must be 1 to 1024\n"},
      {{"--server", "x", "--threads", "1e3"}, "--threads '1e3' must be a whole number"},
      {{"--server", "x", "--timeout", "3601"}, "--timeout must be 1 to 3600\n"},
      {{"--server", "x", "--name", "a b"}, "letters, digits"},
      {{"--server", "x", "--memory", "1X"}, "'1X' is no size"},
      {{"--server", "x", "y"}, "not expected: y; see lightloom-worker --help\n"}};
  for (const auto& [options, what] : bad) {
    Process worker(join({LIGHTLOOM_WORKER}, options));
    EXPECT_EQ(worker.wait(), 2) << what;
    EXPECT_THAT(worker.output(), HasSubstr(what));
    EXPECT_THAT(worker.output(), StartsWith("lightloom-worker: "));
    EXPECT_EQ(std::count(worker.output().begin(), worker.output().end(), '\n'), 1) << worker.output();
  }
}

TEST_F(Programs, NobodyListens) {
  std::string address;
  { address = test::Listener().address(); }
  nobody_answers(address);
  Process worker({LIGHTLOOM_WORKER, "--server", address, "--timeout", "1"});
  EXPECT_EQ(worker.wait(), 1);
  EXPECT_THAT(worker.output(), HasSubstr("is lightloom-server running there?"));
}

TEST_F(Programs, SomethingThatNeverAnswersListens) {
  const test::Listener listener;
  nobody_answers(listener.address());
}

TEST_F(Programs, AWebServerListens) {
  const test::Answering web([](int client) {
    char request[1024];
    if (::read(client, request, sizeof request) <= 0) return;
    const std::string answer = "HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n";
    EXPECT_GT(::send(client, answer.data(), answer.size(), MSG_NOSIGNAL), 0);
  });
  nobody_answers(web.address());
}

TEST_F(Programs, AServerOfAnotherMethodIsOfNoUse) {
  const ServerProgram server({OTHER_METHOD_SERVER, path("state")});
  const Words at = {"--server", server.address()};
  fails(1, join({"submit", scene_}, at), "install the same release");
  fails(1, join({"bake", scene_, "-o", path("x.loom")}, at), "install the same release");
  EXPECT_FALSE(fs::exists(path("x.loom")));
  EXPECT_EQ(run(join({"list"}, at)).out, "no jobs\n");
  Process worker(join({LIGHTLOOM_WORKER}, at));
  EXPECT_EQ(worker.wait(), 1);
  EXPECT_THAT(worker.output(), HasSubstr("install the same release"));
}

TEST_F(Programs, JobsThatAreNotThere) {
  const auto server = start_server();
  all_fail(server->address(), commands_on_job("77"), "no job 77");
}

TEST_F(Programs, WhatIsNotDoneIsNotFetched) {
  const auto server = start_server();
  const std::string job = submit(server->address(), scene_, how());
  fails(1, {"fetch", job, "--server", server->address(), "-o", path("x.loom")},
        "lightloom watch " + job + " --server " + server->address());
  EXPECT_FALSE(fs::exists(path("x.loom")));
}

TEST_F(Programs, PlacesThatTakeNoAsset) {
  const auto server = start_server();
  const auto worker = start_worker(server->address(), "worker");
  const std::string job = submit(server->address(), scene_, how());
  watch_to_its_end(server->address(), job);
  const auto fetch = [&](const std::string& to) {
    return Words{"fetch", job, "--server", server->address(), "-o", to};
  };
  test::write(path("file"), "");
  fails(1, fetch(path("file")), "is not a folder");
  fails(1, fetch(path("file/x.loom")), "file");
  fails(1, fetch("/proc/nothing/x.loom"), "/proc");
}

TEST_F(Programs, WhatIsNoLevelIsNotSubmitted) {
  const auto server = start_server();
  test::write(path("notes.glb"), "These are my holiday notes.\n");
  test::write(path("level.gltf"), "{}");
  for (const Words& command : std::initializer_list<Words>{{"submit"}, {"bake", "-o", path("x.loom")}}) {
    fails(1, join(command, {path("notes.glb"), "--server", server->address()}), "notes.glb");
    fails(1, join(command, {path("nothing.glb"), "--server", server->address()}), "nothing.glb");
    fails(2, join(command, {path("level.gltf"), "--server", server->address()}), "must be a .glb");
  }
  EXPECT_FALSE(fs::exists(path("x.loom")));
  EXPECT_EQ(run({"list", "--server", server->address()}).out, "no jobs\n");
}

TEST_F(Programs, AnUploadThatIsCutGoesOn) {
  const auto server = start_server();
  const auto worker = start_worker(server->address(), "worker");
  constexpr size_t kSize = 16 << 20, kCut = 12 << 20;
  const std::string level = long_level(kSize);
  std::atomic<uint64_t> bytes = 0;
  std::atomic<bool> cut = false;
  const test::TcpProxy proxy(server->address(), [&](std::span<char> piece, bool to_server) {
    if (to_server) bytes += piece.size();
    return bytes >= kCut && !cut.exchange(true) ? test::TcpProxy::Go::kCut : test::TcpProxy::Go::kOn;
  });
  const std::string job = submit(proxy.address(), level, how());
  EXPECT_TRUE(cut);
  EXPECT_LT(bytes, kCut + kSize - (1 << 20)) << "all was sent again";
  watch_to_its_end(server->address(), job);
  expect_fetched_as_baked_here(server->address(), job);
}

TEST_F(Programs, TwoServersDoNotShareAStateFolder) {
  const auto server = start_server();
  Process second({LIGHTLOOM_SERVER, "--listen", "127.0.0.1:0", "--state", path("state")});
  EXPECT_EQ(second.wait(), 1);
  EXPECT_THAT(second.output(), HasSubstr("another server uses the state folder " + path("state")));
  EXPECT_EQ(std::count(second.output().begin(), second.output().end(), '\n'), 1) << second.output();
  EXPECT_EQ(run({"list", "--server", server->address()}).code, 0);
}

TEST_F(Programs, OtherMachinesReachAServerOnlyIfTheUserSaysSo) {
  Process refused({LIGHTLOOM_SERVER, "--listen", "0.0.0.0:0", "--state", path("state")});
  EXPECT_EQ(refused.wait(), 1);
  EXPECT_THAT(refused.output(), HasSubstr("--insecure"));
  Process open({LIGHTLOOM_SERVER, "--listen", "0.0.0.0:0", "--state", path("state"), "--insecure"});
  EXPECT_NE(open.line_with("[warning] --insecure: whoever reaches 0.0.0.0:"), "") << open.output();
  const std::string line = open.line_with("listening on ");
  const std::string port = line.substr(line.rfind(':'));
  EXPECT_EQ(run({"list", "--server", "127.0.0.1" + port}).code, 0);
}

class FullDisks : public Programs {
 protected:
  void SetUp() override {
    Programs::SetUp();
    disk_ = std::make_unique<test::SmallDisk>(path("small"), "8m");
    if (!disk_->mounted()) GTEST_SKIP() << "this user may not mount a small file system to fill";
  }

  std::unique_ptr<test::SmallDisk> disk_;
};

TEST_F(FullDisks, AtTheServer) {
  const auto server = start_server("small/state", {"--min-free", "0"});
  const Words at = {"--server", server->address(), "--timeout", "2"};
  const std::string line = fails(1, join({"submit", long_level(16 << 20)}, at), server->address());
  EXPECT_THAT(line, HasSubstr("No space left"));
  EXPECT_EQ(run(join({"list"}, at)).out, "no jobs\n");
  // It goes on.
  const auto worker = start_worker(server->address(), "worker");
  const std::string job = submit(server->address(), scene_, how());
  watch_to_its_end(server->address(), job);
  expect_fetched_as_baked_here(server->address(), job);
}

TEST_F(FullDisks, WhereAnAssetIsFetched) {
  const auto server = start_server();
  const auto worker = start_worker(server->address(), "worker");
  const std::string job = submit(server->address(), scene_, how());
  watch_to_its_end(server->address(), job);
  test::write(path("small/ballast"), std::string((8 << 20) - (128 << 10), '-'));
  const std::string loom = path("small/x.loom");
  EXPECT_THAT(fails(1, {"fetch", job, "--server", server->address(), "-o", loom}, "No space left"), HasSubstr(loom));
  EXPECT_FALSE(fs::exists(loom + "/manifest"));
  // What is there is not fetched again.
  fs::remove(path("small/ballast"));
  EXPECT_EQ(run({"fetch", job, "--server", server->address(), "-o", loom}).code, 0);
  expect_as_baked_here(loom);
}

}  // namespace
}  // namespace lightloom
