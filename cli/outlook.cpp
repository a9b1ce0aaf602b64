#include "cli/outlook.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

namespace lightloom {
namespace {

std::string why(const ReuseItem& item) {
  if (item.why == ReuseItem::kUnknown) return "its receivers, its probes or the parameters are others";
  char text[100];
  std::snprintf(text, sizeof text, "up to %.2g %% of its rays pass where something has changed", 100 * item.share);
  return text;
}

}  // namespace

Outlook::Outlook(const Plan& plan, const Reuse& reuse) : plan_(plan), reuse_(reuse) {
  for (const uint32_t i : dirty_first(reuse.cells)) {
    receivers_ += plan.cells[i].receivers.size();
    ++cells_;
  }
  probes_ = dirty_first(reuse.probes).size();
}

nlohmann::json Outlook::to_json(bool explain) const {
  nlohmann::json out = {{"cells", plan_.cells.size()},
                        {"cells_dirty", cells_},
                        {"probes", plan_.placement.probes.size()},
                        {"probes_dirty", probes_},
                        {"receivers", plan_.receivers.all.size()},
                        {"receivers_dirty", receivers_}};
  if (!explain) return out;
  out["dirty"] = nlohmann::json::array();
  for (const uint32_t i : dirty_first(reuse_.cells)) {
    const PlannedCell& cell = plan_.cells[i];
    out["dirty"].push_back({{"level", cell.level},
                            {"cell", cell.cell},
                            {"receivers", cell.receivers.size()},
                            {"why", why(reuse_.cells[i])},
                            {"share", reuse_.cells[i].share}});
  }
  return out;
}

void Outlook::print(bool explain) const {
  const size_t all = plan_.receivers.all.size();
  std::printf("to bake: %zu of %zu cells (%.1f %% of the receivers), %zu of %zu relight sets\n", cells_,
              plan_.cells.size(), 100 * static_cast<double>(receivers_) / static_cast<double>(all), probes_,
              plan_.placement.probes.size());
  if (!explain) return;
  for (const uint32_t i : dirty_first(reuse_.cells)) {
    Aabb bounds;
    for (const uint32_t r : plan_.cells[i].receivers) bounds.extend(plan_.receivers.all[r].point.position);
    const Vec3 middle = bounds.center();
    std::printf("  %zu receivers around (%.1f, %.1f, %.1f): %s\n", plan_.cells[i].receivers.size(),
                static_cast<double>(middle.x), static_cast<double>(middle.y), static_cast<double>(middle.z),
                why(reuse_.cells[i]).c_str());
  }
}

}  // namespace lightloom
