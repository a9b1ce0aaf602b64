// glTF accessors as plain arrays: any component type, strided, normalised, sparse, or without a buffer view
// (zeros).
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/status.h"

namespace tinygltf {
class Model;
}

namespace lightloom {

/// The most elements that one accessor, or the vertices of a level together, may have.
inline constexpr uint64_t kMaxElements = uint64_t{1} << 26;

/// Number of elements, checked to be in [0, kMaxElements].
absl::StatusOr<uint64_t> accessor_count(const tinygltf::Model& model, int accessor);

/// `components` floats per element. Fails if the accessor's type differs, or if it leaves its buffer.
absl::StatusOr<std::vector<float>> read_floats(const tinygltf::Model& model, int accessor, int components);

/// Unsigned scalar elements.
absl::StatusOr<std::vector<uint32_t>> read_indices(const tinygltf::Model& model, int accessor);

/// The bytes of a buffer view. Fails if it leaves its buffer.
struct ByteRange {
  const uint8_t* data = nullptr;
  uint64_t size = 0, stride = 0;  ///< stride 0: packed
};
absl::StatusOr<ByteRange> buffer_view_bytes(const tinygltf::Model& model, int view);

}  // namespace lightloom
