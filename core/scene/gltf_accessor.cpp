#include "core/scene/gltf_accessor.h"

#include <tiny_gltf.h>

#include <algorithm>
#include <cstring>
#include <string>

namespace lightloom {
namespace {

std::string named(const char* what, int index) { return std::string(what) + " " + std::to_string(index); }

absl::Status invalid(std::string message) { return absl::InvalidArgumentError(std::move(message)); }

/// Where element i of an accessor lies: data + i · stride.
struct Elements {
  const uint8_t* data = nullptr;
  uint64_t stride = 0;
};

absl::StatusOr<Elements> elements(const tinygltf::Model& model, int view, int64_t offset, uint64_t count,
                                  uint64_t element_size, const std::string& whose) {
  LL_ASSIGN_OR_RETURN(const ByteRange range, buffer_view_bytes(model, view));
  const uint64_t stride = range.stride > 0 ? range.stride : element_size;
  if (stride < element_size || stride > 65536) {
    return invalid(whose + ": stride " + std::to_string(stride) + " does not fit elements of " +
                   std::to_string(element_size) + " bytes; export the file again");
  }
  const uint64_t needed = count == 0 ? 0 : (count - 1) * stride + element_size;
  if (offset < 0 || static_cast<uint64_t>(offset) > range.size || needed > range.size - static_cast<uint64_t>(offset)) {
    return invalid(whose + ": " + std::to_string(count) + " elements reach past the end of " +
                   named("buffer view", view) + " (" + std::to_string(range.size) + " bytes); export the file again");
  }
  return Elements{range.data + offset, stride};
}

template <class T>
T load(const uint8_t* p) {
  T v;
  std::memcpy(&v, p, sizeof v);
  return v;
}

/// glTF 2.0, 3.11: how normalised integers become floats.
float component(const uint8_t* p, int type, bool normalized) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE: {
      const float v = load<int8_t>(p);
      return normalized ? std::max(v / 127.0f, -1.0f) : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return normalized ? static_cast<float>(*p) / 255.0f : static_cast<float>(*p);
    case TINYGLTF_COMPONENT_TYPE_SHORT: {
      const float v = load<int16_t>(p);
      return normalized ? std::max(v / 32767.0f, -1.0f) : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: {
      const float v = load<uint16_t>(p);
      return normalized ? v / 65535.0f : v;
    }
    case TINYGLTF_COMPONENT_TYPE_INT: {
      const double v = load<int32_t>(p);
      return static_cast<float>(normalized ? std::max(v / 2147483647.0, -1.0) : v);
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT: {
      const double v = load<uint32_t>(p);
      return static_cast<float>(normalized ? v / 4294967295.0 : v);
    }
    case TINYGLTF_COMPONENT_TYPE_DOUBLE:
      return static_cast<float>(load<double>(p));
    default:
      return load<float>(p);
  }
}

uint32_t index_component(const uint8_t* p, int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return *p;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<uint16_t>(p);
    default:
      return load<uint32_t>(p);
  }
}

bool is_index_type(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE || type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

uint64_t size_of(int component_type) {
  return static_cast<uint64_t>(std::max(0, tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(component_type))));
}

/// Calls set(i, pointer to the element) for the dense elements, then for those that the sparse part replaces.
template <class Set>
absl::Status for_each_element(const tinygltf::Model& model, int index, uint64_t element_size, const Set& set) {
  const tinygltf::Accessor& a = model.accessors[static_cast<size_t>(index)];
  const std::string whose = named("accessor", index);
  if (a.bufferView >= 0) {
    if (a.byteOffset > uint64_t{1} << 40) return invalid(whose + ": its byte offset is past its buffer");
    LL_ASSIGN_OR_RETURN(const Elements dense, elements(model, a.bufferView, static_cast<int64_t>(a.byteOffset), a.count,
                                                       element_size, whose));
    for (uint64_t i = 0; i < a.count; ++i) set(i, dense.data + i * dense.stride);
  }
  if (!a.sparse.isSparse) return absl::OkStatus();

  const auto& s = a.sparse;
  if (s.count < 0 || static_cast<uint64_t>(s.count) > a.count) {
    return invalid(whose + ": its sparse part has more elements than it has; export the file again");
  }
  if (!is_index_type(s.indices.componentType)) return invalid(whose + ": its sparse indices are not unsigned integers");
  const auto count = static_cast<uint64_t>(s.count);
  LL_ASSIGN_OR_RETURN(const Elements where, elements(model, s.indices.bufferView, s.indices.byteOffset, count,
                                                     size_of(s.indices.componentType), whose + " (sparse indices)"));
  LL_ASSIGN_OR_RETURN(const Elements values, elements(model, s.values.bufferView, s.values.byteOffset, count,
                                                      element_size, whose + " (sparse values)"));
  for (uint64_t i = 0; i < count; ++i) {
    const uint32_t target = index_component(where.data + i * where.stride, s.indices.componentType);
    if (target >= a.count) {
      return invalid(whose + ": sparse index " + std::to_string(target) + " is out of range; export the file again");
    }
    set(target, values.data + i * values.stride);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ByteRange> buffer_view_bytes(const tinygltf::Model& model, int index) {
  if (index < 0 || static_cast<size_t>(index) >= model.bufferViews.size()) {
    return invalid(named("buffer view", index) + " does not exist; export the file again");
  }
  const tinygltf::BufferView& view = model.bufferViews[static_cast<size_t>(index)];
  if (view.buffer < 0 || static_cast<size_t>(view.buffer) >= model.buffers.size()) {
    return invalid(named("buffer view", index) + " uses " + named("buffer", view.buffer) + ", which does not exist");
  }
  const std::vector<unsigned char>& buffer = model.buffers[static_cast<size_t>(view.buffer)].data;
  if (view.byteOffset > buffer.size() || view.byteLength > buffer.size() - view.byteOffset) {
    return invalid(named("buffer view", index) + " reaches past the end of " + named("buffer", view.buffer) + " (" +
                   std::to_string(buffer.size()) + " bytes); export the file again");
  }
  return ByteRange{buffer.data() + view.byteOffset, view.byteLength, view.byteStride};
}

absl::StatusOr<uint64_t> accessor_count(const tinygltf::Model& model, int index) {
  if (index < 0 || static_cast<size_t>(index) >= model.accessors.size()) {
    return invalid(named("accessor", index) + " does not exist; export the file again");
  }
  const uint64_t count = model.accessors[static_cast<size_t>(index)].count;
  if (count > kMaxElements) {
    return invalid(named("accessor", index) + " has " + std::to_string(count) + " elements, more than the limit of " +
                   std::to_string(kMaxElements) + "; split the mesh");
  }
  return count;
}

absl::StatusOr<std::vector<float>> read_floats(const tinygltf::Model& model, int index, int components) {
  LL_ASSIGN_OR_RETURN(const uint64_t count, accessor_count(model, index));
  const tinygltf::Accessor& a = model.accessors[static_cast<size_t>(index)];
  const uint64_t size = size_of(a.componentType);
  if (size == 0 || tinygltf::GetNumComponentsInType(static_cast<uint32_t>(a.type)) != components) {
    return invalid(named("accessor", index) + " is not a VEC" + std::to_string(components) + " of numbers");
  }
  const auto width = static_cast<uint64_t>(components);
  std::vector<float> out;
  // The dense elements are known to lie in a buffer before room for them is made.
  const auto set = [&](uint64_t i, const uint8_t* p) {
    if (out.empty()) out.resize(count * width);
    for (uint64_t c = 0; c < width; ++c) out[i * width + c] = component(p + c * size, a.componentType, a.normalized);
  };
  LL_RETURN_IF_ERROR(for_each_element(model, index, size * width, set));
  out.resize(count * width);
  return out;
}

absl::StatusOr<std::vector<uint32_t>> read_indices(const tinygltf::Model& model, int index) {
  LL_ASSIGN_OR_RETURN(const uint64_t count, accessor_count(model, index));
  const tinygltf::Accessor& a = model.accessors[static_cast<size_t>(index)];
  if (a.type != TINYGLTF_TYPE_SCALAR || !is_index_type(a.componentType)) {
    return invalid(named("accessor", index) + " cannot hold indices: it is not of unsigned scalars");
  }
  std::vector<uint32_t> out;
  const auto set = [&](uint64_t i, const uint8_t* p) {
    if (out.empty()) out.resize(count);
    out[i] = index_component(p, a.componentType);
  };
  LL_RETURN_IF_ERROR(for_each_element(model, index, size_of(a.componentType), set));
  out.resize(count);
  return out;
}

}  // namespace lightloom
