// Tasks and what they give, to messages and back. For .cpp files: templates, since headers show no protobuf.
#pragma once

#include "core/bake/task_runner.h"
#include "proto/digest.h"

namespace lightloom {

/// To a SyncResponse.Assignment: what run() needs.
template <class Assignment>
void to_proto(const BakeTask& task, Assignment* out) {
  out->set_kind(task.kind);
  out->set_payload(task.payload.data(), task.payload.size());
  out->set_argument(task.argument.data(), task.argument.size());
  out->set_inputs(to_bytes(task.inputs));
}

template <class Assignment>
BakeTask to_task(const Assignment& a) {
  BakeTask task;
  task.kind = a.kind();
  task.payload.assign(a.payload().begin(), a.payload().end());
  task.argument.assign(a.argument().begin(), a.argument().end());
  if (const auto inputs = to_digest(a.inputs()); inputs.ok()) task.inputs = *inputs;
  return task;
}

/// To what has `tasks`: a SyncRequest.Finished, a TaskList.
template <class Message>
void add_tasks(const std::vector<SpawnedTask>& tasks, Message* out) {
  for (const SpawnedTask& s : tasks) {
    auto* t = out->add_tasks();
    t->set_kind(s.kind);
    t->set_stage(s.stage);
    t->set_argument(s.argument.data(), s.argument.size());
    t->set_order(s.order);
  }
}

/// To a SyncRequest.Finished.
template <class Finished>
void to_proto(const TaskOutput& output, Finished* out) {
  out->set_rays(output.rays);
  for (const Digest& d : output.outputs) out->add_outputs(to_bytes(d));
  add_tasks(output.spawned, out);
}

template <class Finished>
absl::StatusOr<TaskOutput> to_output(const Finished& f) {
  TaskOutput out;
  out.rays = f.rays();
  for (const std::string& d : f.outputs()) {
    LL_ASSIGN_OR_RETURN(const Digest digest, to_digest(d));
    out.outputs.push_back(digest);
  }
  for (const auto& t : f.tasks()) {
    out.spawned.push_back({t.kind(), t.stage(), {t.argument().begin(), t.argument().end()}, t.order()});
  }
  return out;
}

}  // namespace lightloom
