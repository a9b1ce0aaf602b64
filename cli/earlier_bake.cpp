#include "cli/earlier_bake.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <system_error>

#include "core/asset/asset.h"
#include "core/bake/bake_traces.h"
#include "core/bake/plan.h"
#include "core/bake/reuse.h"
#include "core/base/version.h"

namespace lightloom {
namespace {

/// Their bytes are checked when they are fetched into the new asset.
bool has_all_chunks(const EarlierBake& bake) {
  const ChunkStore store = chunk_store(bake.loom);
  const std::vector<ChunkRef> chunks = chunks_of(bake.manifest);
  return std::all_of(chunks.begin(), chunks.end(), [&](const ChunkRef& chunk) {
    std::error_code error;
    return std::filesystem::file_size(store.path(chunk.digest), error) == chunk.size && !error;
  });
}

/// Fills in the traces, or says why they are of no use.
absl::Status read_results(EarlierBake* bake) {
  if (bake->manifest.method_version != kMethodVersion) {
    return absl::FailedPreconditionError("it was baked by another version of the method");
  }
  auto traces = read_traces(bake->loom, bake->manifest);
  if (absl::IsNotFound(traces.status())) return absl::NotFoundError("it has no traces");
  const absl::StatusOr<BakeTraces> decoded = traces.ok() ? decode_bake_traces(*traces) : traces.status();
  if (!decoded.ok()) return absl::DataLossError("its traces are damaged");
  if (!has_all_chunks(*bake)) return absl::DataLossError("some of its chunks are missing");
  bake->stale = stale_share(*decoded);
  bake->traces = *std::move(traces);
  return absl::OkStatus();
}

}  // namespace

std::optional<EarlierBake> find_earlier_bake(const std::string& loom) {
  auto manifest = read_manifest(loom);
  if (!manifest.ok()) return std::nullopt;
  EarlierBake bake{loom, *std::move(manifest), {}, ""};
  if (const absl::Status status = read_results(&bake); !status.ok()) bake.why_not = std::string(status.message());
  return bake;
}

bool is_up_to_date(const Manifest& m, const Scene& scene, const BakeParams& params) {
  if (m.method_version != kMethodVersion || m.params != params || m.scene_hash != scene_hash(scene)) return false;
  // Names, and the order of objects, are in no hash.
  std::map<Digest, const ObjectEntry*> entries;
  for (const ObjectEntry& o : m.objects) entries[o.id] = &o;
  auto next = m.objects.begin();
  for (const Object& object : scene.objects) {
    if (!entries.contains(object.id)) continue;
    if (next == m.objects.end() || next->id != object.id || next->name != object.name) return false;
    ++next;
  }
  return next == m.objects.end();
}

}  // namespace lightloom
