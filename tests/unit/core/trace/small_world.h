// A level cut into cells of half a metre.
#pragma once

#include <utility>

#include "core/receivers/receivers.h"
#include "core/scene/ray_tracer.h"
#include "core/trace/world_contents.h"

namespace lightloom::test {

struct SmallWorld {
  explicit SmallWorld(Scene s) : scene(std::move(s)) {
    LayoutOptions options;
    options.texels_per_metre = 4;
    const AtlasLayout layout = make_layout(scene, options).value();
    const auto tracer = RayTracer::create(scene).value();
    const Receivers receivers = find_receivers(*tracer, layout, {}).value();
    contents = contents_of(scene, layout, receivers, WorldGrid::around(scene.bounds(), 1));
  }
  Scene scene;
  WorldContents contents;
};

}  // namespace lightloom::test
