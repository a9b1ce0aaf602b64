// Blobs over gRPC: translates, and keeps the limits of proto/blob_service.proto.
#pragma once

#include <memory>

#include "bake-server/blobs/blob_store.h"

namespace grpc {
class Service;
}

namespace lightloom {

/// `store` must outlive it.
std::unique_ptr<grpc::Service> make_blob_service(BlobStore* store);

}  // namespace lightloom
