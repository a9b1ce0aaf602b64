// The gather of a bake beside the bare Embree loop over the same rays: a level's cells, one after the other, on a cache that
// is empty at first, as in a bake.
#include <memory>
#include <vector>

#include "core/scene/builtin.h"
#include "tests/bench/bare_embree.h"
#include "tests/bench/gather_cell.h"
#include "tests/bench/or_exit.h"
#include "tests/bench/ratios/ratio.h"

namespace lightloom::bench {
namespace {

/// A planned level.
struct Level {
  Level() {
    for (const PlannedCell& cell : plan.cells) cells.push_back(make_cell_task(plan, scene, cell));
    for (const Probe& p : plan.placement.probes) probes.push_back(p.position);
  }

  Scene scene = *builtin_scene("flat");
  std::unique_ptr<RayTracer> tracer = or_exit(RayTracer::create(scene));
  BareEmbree bare{scene};
  Plan plan = [this] {
    BakeParams params;
    params.texels_per_metre = 4;
    return or_exit(make_plan(*tracer, params, {}));
  }();
  ReceiverSearch surfaces{*tracer, plan.layout, plan.receivers};
  std::vector<CellTask> cells;
  std::vector<Vec3> probes;
};

void gather(benchmark::State& state) {
  static const Level level;
  const BakeParams& params = level.plan.params;
  const Strata strata = strata_of(static_cast<uint32_t>(params.rays));
  VisibilityCache cache(*level.tracer, level.plan.layout, level.plan.receivers.grids, level.probes);
  Ratio ratio(&state, "bare Embree loop over the same rays");
  for ([[maybe_unused]] auto _ : state) {
    for (const CellTask& cell : level.cells) {
      ratio.turn(
          [&] {
            for (const GatherPoint& receiver : cell.receivers) {
              benchmark::DoNotOptimize(level.bare.hits(receiver, strata));
            }
          },
          [&] {
            gather_cell(*level.tracer, &cache, level.surfaces, cell,
                        {params.order, params.rays, true, params.near_field});
          });
    }
  }
}
BENCHMARK(gather)->UseManualTime()->Iterations(1);

}  // namespace
}  // namespace lightloom::bench
