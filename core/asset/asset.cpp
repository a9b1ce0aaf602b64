#include "core/asset/asset.h"

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "core/asset/texel_codes.h"
#include "core/base/file.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

absl::Status mismatch(const std::string& what) {
  return absl::DataLossError(what + " does not match the manifest; bake again or fetch it again");
}

absl::Status in_context(const absl::Status& status, const std::string& what) {
  return absl::Status(status.code(), what + ": " + std::string(status.message()));
}

/// An object, and the texels that its surface chunk has.
struct Surface {
  const ObjectEntry* object = nullptr;
  std::vector<uint32_t> keys;  // ascending
  std::vector<bool> lit;       // per key: it is a receiver of some cell
};
using Surfaces = std::map<Digest, Surface>;

/// Chunks may only name objects of the manifest, with the lightmap size it gives them.
absl::StatusOr<std::vector<Surface*>> find_objects(const std::vector<ChunkObject>& named, const std::string& what,
                                                   Surfaces* surfaces) {
  std::vector<Surface*> found;
  for (const ChunkObject& o : named) {
    const auto it = surfaces->find(o.id);
    if (it == surfaces->end() || it->second.object->width != static_cast<int32_t>(o.width) ||
        it->second.object->height != static_cast<int32_t>(o.height)) {
      return mismatch(what + ": object " + o.id.hex().substr(0, 12));
    }
    found.push_back(&it->second);
  }
  return found;
}

/// Codes may only name texels that their object's surface has.
absl::Status check_codes(const std::vector<ChunkObject>& named, const std::vector<uint32_t>& texels,
                         const std::vector<Surface*>& objects, const std::string& what) {
  const TexelCodes codes(named);
  for (const uint32_t code : texels) {
    if (code == RelightChunk::kDead || code == RelightChunk::kSky) continue;
    const auto [slot, key] = codes.texel(code);
    const auto& keys = objects[slot]->keys;
    if (find_key(keys, key) == keys.size()) return mismatch(what + ": a texel that no surface has");
  }
  return absl::OkStatus();
}

absl::Status verify_cell(const Manifest& m, const CellEntry& entry, const CellChunk& chunk, const std::string& what,
                         Surfaces* surfaces) {
  if (chunk.order != static_cast<uint32_t>(m.params.order) || chunk.probe_count != entry.probes ||
      chunk.receivers.size() != entry.receivers || chunk.clusters.size() != entry.clusters) {
    return mismatch(what);
  }
  for (uint32_t i = 0; i < entry.clusters; ++i) {
    const ClusterEntry& c = m.clusters[entry.first_cluster + i];
    if (c.receivers != chunk.clusters[i].receivers || c.rank != chunk.clusters[i].rank() ||
        c.probes != chunk.clusters[i].probes.size()) {
      return mismatch(what + ": cluster " + std::to_string(i));
    }
  }
  LL_ASSIGN_OR_RETURN(const std::vector<Surface*> objects, find_objects(chunk.objects, what, surfaces));
  for (const TexelRef& receiver : chunk.receivers) {
    Surface& surface = *objects[receiver.slot];
    const size_t texel = find_key(surface.keys, receiver.key);
    if (texel == surface.keys.size()) return mismatch(what + ": a receiver that no surface has");
    if (surface.lit[texel]) return mismatch(what + ": a receiver that is there twice");
    surface.lit[texel] = true;
  }
  return check_codes(chunk.objects, chunk.near_texels, objects, what);
}

constexpr std::string_view kTraces = "traces-";

std::filesystem::path traces_path(const std::filesystem::path& loom, std::span<const uint8_t> manifest) {
  return loom / (std::string(kTraces) + sha256(manifest).hex());
}

void remove_traces_but(const std::filesystem::path& kept) {
  std::vector<std::filesystem::path> others;
  std::error_code error;
  for (std::filesystem::directory_iterator it(kept.parent_path(), error), end; !error && it != end;
       it.increment(error)) {
    if (it->path().filename().string().starts_with(kTraces) && it->path() != kept) others.push_back(it->path());
  }
  for (const std::filesystem::path& other : others) std::filesystem::remove(other, error);
}

}  // namespace

std::filesystem::path ChunkStore::path(const Digest& digest) const {
  const std::string hex = digest.hex();
  return folder_ / hex.substr(0, 2) / hex.substr(2);
}

absl::StatusOr<ChunkRef> ChunkStore::put(std::span<const uint8_t> bytes) const {
  const ChunkRef ref{sha256(bytes), bytes.size()};
  // What is there may be damaged: "bake again" must mend it.
  std::error_code error;
  const auto size = std::filesystem::file_size(path(ref.digest), error);
  if (!error && size == bytes.size()) {
    if (const auto there = read_file(path(ref.digest)); there.ok() && std::ranges::equal(*there, bytes)) return ref;
  }
  LL_RETURN_IF_ERROR(write_file_atomic(path(ref.digest), bytes));
  return ref;
}

absl::StatusOr<std::vector<uint8_t>> ChunkStore::get(const ChunkRef& ref) const {
  LL_ASSIGN_OR_RETURN(auto bytes, read_file(path(ref.digest)));
  if (bytes.size() != ref.size || sha256(bytes) != ref.digest) {
    return absl::DataLossError("chunk " + path(ref.digest).string() +
                               " does not have the bytes its name says; bake again or fetch it again");
  }
  return bytes;
}

ChunkStore chunk_store(const std::filesystem::path& loom) { return ChunkStore(loom / "chunks"); }

absl::Status write_manifest(const std::filesystem::path& loom, const Manifest& manifest,
                            std::span<const uint8_t> traces) {
  const std::vector<uint8_t> bytes = encode_manifest(manifest);
  const std::filesystem::path its_traces = traces_path(loom, bytes);
  if (!traces.empty()) {
    std::vector<uint8_t> sealed(traces.begin(), traces.end());
    const Digest seal = sha256(traces);
    sealed.insert(sealed.end(), seal.bytes.begin(), seal.bytes.end());
    LL_RETURN_IF_ERROR(write_file_atomic(its_traces, sealed));
  }
  LL_RETURN_IF_ERROR(write_file_atomic(loom / "manifest", bytes));
  remove_traces_but(its_traces);
  return absl::OkStatus();
}

absl::StatusOr<std::vector<uint8_t>> read_traces(const std::filesystem::path& loom, const Manifest& manifest) {
  const std::filesystem::path path = traces_path(loom, encode_manifest(manifest));
  LL_ASSIGN_OR_RETURN(auto bytes, read_file(path));
  Digest seal;
  if (bytes.size() >= seal.bytes.size()) {
    std::copy(bytes.end() - static_cast<ptrdiff_t>(seal.bytes.size()), bytes.end(), seal.bytes.begin());
    bytes.resize(bytes.size() - seal.bytes.size());
    if (sha256(bytes) == seal) return bytes;
  }
  return absl::DataLossError(path.string() + " is damaged; bake again");
}

absl::StatusOr<Manifest> read_manifest(const std::filesystem::path& loom) {
  const std::filesystem::path path = loom / "manifest";
  LL_ASSIGN_OR_RETURN(const auto bytes, read_file(path));
  auto manifest = decode_manifest(bytes);
  if (!manifest.ok()) return in_context(manifest.status(), path.string());
  return manifest;
}

absl::Status verify_asset(const std::filesystem::path& loom) {
  LL_ASSIGN_OR_RETURN(const Manifest m, read_manifest(loom));
  const ChunkStore store = chunk_store(loom);

  Surfaces surfaces;
  for (const ObjectEntry& o : m.objects) surfaces[o.id].object = &o;

  for (const ObjectEntry& o : m.objects) {
    if (o.surface.size == 0) continue;
    const std::string what = "surface of object '" + printable(o.name) + "'";
    LL_ASSIGN_OR_RETURN(const auto bytes, store.get(o.surface));
    const auto chunk = decode_surface(bytes);
    if (!chunk.ok()) return in_context(chunk.status(), what);
    if (chunk->object.id != o.id) return mismatch(what);
    LL_RETURN_IF_ERROR(find_objects({chunk->object}, what, &surfaces).status());
    surfaces[o.id].keys = chunk->keys;
    surfaces[o.id].lit.resize(chunk->keys.size());
  }
  for (size_t i = 0; i < m.probes.size(); ++i) {
    const std::string what = "relight set of probe " + std::to_string(i);
    LL_ASSIGN_OR_RETURN(const auto bytes, store.get(m.probes[i].relight));
    const auto chunk = decode_relight(bytes);
    if (!chunk.ok()) return in_context(chunk.status(), what);
    if (chunk->rays.size() != static_cast<size_t>(m.params.relight_rays) || chunk->position != m.probes[i].position) {
      return mismatch(what);
    }
    LL_ASSIGN_OR_RETURN(const std::vector<Surface*> objects, find_objects(chunk->objects, what, &surfaces));
    LL_RETURN_IF_ERROR(check_codes(chunk->objects, chunk->rays, objects, what));
  }
  for (size_t i = 0; i < m.cells.size(); ++i) {
    const std::string what = "cell " + std::to_string(i);
    LL_ASSIGN_OR_RETURN(const auto bytes, store.get(m.cells[i].chunk));
    const auto chunk = decode_cell(bytes);
    if (!chunk.ok()) return in_context(chunk.status(), what);
    LL_RETURN_IF_ERROR(verify_cell(m, m.cells[i], *chunk, what, &surfaces));
  }
  if (const auto traces = read_traces(loom, m); !traces.ok() && !absl::IsNotFound(traces.status())) {
    return traces.status();
  }
  return absl::OkStatus();
}

}  // namespace lightloom
