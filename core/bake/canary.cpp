#include "core/bake/canary.h"

#include "core/bake/session.h"
#include "core/scene/builtin.h"

namespace lightloom {

BakeParams canary_params() {
  BakeParams p;
  p.spacing = 0.5f;
  p.rays = 32;
  p.relight_rays = 256;
  p.texels_per_metre = 4;
  p.cell_receivers = 128;
  p.average = 1;
  return p;
}

absl::StatusOr<Digest> bake_canary(int threads, const BakeParams& params) {
  BakeControl control;
  control.threads = threads;
  LL_ASSIGN_OR_RETURN(Scene scene, builtin_scene("cornell"));
  LL_ASSIGN_OR_RETURN(const auto session, BakeSession::create(std::move(scene), params, control));

  Hasher hasher;
  hasher.string("canary").digest(session->plan_digest());
  const ChunkSink sink = [&](std::span<const uint8_t> bytes) -> absl::StatusOr<ChunkRef> {
    const Digest digest = sha256(bytes);
    hasher.digest(digest);
    return ChunkRef{digest, bytes.size()};
  };
  LL_ASSIGN_OR_RETURN(const BakedCell cell, session->cell(session->plan().cells.size() / 2, sink));
  hasher.digest(sha256(encode_cell_record(cell.record)));
  LL_RETURN_IF_ERROR(session->relight(session->plan().placement.probes.size() / 2, 1, sink).status());
  for (size_t o = 0; o < session->scene().objects.size(); ++o) LL_RETURN_IF_ERROR(session->surface(o, sink).status());
  return hasher.finish();
}

}  // namespace lightloom
