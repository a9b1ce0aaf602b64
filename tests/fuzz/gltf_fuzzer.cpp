// A .glb or .gltf from anywhere: loads or says why not; what loads has a layout and can be traced, or says why not.
#include "core/receivers/layout.h"
#include "core/receivers/receivers.h"
#include "core/scene/gltf.h"
#include "core/scene/ray_tracer.h"
#include "tests/fuzz/input_file.h"

using namespace lightloom;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // What starts as a .glb is one; all else is JSON.
  const bool binary = size >= 4 && data[0] == 'g' && data[1] == 'l';
  const auto scene = load_gltf(fuzz::input_file({data, size}, binary ? "level.glb" : "level.gltf"));
  if (!scene.ok()) {
    fuzz::check_message(std::string(scene.status().message()));
    return 0;
  }
  if (scene->triangle_count() > 200) return 0;
  LayoutOptions options;
  options.lightmap_size = 16;
  const auto layout = make_layout(*scene, options);
  if (!layout.ok()) {
    fuzz::check_message(std::string(layout.status().message()));
    return 0;
  }
  const auto tracer = RayTracer::create(*scene);
  if (!tracer.ok()) {
    fuzz::check_message(std::string(tracer.status().message()));
    return 0;
  }
  Parallel one;
  one.threads = 1;
  if (static_cast<int64_t>(layout->width) * layout->height > 1 << 16) return 0;
  const auto receivers = find_receivers(**tracer, *layout, one);
  if (!receivers.ok()) std::abort();
  for (const Receiver& r : receivers->all) {
    if (!is_finite(r.point.position) || !is_finite(r.point.geometric)) std::abort();
  }
  return 0;
}
