#include "core/bake/canary.h"

#include <utility>

#include "core/bake/session.h"
#include "core/scene/builtin.h"

namespace lightloom {
namespace {

/// A built-in level turned off the axes, each object there twice: by another corner first, and facing the other way. Which of
/// the two a ray hits must not be for the CPU to say.
absl::StatusOr<Scene> canary_scene() {
  LL_ASSIGN_OR_RETURN(Scene scene, builtin_scene("cornell"));
  const auto turn = [](Vec3* v) { *v = {0.96f * v->x + 0.28f * v->z, v->y, 0.96f * v->z - 0.28f * v->x}; };
  const size_t count = scene.objects.size();
  for (size_t i = 0; i < count; ++i) {
    Object& object = scene.objects[i];
    for (Vec3& p : object.positions) turn(&p);
    for (Vec3& n : object.normals) turn(&n);
    Object twin = object;
    twin.name += ", from behind";
    for (Triangle& t : twin.triangles) std::swap(t.v[0], t.v[1]);
    for (Vec3& n : twin.normals) n = -n;
    scene.objects.push_back(std::move(twin));
  }
  assign_object_ids(&scene);
  return scene;
}

}  // namespace

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
  LL_ASSIGN_OR_RETURN(Scene scene, canary_scene());
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
