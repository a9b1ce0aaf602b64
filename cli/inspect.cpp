// lightloom inspect: what is inside an asset.
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "cli/command.h"
#include "cli/files.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/asset/asset.h"
#include "core/base/text.h"
#include "core/scene/image.h"

namespace lightloom {
namespace {

struct Options {
  std::string loom, heatmap, quantity = "error";
  bool json = false, cells = false;
};

/// Blue, green, yellow, red for 0..1.
Vec3 heat(float t) {
  t = std::clamp(t, 0.0f, 1.0f) * 3;
  if (t < 1) return {0, t, 1 - t};
  if (t < 2) return {t - 1, 1, 0};
  return {1, 3 - t, 0};
}

/// The lightmap image, each receiver in the colour of its cluster's error or rank. Returns the value that is red.
absl::StatusOr<float> write_heatmap(const Options& o, const Manifest& m) {
  const auto value = [&](const ClusterEntry& c) {
    return o.quantity == "error" ? c.error : static_cast<float>(o.quantity == "rank" ? c.rank : c.probes);
  };
  float top = 0;
  for (const ClusterEntry& c : m.clusters) top = std::max(top, value(c));
  Image image(m.width, m.height, {"R", "G", "B"});
  const ChunkStore store = chunk_store(o.loom);
  for (const CellEntry& cell : m.cells) {
    LL_ASSIGN_OR_RETURN(const auto bytes, store.get(cell.chunk));
    LL_ASSIGN_OR_RETURN(const CellChunk chunk, decode_cell(bytes));
    for (size_t k = 0; k < chunk.clusters.size() && k < cell.clusters; ++k) {
      const Vec3 colour = heat(top > 0 ? value(m.clusters[cell.first_cluster + k]) / top : 0);
      for (uint32_t r = 0; r < chunk.clusters[k].receivers; ++r) {
        const TexelRef texel = chunk.receivers[chunk.clusters[k].first_receiver + r];
        const ChunkObject& object = chunk.objects[texel.slot];
        if (texel.key >= object.width * object.height) continue;  // back side
        const auto entry =
            std::find_if(m.objects.begin(), m.objects.end(), [&](const ObjectEntry& e) { return e.id == object.id; });
        if (entry == m.objects.end())
          return absl::DataLossError("a cell names an object that the manifest lacks; run lightloom verify");
        if (object.width != static_cast<uint32_t>(entry->width) ||
            object.height != static_cast<uint32_t>(entry->height)) {
          return absl::DataLossError("a cell and the manifest differ about an object's lightmap; run lightloom verify");
        }
        image.set_rgb(entry->x + static_cast<int>(texel.key % object.width),
                      entry->y + static_cast<int>(texel.key / object.width), colour);
      }
    }
  }
  LL_RETURN_IF_ERROR(write_png(image, o.heatmap));
  return top;
}

struct Summary {
  uint64_t receivers = 0, bytes = 0, relight = 0, surface = 0, cell = 0;
  double coefficients = 0, probes_per_cluster = 0, error2 = 0, unseen = 0;
  uint32_t max_rank = 0;
  uint64_t traces = 0;           ///< bytes beside the asset; for rebakes
  uint64_t above_threshold = 0;  ///< clusters whose error stays above the threshold at the greatest rank
};

Summary summarise(const Manifest& m) {
  Summary s;
  for (const CellEntry& c : m.cells) {
    s.receivers += c.receivers;
    s.cell += c.chunk.size;
    s.unseen += static_cast<double>(c.unseen) * c.receivers;
  }
  for (const ClusterEntry& c : m.clusters) {
    s.coefficients += static_cast<double>(c.rank) * c.receivers;
    s.probes_per_cluster += c.probes;
    s.error2 += static_cast<double>(c.error) * c.error * c.receivers;
    s.max_rank = std::max(s.max_rank, c.rank);
    s.above_threshold += c.error > m.params.threshold;
  }
  for (const ProbeEntry& p : m.probes) s.relight += p.relight.size;
  for (const ObjectEntry& o : m.objects) s.surface += o.surface.size;
  const double receivers = std::max<double>(1, static_cast<double>(s.receivers));
  s.coefficients /= receivers;
  s.unseen /= receivers;
  s.error2 /= receivers;
  s.probes_per_cluster /= std::max<double>(1, static_cast<double>(m.clusters.size()));
  s.bytes = s.cell + s.relight + s.surface;
  return s;
}

nlohmann::json to_json(const Manifest& m, const Summary& s, bool with_cells) {
  nlohmann::json out = {
      {"method_version", m.method_version},
      {"scene_hash", m.scene_hash.hex()},
      {"lightmap", {m.width, m.height}},
      {"params",
       {{"method", m.params.method == BakeMethod::kSl17 ? "sl17" : "default"},
        {"order", m.params.order},
        {"spacing", m.params.spacing},
        {"near_field", m.params.near_field},
        {"links", m.params.links},
        {"rays", m.params.rays},
        {"relight_rays", m.params.relight_rays},
        {"max_rank", m.params.max_rank},
        {"average", m.params.average},
        {"threshold", m.params.threshold},
        {"texels_per_metre", m.params.texels_per_metre},
        {"lightmap_size", m.params.lightmap_size},
        {"seed", m.params.seed}}},
      {"objects", m.objects.size()},
      {"receivers", s.receivers},
      {"probes", m.probes.size()},
      {"cells", m.cells.size()},
      {"clusters", m.clusters.size()},
      {"coefficients_per_receiver", s.coefficients},
      {"probes_per_cluster", s.probes_per_cluster},
      {"clusters_above_threshold", s.above_threshold},
      {"error", std::sqrt(s.error2)},
      {"unseen_fraction", s.unseen},
      {"bytes",
       {{"total", s.bytes}, {"cells", s.cell}, {"relight", s.relight}, {"surfaces", s.surface}, {"traces", s.traces}}}};
  if (with_cells) {
    for (const CellEntry& c : m.cells) {
      out["cell_list"].push_back({{"level", c.level},
                                  {"cell", c.cell},
                                  {"receivers", c.receivers},
                                  {"clusters", c.clusters},
                                  {"probes", c.probes},
                                  {"error", c.error},
                                  {"unseen", c.unseen},
                                  {"chunk", c.chunk.digest.hex()},
                                  {"bytes", c.chunk.size}});
    }
  }
  return out;
}

void print(const Options& o, const Manifest& m, const Summary& s) {
  std::printf("%s: %s (cells %s, relight sets %s, surfaces %s), method %s\n", escape_controls(o.loom).c_str(),
              human_bytes(static_cast<double>(s.bytes)).c_str(), human_bytes(static_cast<double>(s.cell)).c_str(),
              human_bytes(static_cast<double>(s.relight)).c_str(), human_bytes(static_cast<double>(s.surface)).c_str(),
              printable(m.method_version).c_str());
  std::printf("  level     %zu objects, %.1f × %.1f × %.1f m, lightmap %d×%d\n", m.objects.size(),
              static_cast<double>(m.bounds.size().x), static_cast<double>(m.bounds.size().y),
              static_cast<double>(m.bounds.size().z), m.width, m.height);
  if (s.traces > 0) {
    std::printf("  traces    %s besides, for rebakes\n", human_bytes(static_cast<double>(s.traces)).c_str());
  }
  std::printf("  probes    %zu of order %d, spacing %.3g m, %d relight rays each\n", m.probes.size(), m.params.order,
              static_cast<double>(m.params.spacing), m.params.relight_rays);
  std::printf("  near      within %.3g m receivers read texels, not probes\n",
              static_cast<double>(m.params.near_field));
  std::printf("  receivers %llu in %zu cells, %zu clusters\n", static_cast<unsigned long long>(s.receivers),
              m.cells.size(), m.clusters.size());
  std::printf("  rank      %.1f coefficients a receiver (most %u), %.1f probes a cluster\n", s.coefficients, s.max_rank,
              s.probes_per_cluster);
  std::printf("  threshold %llu of %zu clusters end above %.3g: --max-rank %d keeps them there\n",
              static_cast<unsigned long long>(s.above_threshold), m.clusters.size(),
              static_cast<double>(m.params.threshold), m.params.max_rank);
  std::printf("  quality   truncation error %.4f, unseen %.4f %%\n", std::sqrt(s.error2), 100 * s.unseen);
  if (!o.cells) return;
  std::printf("  %5s %18s %9s %8s %6s %8s %8s %10s  chunk\n", "level", "cell", "receivers", "clusters", "probes",
              "error", "unseen", "bytes");
  for (const CellEntry& c : m.cells) {
    char where[64];
    std::snprintf(where, sizeof where, "%d,%d,%d", c.cell[0], c.cell[1], c.cell[2]);
    std::printf("  %5d %18s %9u %8u %6u %8.4f %8.4f %10llu  %s\n", c.level, where, c.receivers, c.clusters, c.probes,
                static_cast<double>(c.error), static_cast<double>(c.unseen),
                static_cast<unsigned long long>(c.chunk.size), c.chunk.digest.hex().substr(0, 12).c_str());
  }
}

absl::Status check(const Options& o) {
  if (o.quantity != "error" && o.quantity != "rank" && o.quantity != "probes") {
    return absl::InvalidArgumentError("--quantity must be error, rank or probes");
  }
  LL_RETURN_IF_ERROR(check_loom(o.loom));
  return o.heatmap.empty() ? absl::OkStatus() : OutputCheck({}).file("--heatmap", o.heatmap, {".png"});
}

absl::Status run(const Options& o) {
  LL_ASSIGN_OR_RETURN(const Manifest m, read_manifest(o.loom));
  Summary s = summarise(m);
  if (const auto traces = read_traces(o.loom, m); traces.ok()) s.traces = traces->size();
  if (o.json) {
    print_json(to_json(m, s, o.cells));
  } else {
    print(o, m, s);
  }
  if (!o.heatmap.empty()) {
    LL_ASSIGN_OR_RETURN(const float top, write_heatmap(o, m));
    if (!o.json)
      std::printf("  %s: %s per cluster, blue 0 to red %.4g\n", escape_controls(o.heatmap).c_str(), o.quantity.c_str(),
                  static_cast<double>(top));
  }
  return absl::OkStatus();
}

}  // namespace

Command inspect_command() {
  const auto o = std::make_shared<Options>();
  return {"inspect",
          "Show what is inside an asset: sizes, ranks, probes, quality",
          {{"OUT", ".loom folder", &o->loom, true},
           {"--cells", "list every bake cell", &o->cells},
           {"--heatmap", "PNG of the lightmap to write, coloured by cluster", &o->heatmap},
           {"--quantity", "what the heat map shows: error, rank or probes", &o->quantity},
           {"--json", "print as JSON", &o->json}},
          [o] { return check(*o); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
