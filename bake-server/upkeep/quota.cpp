#include "bake-server/upkeep/quota.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <iterator>
#include <set>

#include "core/base/parse_size.h"
#include "core/base/text.h"

namespace lightloom {

absl::Status check_quota(uint64_t quota, const NewJob& job, Store* store, const BlobStore& blobs) {
  if (quota == 0) return absl::OkStatus();
  LL_ASSIGN_OR_RETURN(const std::vector<Digest> kept, store->references_of(job.client));
  const std::set<Digest> inputs(job.inputs.begin(), job.inputs.end());
  std::vector<Digest> added;
  std::set_difference(inputs.begin(), inputs.end(), kept.begin(), kept.end(), std::back_inserter(added));

  const auto bytes_of = [&](const std::vector<Digest>& digests) {
    uint64_t bytes = 0;
    for (const Digest& d : digests) bytes += blobs.size(d).value_or(0);
    return bytes;
  };
  const uint64_t used = bytes_of(kept), more = bytes_of(added);
  if (used + more <= quota) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("client '", printable(job.client), "' keeps ", size_text(used), " here and this job adds ",
                   size_text(more), ", its quota is ", size_text(quota),
                   ": wait until older jobs are forgotten (the server's --retain), or ask for a larger --quota"));
}

}  // namespace lightloom
