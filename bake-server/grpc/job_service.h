// JobService over gRPC: translates, and keeps the limits of proto/job_service.proto.
#pragma once

#include <memory>

#include "bake-server/coordinator/coordinator.h"
#include "bake-server/scheduler/admission.h"

namespace grpc {
class Service;
}

namespace lightloom {

/// `coordinator` must outlive it.
std::unique_ptr<grpc::Service> make_job_service(const ServerInfo& info, Coordinator* coordinator);

}  // namespace lightloom
