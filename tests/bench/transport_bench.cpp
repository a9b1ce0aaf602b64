// What the transport of a bake costs beside its floor: a bare Embree closest-hit loop over the same gather rays.
//   transport_bench SCENE LIGHTMAP_SIZE RAYS SPACING [default|exact|sl17]
// exact: as default, but a ray is traced for every hit and probe. Prints one line of a Markdown table; judges nothing.
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "core/bake/tasks.h"
#include "core/base/stopwatch.h"
#include "core/scene/gltf.h"
#include "tests/bench/bare_embree.h"
#include "tests/bench/gather_cell.h"
#include "tests/bench/or_exit.h"

namespace lightloom {
namespace {

using bench::BareEmbree;
using bench::or_exit;

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
      for (const GatherPoint& receiver : tasks[i].receivers) found += bare.hits(receiver, strata);
      hits += found;
    });
    return watch.seconds();
  };

  const double before = bare_seconds();
  std::vector<Vec3> probes;
  for (const Probe& p : plan.placement.probes) probes.push_back(p.position);
  const ReceiverSearch surfaces(*tracer, plan.layout, plan.receivers);
  VisibilityCache cache(*tracer, plan.layout, plan.receivers.grids, probes);
  std::vector<GatherStats> stats(tasks.size());
  std::atomic<uint64_t> trace_bytes{0};
  const Stopwatch watch;
  parallel_for(plan.cells.size(), {}, [&](uint64_t i) {
    const CellTask task = make_cell_task(plan, scene, plan.cells[i]);
    const bench::GatheredCell cell =
        bench::gather_cell(*tracer, cached ? &cache : nullptr, surfaces, task,
                           {params.order, plan.params.rays, !sl17, plan.params.near_field});
    stats[i] = cell.stats;
    trace_bytes += cell.trace_bytes;
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
