// A lightmap from anywhere: reads or says why not.
#include "core/scene/image.h"
#include "tests/fuzz/input_file.h"

using namespace lightloom;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto image = read_exr(fuzz::input_file({data, size}, "image.exr"));
  if (!image.ok()) fuzz::check_message(std::string(image.status().message()));
  return 0;
}
