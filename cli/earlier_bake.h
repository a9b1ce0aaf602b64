// What a folder's asset knows of its bake: its parameters, and results that may still hold.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/asset/manifest.h"
#include "core/scene/scene.h"

namespace lightloom {

struct EarlierBake {
  std::string loom;
  Manifest manifest;
  std::vector<uint8_t> traces;  ///< encode_bake_traces(); empty: no result can be used again
  std::string why_not;          ///< why the traces are empty
  double tolerance = 0;         ///< up to which its results may be kept stale: the caller's choice
};

/// Nothing if there is no asset, or one whose manifest this program cannot read: then the next bake knows nothing.
std::optional<EarlierBake> find_earlier_bake(const std::string& loom);

/// Whether a bake of the scene by these parameters would give the very same manifest: nothing that matters has changed, and
/// no cell is staler than the tolerance.
bool is_up_to_date(const EarlierBake& bake, const Scene& scene, const BakeParams& params);

}  // namespace lightloom
