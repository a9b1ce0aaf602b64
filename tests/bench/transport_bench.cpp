// What the transport of a bake costs beside its floor: a bare Embree closest-hit loop over the same gather rays.
//   transport_bench SCENE LIGHTMAP_SIZE RAYS SPACING [default|exact|sl17]
// exact: as default, but a ray is traced for every hit and probe. Prints one line of a Markdown table; judges nothing.
#include <embree3/rtcore.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "core/bake/tasks.h"
#include "core/base/stopwatch.h"
#include "core/scene/gltf.h"

namespace lightloom {
namespace {

template <class T>
T or_exit(absl::StatusOr<T> value) {
  if (!value.ok()) {
    std::fprintf(stderr, "%s\n", std::string(value.status().message()).c_str());
    std::exit(1);
  }
  return *std::move(value);
}

/// Embree as RayTracer sets it up, without what RayTracer does to a hit.
class BareEmbree {
 public:
  explicit BareEmbree(const Scene& scene) : device_(rtcNewDevice("isa=avx2")), scene_(rtcNewScene(device_)) {
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
    for (const Object& object : scene.objects) {
      if (!object.is_static || object.triangles.empty()) continue;
      RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
      auto* vertices = static_cast<Vec3*>(rtcSetNewGeometryBuffer(
          geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3), object.positions.size()));
      auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(
          geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), object.triangles.size()));
      std::copy(object.positions.begin(), object.positions.end(), vertices);
      for (const Triangle& t : object.triangles) indices = std::copy(t.v.begin(), t.v.end(), indices);
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(scene_, geometry);
      rtcReleaseGeometry(geometry);
    }
    rtcCommitScene(scene_);
  }
  ~BareEmbree() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  bool hits(Vec3 o, Vec3 d) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit ray{};
    ray.ray.org_x = o.x, ray.ray.org_y = o.y, ray.ray.org_z = o.z;
    ray.ray.dir_x = d.x, ray.ray.dir_y = d.y, ray.ray.dir_z = d.z;
    ray.ray.tfar = std::numeric_limits<float>::infinity();
    ray.ray.mask = 0xffffffffu;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene_, &context, &ray);
    return ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
  }

 private:
  RTCDevice device_;
  RTCScene scene_;
};

int run(int argc, char** argv) {
  if (argc < 5) {
    std::fprintf(stderr, "usage: transport_bench SCENE LIGHTMAP_SIZE RAYS SPACING [default|exact|sl17]\n");
    return 2;
  }
  const Scene scene = or_exit(load_gltf(argv[1]));
  const auto tracer = or_exit(RayTracer::create(scene));
  const std::string method = argc > 5 ? argv[5] : "default";
  const bool sl17 = method == "sl17", cached = method == "default";
  BakeParams params = sl17 ? sl17_params() : BakeParams{};
  params.lightmap_size = std::atoi(argv[2]);
  params.rays = std::atoi(argv[3]);
  params.spacing = static_cast<float>(std::atof(argv[4]));
  const Plan plan = or_exit(make_plan(*tracer, params, {}));

  const BareEmbree bare(scene);
  const Strata strata = strata_of(static_cast<uint32_t>(plan.params.rays));
  std::atomic<uint64_t> hits{0};
  std::vector<CellTask> tasks(plan.cells.size());
  parallel_for(tasks.size(), {}, [&](uint64_t i) { tasks[i] = make_cell_task(plan, scene, plan.cells[i]); });
  const auto bare_seconds = [&] {
    const Stopwatch watch;
    parallel_for(tasks.size(), {}, [&](uint64_t i) {
      uint64_t found = 0;
      for (const GatherPoint& receiver : tasks[i].receivers) {
        Rng rng(receiver.seed);
        for (uint32_t r = 0; r < strata.columns * strata.rows; ++r) {
          const GatherRay ray = gather_ray(receiver, r, strata, &rng);
          found += bare.hits(ray.origin, ray.direction);
        }
      }
      hits += found;
    });
    return watch.seconds();
  };

  const double before = bare_seconds();
  std::vector<Vec3> probes;
  for (const Probe& p : plan.placement.probes) probes.push_back(p.position);
  VisibilityCache cache(*tracer, plan.layout, plan.receivers.grids, probes);
  std::vector<GatherStats> stats(tasks.size());
  std::atomic<uint64_t> trace_bytes{0};
  const Stopwatch watch;
  parallel_for(plan.cells.size(), {}, [&](uint64_t i) {
    const CellTask task = make_cell_task(plan, scene, plan.cells[i]);
    TraceRecorder recorder(task.grid, task.probes.size());
    Gatherer gatherer(*tracer, cached ? &cache : nullptr, {task.probes, task.probe_ids},
                      {params.order, plan.params.rays, !sl17}, &recorder);
    std::vector<float> row(task.probes.size() * static_cast<size_t>(sh_count(params.order)));
    for (const GatherPoint& receiver : task.receivers) {
      std::fill(row.begin(), row.end(), 0.0f);
      stats[i] += gatherer.add_row(receiver, row);
    }
    trace_bytes += recorder.finish(task.probes).runs.size();
  });
  const double transport = watch.seconds();
  const double after = bare_seconds();
  GatherStats all;
  for (const GatherStats& s : stats) all += s;
  const double floor = 0.5 * (before + after);
  std::printf("| %s | %zu | %zu | %.1f | %.1f | %.1f (%.1f, %.1f) | %.1f | %.2f | %.0f | %.2f |\n", method.c_str(),
              plan.receivers.all.size(), plan.placement.probes.size(), 1e-6 * static_cast<double>(all.gather_rays),
              1e-6 * static_cast<double>(all.visibility_rays), floor, before, after, transport, transport / floor,
              1e-6 * static_cast<double>(cache.bytes()), 1e-6 * static_cast<double>(trace_bytes.load()));
  return 0;
}

}  // namespace
}  // namespace lightloom

int main(int argc, char** argv) {
  std::printf(
      "| method | receivers | probes | gather Mrays | visibility Mrays | bare loop s (before, after) | transport s | "
      "ratio | cache MB | traces MB |\n");
  std::printf("|---|---|---|---|---|---|---|---|---|---|\n");
  return lightloom::run(argc, argv);
}
