// The files of a .loom from anywhere. The first byte says which kind; checksums are mended, or nothing would get past
// them. What decodes is written again to the same bytes, or to some that decode alike.
#include <zlib.h>

#include <cstring>
#include <memory_resource>
#include <vector>

#include "core/asset/chunk.h"
#include "core/asset/manifest.h"
#include "runtime/asset_index.h"
#include "tests/fuzz/input_file.h"

using namespace lightloom;

namespace {

template <class T, class Encode, class Decode>
void round_trip(const absl::StatusOr<T>& value, const Encode& encode, const Decode& decode) {
  if (!value.ok()) {
    fuzz::check_message(std::string(value.status().message()));
    return;
  }
  const auto bytes = encode(*value);
  const auto again = decode(bytes);
  if (!again.ok() || encode(*again) != bytes) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 1) return 0;
  std::vector<uint8_t> bytes(data + 1, data + size);
  switch (data[0] % 4) {
    case 0: {
      if (bytes.size() >= 4) {
        const size_t end = bytes.size() - 4;
        const uint32_t crc = static_cast<uint32_t>(crc32(0, bytes.data(), static_cast<uInt>(end)));
        std::memcpy(bytes.data() + end, &crc, 4);
      }
      const auto manifest = decode_manifest(bytes);
      round_trip(manifest, encode_manifest, [](const auto& b) { return decode_manifest(b); });
      if (manifest.ok()) {
        const auto index = AssetIndex::create(*manifest, std::pmr::new_delete_resource());
        if (!index.ok()) fuzz::check_message(std::string(index.status().message()));
      }
      break;
    }
    case 1:
      round_trip(decode_cell(bytes), encode_cell, [](const auto& b) { return decode_cell(b); });
      break;
    case 2:
      round_trip(decode_relight(bytes), encode_relight, [](const auto& b) { return decode_relight(b); });
      break;
    case 3:
      round_trip(decode_surface(bytes), encode_surface, [](const auto& b) { return decode_surface(b); });
      break;
  }
  return 0;
}
