// lightloom-server as its owner runs it: upkeep beside a server that works, and errors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bake-server/store/sqlite_store.h"
#include "bake-server/upkeep/upkeep_lock.h"
#include "tests/support/process.h"
#include "tests/support/program.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

class ServerProgramTest : public test::ProgramTest {
 protected:
  /// It listens.
  std::unique_ptr<test::Process> serve(const std::string& state) {
    auto server = std::make_unique<test::Process>(
        std::vector<std::string>{LIGHTLOOM_PROGRAM, "--listen", "127.0.0.1:0", "--state", path(state)});
    EXPECT_NE(server->line_with("listening on "), "") << server->output();
    return server;
  }
  /// Without --json there is nothing else on stdout.
  std::string line_of(const std::vector<std::string>& arguments) {
    const Result r = run(arguments);
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_EQ(r.err, "");
    return r.out;
  }
};

TEST_F(ServerProgramTest, GcAndBackupRunBesideAServer) {
  const auto server = serve("state");
  test::write(path("state/blobs/uploads/left"), "over");
  EXPECT_THAT(line_of({"gc", "--state", path("state"), "--grace", "0", "--dry-run"}),
              "would free 4 B: 0 blobs and 1 cut upload; 0 blobs stay (0 B)\n");
  EXPECT_EQ(line_of({"gc", "--state", path("state")}), "freed 0 B: 0 blobs and 0 cut uploads; 0 blobs stay (0 B)\n");
  EXPECT_EQ(line_of({"gc", "--state", path("state"), "--grace", "0"}),
            "freed 4 B: 0 blobs and 1 cut upload; 0 blobs stay (0 B)\n");
  EXPECT_EQ(line_of({"backup", "--state", path("state"), "--to", path("copy")}),
            "backed up to " + path("copy") + ": 0 blobs, 0 B, 0 of them linked\n");
  const auto another = serve("copy");
  EXPECT_EQ(another->stop(SIGTERM), 0);
  EXPECT_EQ(server->stop(SIGTERM), 0);
  EXPECT_THAT(line_of({"gc", "--state", path("copy")}), HasSubstr("freed")) << "no server is needed";
}

TEST_F(ServerProgramTest, ASecondServerOnAFolderIsRefused) {
  const auto server = serve("state");
  fails(1, {"--listen", "127.0.0.1:0", "--state", path("state")},
        "another server uses the state folder " + path("state"));
}

TEST_F(ServerProgramTest, AStateFolderThatCannotBeWritten) {
  test::write(path("file"), "x");
  for (const std::string& state : {path("file"), path("file/state"), std::string("/proc/state")}) {
    fails(1, {"--listen", "127.0.0.1:0", "--state", state}, "cannot use the state folder " + state);
  }
}

TEST_F(ServerProgramTest, FoldersThatAreNoStateFolder) {
  fs::create_directory(path("empty"));
  for (const std::string& state : {path("empty"), path("nowhere")}) {
    fails(1, {"gc", "--state", state}, state + " is no state folder");
    fails(1, {"backup", "--state", state, "--to", path("copy")}, state + " is no state folder");
  }
  EXPECT_TRUE(fs::is_empty(path("empty")));
  EXPECT_FALSE(fs::exists(path("copy")));
}

TEST_F(ServerProgramTest, ABackupReplacesNothing) {
  serve("state")->stop(SIGTERM);
  fs::create_directory(path("copy"));
  test::write(path("copy/mine"), "x");
  fails(1, {"backup", "--state", path("state"), "--to", path("copy")}, "name a new folder");
  EXPECT_EQ(test::text_of(path("copy/mine")), "x");
}

TEST_F(ServerProgramTest, ABackupWithoutABlobIsThereAndSaysSo) {
  serve("state")->stop(SIGTERM);
  fails(1, {"backup", "--state", path("state"), "--to", path("state/copy")}, "lies in the state folder");
  const std::string gone(64, 'a');
  {
    const auto store = open_sqlite_store(path("state"), Durability::kProcess);
    ASSERT_TRUE(store.ok()) << store.status();
    NewJob job;
    job.request_id = "1";
    job.inputs.emplace_back().bytes.fill(0xaa);
    job.tasks.emplace_back().kind = "plan";
    ASSERT_TRUE((*store)->submit(job, 1).ok());
  }
  fails(1, {"backup", "--state", path("state"), "--to", path("copy")}, gone);
  EXPECT_EQ(serve("copy")->stop(SIGTERM), 0);
}

TEST_F(ServerProgramTest, OneGcAtATime) {
  serve("state")->stop(SIGTERM);
  const auto lock = UpkeepLock::take(path("state"));
  ASSERT_TRUE(lock.ok()) << lock.status();
  fails(1, {"gc", "--state", path("state")}, "try again when it is done");
}

TEST_F(ServerProgramTest, ACommandLineThatCannotBeRead) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> bad = {
      {{}, "--state is required"},
      {{"gc"}, "--state is required"},
      {{"backup", "--state", "x"}, "--to is required"},
      {{"--state", "x", "--retain", "1w"}, "'1w' is no time"},
      {{"--state", "x", "--min-free", "much"}, "'much' is no size"},
      {{"--state", "x", "--quota", "-1"}, "'-1' is no size"},
      {{"gc", "--state", "x", "--grace", "soon"}, "'soon' is no time"},
      {{"--stat", "x"}, "see lightloom-server --help"},
      {{"gc", "--state", "x", "--force"}, "see lightloom-server gc --help"},
      {{"--state", "x", "gc", "--state", "y"}, "--state before gc"},
      {{"--insecure", "backup", "--state", "x", "--to", "y"}, "--insecure before backup"}};
  for (const auto& [arguments, what] : bad) fails(2, arguments, what);
  EXPECT_FALSE(fs::exists(path("x")));
}

}  // namespace
}  // namespace lightloom
