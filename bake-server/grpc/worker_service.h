// WorkerService over gRPC: translates, and keeps the limits of proto/worker_service.proto.
#pragma once

#include <memory>

#include "bake-server/blobs/blob_store.h"
#include "bake-server/coordinator/coordinator.h"
#include "bake-server/scheduler/admission.h"

namespace grpc {
class Service;
}

namespace lightloom {

/// Long lists of tasks are read from `blobs`. Both must outlive it.
std::unique_ptr<grpc::Service> make_worker_service(const ServerInfo& info, Coordinator* coordinator,
                                                   const BlobStore* blobs);

}  // namespace lightloom
