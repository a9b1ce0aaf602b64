// How much a client's jobs may keep on the server.
#pragma once

#include <cstdint>

#include "bake-server/blobs/blob_store.h"
#include "bake-server/store/store.h"

namespace lightloom {

/// ResourceExhausted, one line, if the distinct blobs that the client's jobs and `job` name have more than `quota` bytes;
/// 0: no limit. Reads the sizes of all of them.
absl::Status check_quota(uint64_t quota, const NewJob& job, Store* store, const BlobStore& blobs);

}  // namespace lightloom
