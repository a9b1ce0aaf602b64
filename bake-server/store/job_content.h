// What a job asks for: whether it may be stored, whether two ask for the same, and which results can be used again.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "bake-server/store/store.h"

namespace lightloom {

/// InvalidArgument beyond the limits of NewJob.
absl::Status check_job(const NewJob& job);
absl::Status check_arguments(const std::vector<NewTask>& tasks);

/// Stored, and compared when a request comes again, maybe after an upgrade: never change what is hashed.
std::string content_of(const NewJob& job);
/// What the results of the job's tasks follow from.
std::string work_of(const NewJob& job);
/// Equal ones have equal outputs; empty: none is known to be equal.
std::string key_of(std::string_view work, const NewTask& task);

}  // namespace lightloom
