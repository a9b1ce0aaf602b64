#include "tests/unit/core/bake/sample_traces.h"

namespace lightloom::test {

BakeTraces sample_traces() {
  const WorldGrid grid{0, {-1, 0, 2}, {2, 1, 3}};
  BakeTraces t;
  t.world = {grid, {1, 4}, {{{{1, 2}}, {{0, 0}}}, {{{3, 4}}, {{5, 6}}}}};
  CellRecord cell;
  cell.chunk = {sha256("chunk"), 4000};
  cell.bounds = {{-1, 0, 2}, {1, 2, 3}};
  cell.key = sha256("cell");
  cell.trace = {grid, 3, {0x5f}};
  cell.clusters = {{{{-1, 0, 2}, {0, 1, 3}}, 30, 0, 0, 0}};
  t.cells = {cell, cell};
  t.probes = {{{{1, 2, 3}, 4}, sha256("probe"), {sha256("relight"), 77}, {grid, 0, {0x0c, 0x40}}}};
  return t;
}
}  // namespace lightloom::test
