// A lights.json from anywhere: its rigs can be applied, or it says why not.
#include "core/scene/builtin.h"
#include "core/scene/rig.h"
#include "tests/fuzz/input_file.h"

using namespace lightloom;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const Scene cornell = *builtin_scene("cornell");
  const auto rigs = load_rigs(fuzz::input_file({data, size}, "lights.json"));
  if (!rigs.ok()) {
    fuzz::check_message(std::string(rigs.status().message()));
    return 0;
  }
  for (const Rig& rig : *rigs) {
    Scene scene = cornell;
    const absl::Status applied = apply_rig(rig, &scene);
    if (!applied.ok()) fuzz::check_message(std::string(applied.message()));
    for (const Light& light : scene.lights) {
      if (!is_finite(light.position) || !is_finite(light.direction)) std::abort();
    }
  }
  return 0;
}
