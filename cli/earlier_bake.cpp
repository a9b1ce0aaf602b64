#include "cli/earlier_bake.h"

#include <algorithm>
#include <atomic>
#include <map>

#include "core/asset/asset.h"
#include "core/bake/bake_traces.h"
#include "core/bake/plan.h"
#include "core/base/parallel.h"
#include "core/base/version.h"

namespace lightloom {
namespace {

/// Whole and undamaged: a rebake names them again, and nobody else may have them.
bool has_all_chunks(const EarlierBake& bake) {
  const ChunkStore store = chunk_store(bake.loom);
  const std::vector<ChunkRef> chunks = chunks_of(bake.manifest);
  std::atomic<bool> all{true};
  parallel_for(chunks.size(), {}, [&](uint64_t i) {
    if (all && !store.get(chunks[i]).ok()) all = false;
  });
  return all;
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
  if (!has_all_chunks(*bake)) return absl::DataLossError("some of its chunks are missing or damaged");
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

bool is_up_to_date(const EarlierBake& bake, const Scene& scene, const BakeParams& params) {
  const Manifest& m = bake.manifest;
  const auto too_stale = [&](const CellEntry& c) { return static_cast<double>(c.stale) > bake.tolerance; };
  if (std::any_of(m.cells.begin(), m.cells.end(), too_stale)) return false;
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
