// What an earlier bake left, from anywhere: it decodes to what encodes to the same bytes, and can be compared with a world.
#include "core/bake/bake_traces.h"
#include "core/trace/changes.h"
#include "tests/fuzz/input_file.h"

using namespace lightloom;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto traces = decode_bake_traces({data, size});
  if (!traces.ok()) {
    fuzz::check_message(std::string(traces.status().message()));
    return 0;
  }
  const auto bytes = encode_bake_traces(*traces);
  const auto again = decode_bake_traces(bytes);
  if (!again.ok() || encode_bake_traces(*again) != bytes) std::abort();
  const Changes changes(traces->world, WorldContents{traces->world.grid, {}, {}});
  for (const CellRecord& cell : traces->cells) {
    const double share = changes.share(cell.trace);
    if (!(share >= 0 && share <= 1)) std::abort();
  }
  return 0;
}
