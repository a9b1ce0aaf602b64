// lightloom submit: a level's bake becomes a job of a farm.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "cli/bake_options.h"
#include "cli/farm_command.h"
#include "cli/farm_print.h"
#include "cli/farm_steps.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "cli/level.h"
#include "cli/print_json.h"
#include "cli/print_tuning.h"
#include "cli/progress.h"

namespace lightloom {
namespace {

struct Options {
  std::string scene, name, from;
  std::shared_ptr<FarmOptions> farm = std::make_shared<FarmOptions>();
  BakeOptions how;
  int priority = 0;
};

absl::Status check(Options* o) {
  LL_RETURN_IF_ERROR(o->how.check());
  LL_RETURN_IF_ERROR(check_farm_level(o->scene));
  return o->from.empty() ? absl::OkStatus() : check_loom(o->from);
}

absl::Status run(const Options& o) {
  cancel_on_interrupt();
  std::optional<EarlierBake> earlier;
  if (!o.from.empty()) {
    earlier = find_earlier_bake(o.from);
    if (!earlier || !earlier->why_not.empty()) {
      return absl::FailedPreconditionError(
          o.from + " cannot be baked from: " + (earlier ? earlier->why_not : "its manifest cannot be read") +
          "; leave out --from");
    }
  }
  LL_ASSIGN_OR_RETURN(const Level level, load_level(o.scene));
  ProgressBar bar;
  BakeControl control;
  control.cancel = &interrupted();
  control.progress = [&](const std::string& stage, uint64_t done, uint64_t total, uint64_t rays) {
    bar.update(stage, done, total, rays);
  };
  FarmClient farm = o.farm->connect();
  LL_RETURN_IF_ERROR(farm.check_server());  // before time is spent on parameters
  std::optional<Tuning> tuning;
  LL_ASSIGN_OR_RETURN(const BakeParams params,
                      o.how.tuned(*level.tracer, earlier ? &earlier->manifest.params : nullptr, control, &tuning));
  bar.finish();
  if (tuning && !o.farm->json) print(*tuning);
  LL_ASSIGN_OR_RETURN(const RemoteJob job,
                      submit_level(&farm, o.scene, params, earlier ? &*earlier : nullptr, o.name, o.priority));
  if (o.farm->json) {
    print_json(to_json(job));
  } else {
    std::printf("job %llu\n", static_cast<unsigned long long>(job.id));
  }
  return absl::OkStatus();
}

}  // namespace

Command submit_command() {
  const auto o = std::make_shared<Options>();
  std::vector<Option> options = {
      {"SCENE", "level, .glb", &o->scene, true},
      {"--from", "an earlier bake's .loom: by its parameters, and only what has changed", &o->from},
      {"--name", "for people; empty: the level's", &o->name},
      {"--priority", "higher ones first", &o->priority}};
  for (Option& option : o->how.options()) options.push_back(std::move(option));
  return farm_command(
      "submit", "Bake a level on a farm: print the job's number", o->farm, std::move(options), [o] { return run(*o); },
      [o] { return check(o.get()); });
}

}  // namespace lightloom
