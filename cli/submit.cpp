// lightloom submit: a level's bake becomes a job of a farm.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/bake_options.h"
#include "cli/command.h"
#include "cli/farm_client.h"
#include "cli/farm_print.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "cli/level.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/base/file.h"

namespace lightloom {
namespace {

struct Options {
  std::string scene, server, name;
  BakeOptions how;
  int priority = 0;
  bool json = false;
};

absl::Status check(Options* o) {
  LL_RETURN_IF_ERROR(o->how.check());
  LL_RETURN_IF_ERROR(check_input(o->scene));
  if (std::filesystem::path(o->scene).extension() == ".glb") return absl::OkStatus();
  return absl::InvalidArgumentError(o->scene + " must be a .glb, which holds all of the level: export it as one");
}

absl::Status run(const Options& o) {
  cancel_on_interrupt();
  LL_RETURN_IF_ERROR(load_level(o.scene).status());  // what is wrong with it is said here, not by a worker
  LL_ASSIGN_OR_RETURN(const std::vector<uint8_t> bytes, read_file(o.scene));
  FarmClient farm(o.server);
  ProgressBar bar;
  const std::string name = o.name.empty() ? std::filesystem::path(o.scene).stem().string() : o.name;
  LL_ASSIGN_OR_RETURN(const RemoteJob job, farm.submit(bytes, o.how.params, name, o.priority, [&](uint64_t there) {
    bar.update("upload", there, bytes.size());
  }));
  bar.finish();
  if (o.json) {
    print_json(to_json(job));
  } else {
    std::printf("job %llu\n", static_cast<unsigned long long>(job.id));
  }
  return absl::OkStatus();
}

}  // namespace

Command submit_command() {
  const auto o = std::make_shared<Options>();
  std::vector<Option> options = {{"SCENE", "level, .glb", &o->scene, true},
                                 {"--server", "HOST:PORT of lightloom-server", &o->server, true},
                                 {"--name", "for people; empty: the level's", &o->name},
                                 {"--priority", "higher ones first", &o->priority}};
  for (Option& option : o->how.options()) options.push_back(std::move(option));
  options.push_back({"--json", "print the job as JSON", &o->json});
  return {"submit", "Bake a level on a farm: print the job's number", std::move(options),
          [o] { return check(o.get()); }, [o] { return run(*o); }};
}

}  // namespace lightloom
