// The program itself, run as users run it.
#pragma once

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "core/scene/builtin.h"
#include "core/scene/gltf.h"
#include "tests/support/baked_level.h"

namespace lightloom::test {

inline std::string text_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void write(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

/// Runs the program in a folder that holds a level.
class ProgramTest : public ::testing::Test {
 protected:
  struct Result {
    int code = -1;  ///< -signal if one ended it
    std::string out, err;
  };

  void SetUp() override {
    scene_ = (folder_.path() / "level.glb").string();
    ASSERT_TRUE(save_gltf(*builtin_scene("cornell"), scene_).ok());
  }

  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }

  /// Starts it; `prepare` runs in the child before.
  pid_t start(const std::vector<std::string>& arguments, const std::string& out = "",
              const std::function<void()>& prepare = {}) {
    std::vector<char*> argv = {const_cast<char*>(LIGHTLOOM_PROGRAM)};
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    const std::string out_path = out.empty() ? path("out.txt") : out, err_path = path("err.txt"),
                      cwd = folder_.path().string();
    const pid_t child = ::fork();
    if (child == 0) {
      const int o = ::open(out_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
      const int e = ::open(err_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
      if (o < 0 || e < 0 || ::chdir(cwd.c_str()) != 0) ::_exit(126);
      ::dup2(o, STDOUT_FILENO);
      ::dup2(e, STDERR_FILENO);
      if (prepare) prepare();
      ::execv(LIGHTLOOM_PROGRAM, argv.data());
      ::_exit(127);
    }
    return child;
  }
  Result finish(pid_t child) {
    int status = 0;
    EXPECT_EQ(::waitpid(child, &status, 0), child);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), text_of(path("out.txt")),
            text_of(path("err.txt"))};
  }
  Result run(const std::vector<std::string>& arguments, const std::string& out = "") {
    return finish(start(arguments, out));
  }

  /// It fails with this code, and one line that holds `what`. Returns the line.
  std::string fails(int code, const std::vector<std::string>& arguments, const std::string& what,
                    const std::function<void()>& prepare = {}) {
    const Result r = finish(start(arguments, "", prepare));
    EXPECT_EQ(r.code, code) << r.err;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_THAT(r.err, ::testing::EndsWith("\n"));
    EXPECT_THAT(r.err, ::testing::HasSubstr(what));
    return r.err;
  }

  std::string baked() {
    const std::string loom = path("level.loom");
    const Result r = run({"bake", scene_, "-o", loom, "--texels-per-metre", "2", "--rays", "16", "--relight-rays", "64",
                          "--max-rank", "4"});
    EXPECT_EQ(r.code, 0) << r.err;
    return loom;
  }

  TemporaryFolder folder_;
  std::string scene_;
};

}  // namespace lightloom::test
