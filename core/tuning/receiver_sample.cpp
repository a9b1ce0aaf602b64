#include "core/tuning/receiver_sample.h"

#include <algorithm>

#include "core/base/rng.h"

namespace lightloom {

std::vector<uint32_t> front_receivers(const Receivers& receivers) {
  std::vector<uint32_t> fronts, all;
  for (uint32_t i = 0; i < receivers.all.size(); ++i) {
    all.push_back(i);
    if (!receivers.all[i].back) fronts.push_back(i);
  }
  return fronts.empty() ? all : fronts;
}

std::vector<uint32_t> stratified(std::span<const uint32_t> receivers, size_t count, uint64_t seed) {
  count = std::min(count, receivers.size());
  std::vector<uint32_t> out;
  for (size_t i = 0; i < count; ++i) {
    const size_t first = i * receivers.size() / count, end = (i + 1) * receivers.size() / count;
    Rng rng(hash_combine(seed, i));
    out.push_back(receivers[first + rng.next_below(static_cast<uint32_t>(end - first))]);
  }
  return out;
}

PlannedCell cell_of_one(uint32_t receiver) {
  PlannedCell cell;
  cell.receivers = {receiver};
  return cell;
}

}  // namespace lightloom
