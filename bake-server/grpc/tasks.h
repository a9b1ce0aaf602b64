// Tasks that come in with jobs and results. For .cpp files of this folder only.
#pragma once

#include <google/protobuf/repeated_field.h>

#include <vector>

#include "bake-server/store/store.h"
#include "proto/job_service.pb.h"

namespace lightloom {

/// The store checks the rest.
inline absl::StatusOr<std::vector<NewTask>> to_tasks(const google::protobuf::RepeatedPtrField<v1::NewTask>& tasks) {
  std::vector<NewTask> out;
  for (const v1::NewTask& t : tasks) {
    if (t.kind().empty() || t.kind().size() > 64) {
      return absl::InvalidArgumentError("a task's kind must have 1 to 64 bytes");
    }
    out.push_back({t.kind(), t.stage(), t.argument(), t.order()});
  }
  return out;
}

}  // namespace lightloom
