#include "runtime/streaming/streamer.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "core/base/overlap.h"
#include "runtime/boundary.h"

namespace lightloom {
namespace {

/// Where the camera will be so many seconds from now is worth so much.
struct Ahead {
  float seconds, worth;
};
constexpr Ahead kAhead[] = {{0, 1}, {0.5f, 0.5f}, {1, 0.25f}};
/// What was important is still a bit, less with each view: about the least recently needed goes first.
constexpr float kRecent = 0.1f, kForget = 0.95f;
constexpr float kPinned = 1000;
/// Views for which the budget is what the backend has room for, before more is tried again.
constexpr uint64_t kSqueezed = 600;
/// Views of one place after which it is looked at again: what was important before is forgotten by then.
constexpr uint64_t kStill = 16;
/// Bases that are loaded between two looks.
constexpr uint32_t kSights = 64;

bool is_full(lightloom_result result) {
  return result == LIGHTLOOM_ERROR_OVER_BUDGET || result == LIGHTLOOM_ERROR_OUT_OF_MEMORY;
}
/// And not the lack of memory, or of another chunk that must come first.
bool is_the_chunks_fault(lightloom_result result) { return result != LIGHTLOOM_ERROR_NOT_READY && !is_full(result); }

constexpr uint8_t kBase = 1;
static_assert(static_cast<uint8_t>(CellLevel::kBase) == kBase && static_cast<uint8_t>(ProbeLevel::kBase) == kBase);

}  // namespace

Streamer::Streamer(Backend* backend, ReadChunk read, StreamOptions options)
    : backend_(backend),
      read_(std::move(read)),
      options_(std::move(options)),
      index_(backend->index()),
      costs_(index_),
      sight_(index_),
      importance_(index_.cells().size()),
      base_order_(index_.cells().size()),
      failures_(index_.objects().size() + index_.probes().size() + index_.cells().size()),
      surfaces_(index_.objects().size()),
      budget_(options_.budget) {
  std::iota(base_order_.begin(), base_order_.end(), 0);
  now_.cells.assign(index_.cells().size(), CellLevel::kNone);
  now_.probes.assign(index_.probes().size(), ProbeLevel::kNone);
}

void Streamer::set_view(const StreamView& view) {
  const std::lock_guard lock(mutex_);
  if (!(view == view_)) state_.done = false;
  view_ = view;
  ++views_;
}

void Streamer::pin(std::vector<Aabb> boxes) {
  const std::lock_guard lock(mutex_);
  pins_ = std::move(boxes);
  pins_are_new_ = true;
  ++views_;
  state_.done = false;
}

StreamState Streamer::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

std::vector<CellLevel> Streamer::cell_levels() const {
  const std::lock_guard lock(mutex_);
  return now_.cells;
}

/// New sights change the order little by little; when all are there, for good.
bool Streamer::looks_again() const { return unseen_ >= kSights || (unseen_ > 0 && next_base_ == base_order_.size()); }

/// What is to be resident for the view as it is now.
void Streamer::look() {
  StreamView view;
  std::vector<Aabb> pins;
  float forget = 1;
  {
    const std::lock_guard lock(mutex_);
    const bool again = looks_again();
    if (seen_view_ == views_ && !again) return;
    // What was put off may be due.
    next_surface_ = next_base_ = next_step_ = 0;
    const bool news = again || !(view_ == seen_) || pins_are_new_ || views_ - looked_view_ >= kStill;
    seen_view_ = views_;
    if (!news) return;
    forget = std::pow(kForget, static_cast<float>(views_ - std::exchange(looked_view_, views_)));
    pins_are_new_ = false;
    seen_ = view = view_;
    pins = pins_;
  }
  for (float& i : importance_) i *= forget;
  if (squeezed_until_ && seen_view_ >= *squeezed_until_) {
    squeezed_until_.reset();
    budget_ = options_.budget;
  }
  unseen_ = 0;
  std::vector<float> seen(index_.cells().size());
  for (const Ahead& ahead : kAhead) {
    if (ahead.seconds > 0 && view.velocity == Vec3{}) continue;
    const std::vector<float> from = sight_.importance(view.position + view.velocity * ahead.seconds);
    for (size_t c = 0; c < seen.size(); ++c) seen[c] = std::max(seen[c], ahead.worth * from[c]);
  }
  for (uint32_t c = 0; c < seen.size(); ++c) {
    importance_[c] = std::max(importance_[c], kRecent * seen[c]);
    seen[c] = std::max(seen[c], importance_[c]);
    if (std::any_of(pins.begin(), pins.end(),
                    [&](const Aabb& box) { return overlaps(box, index_.cells()[c].bounds); })) {
      seen[c] += kPinned;
    }
  }
  std::sort(base_order_.begin(), base_order_.end(),
            [&](uint32_t a, uint32_t b) { return seen[a] != seen[b] ? seen[a] > seen[b] : a < b; });
  steps_ = rank_steps(index_, costs_, seen, now_);
  want_ = choose_levels(index_, costs_, steps_, budget_);
}

const ChunkRef& Streamer::ref_of(const AssetIndex::Target& target) const {
  switch (target.kind) {
    case AssetIndex::Kind::kSurface:
      return index_.objects()[target.index].surface;
    case AssetIndex::Kind::kRelight:
      return index_.probes()[target.index].relight;
    case AssetIndex::Kind::kCell:
      break;
  }
  return index_.cells()[target.index].chunk;
}

uint8_t Streamer::level_of(const AssetIndex::Target& target) const {
  if (target.kind == AssetIndex::Kind::kSurface) return surfaces_[target.index] ? kBase : 0;
  if (target.kind == AssetIndex::Kind::kRelight) return static_cast<uint8_t>(now_.probes[target.index]);
  return static_cast<uint8_t>(now_.cells[target.index]);
}

uint64_t Streamer::bytes_of(const AssetIndex::Target& target, uint8_t level) const {
  if (target.kind == AssetIndex::Kind::kSurface) return 0;
  if (target.kind == AssetIndex::Kind::kRelight) return costs_.probe(static_cast<ProbeLevel>(level));
  return costs_.cell(target.index, static_cast<CellLevel>(level));
}

void Streamer::set_level(const AssetIndex::Target& target, uint8_t level) {
  const std::lock_guard lock(mutex_);
  state_.bytes += bytes_of(target, level);
  state_.bytes -= bytes_of(target, level_of(target));
  const auto count = [&](uint8_t at) -> uint32_t* {
    if (at == 0 || target.kind == AssetIndex::Kind::kSurface) return nullptr;
    if (target.kind == AssetIndex::Kind::kRelight) return at == kBase ? &state_.base_probes : &state_.all_probes;
    return at == kBase                                    ? &state_.base_cells
           : at == static_cast<uint8_t>(CellLevel::kSome) ? &state_.some_cells
                                                          : &state_.all_cells;
  };
  if (uint32_t* const n = count(level_of(target))) --*n;
  if (uint32_t* const n = count(level)) ++*n;
  if (target.kind == AssetIndex::Kind::kSurface) {
    surfaces_[target.index] = level != 0;
  } else if (target.kind == AssetIndex::Kind::kRelight) {
    now_.probes[target.index] = static_cast<ProbeLevel>(level);
  } else {
    now_.cells[target.index] = static_cast<CellLevel>(level);
  }
}

size_t Streamer::number_of(const AssetIndex::Target& target) const {
  if (target.kind == AssetIndex::Kind::kSurface) return target.index;
  if (target.kind == AssetIndex::Kind::kRelight) return index_.objects().size() + target.index;
  return index_.objects().size() + index_.probes().size() + target.index;
}

bool Streamer::waits(const AssetIndex::Target& target) const { return failures_[number_of(target)].retry > seen_view_; }

uint8_t Streamer::wanted(const AssetIndex::Target& target) const {
  return target.kind == AssetIndex::Kind::kCell ? static_cast<uint8_t>(want_.cells[target.index])
                                                : static_cast<uint8_t>(want_.probes[target.index]);
}

/// Surfaces, then base after base with the probes that each one needs, so that it lights as soon as it is there.
std::optional<Streamer::Wish> Streamer::next_base() {
  for (; next_surface_ < surfaces_.size(); ++next_surface_) {
    const AssetIndex::Target surface{AssetIndex::Kind::kSurface, static_cast<uint32_t>(next_surface_)};
    if (surfaces_[next_surface_] || ref_of(surface).size == 0 || waits(surface)) continue;
    return Wish{surface, kBase};
  }
  for (; next_base_ < base_order_.size(); ++next_base_) {
    const uint32_t c = base_order_[next_base_];
    if (now_.cells[c] != CellLevel::kNone) continue;
    for (const uint32_t p : index_.probes_of(c)) {
      const AssetIndex::Target probe{AssetIndex::Kind::kRelight, p};
      if (now_.probes[p] == ProbeLevel::kNone && !waits(probe)) return Wish{probe, kBase};
    }
    const AssetIndex::Target cell{AssetIndex::Kind::kCell, c};
    if (!waits(cell)) return Wish{cell, kBase};
  }
  return std::nullopt;
}

/// The best step that is wanted and not there, as far up as it is wanted.
std::optional<Streamer::Wish> Streamer::next_step() {
  for (; next_step_ < steps_.size(); ++next_step_) {
    const StreamStep& s = steps_[next_step_];
    const AssetIndex::Target target{s.kind, s.index};
    const uint8_t want = wanted(target), now = level_of(target);
    if (s.level <= want && now != 0 && now < want && !waits(target)) return Wish{target, want};
  }
  return std::nullopt;
}

/// Drops details that are not wanted, the least worth first, until so many bytes are free. False if there are none left.
bool Streamer::make_room(uint64_t bytes) {
  for (auto s = steps_.rbegin(); s != steps_.rend() && state_.bytes + bytes > budget_; ++s) {
    const AssetIndex::Target target{s->kind, s->index};
    if (level_of(target) > std::max(wanted(target), kBase)) drop(target);
  }
  return state_.bytes + bytes <= budget_;
}

void Streamer::drop(const AssetIndex::Target& target) {
  if (!backend_->drop_detail(ref_of(target).digest).ok()) return;
  set_level(target, kBase);
  const std::lock_guard lock(mutex_);
  ++state_.drops;
}

Streamer::Progress Streamer::step() {
  look();
  if (backend_->pending_bytes() > options_.queue_bytes) return Progress::kWait;
  std::optional<Wish> wish = next_base();
  if (!wish && looks_again()) look();  // all sights are known now
  if (!wish) wish = next_step();
  {
    const std::lock_guard lock(mutex_);
    state_.done = !wish && view_ == seen_;
  }
  if (!wish) return Progress::kDone;
  const uint64_t more = bytes_of(wish->target, wish->level) - bytes_of(wish->target, level_of(wish->target));
  if (!make_room(more) && wish->level != kBase) return Progress::kWait;
  return load(*wish);
}

Streamer::Progress Streamer::load(const Wish& wish) {
  const ChunkRef& ref = ref_of(wish.target);
  absl::Status status = check_chunk_size(ref);
  if (status.ok()) {
    chunk_.resize(ref.size);
    status = read_(ref, chunk_);
  }
  absl::StatusOr<DecodedChunk> chunk = status.ok() ? backend_->decode(ref.digest, chunk_) : status;
  if (!chunk.ok()) return put_off(wish.target, chunk.status());
  {
    const std::lock_guard lock(mutex_);
    ++state_.read_chunks;
    state_.read_bytes += ref.size;
  }
  if (wish.target.kind == AssetIndex::Kind::kSurface) sight_.add_surface(wish.target.index, chunk->surface.positions);
  if (wish.level == kBase && wish.target.kind == AssetIndex::Kind::kRelight) {
    sight_.add_probe(wish.target.index, chunk->rays);
    ++unseen_;
  }
  const Detail detail = wish.target.kind == AssetIndex::Kind::kCell ? detail_of(static_cast<CellLevel>(wish.level))
                                                                    : detail_of(static_cast<ProbeLevel>(wish.level));
  const bool moving = backend_->pending_bytes() > 0;
  status = backend_->load(*std::move(chunk), detail);
  if (!status.ok()) return no_room(wish.target, status, moving);
  set_level(wish.target, wish.level);
  note_failure(wish.target, {});
  return Progress::kStep;
}

void Streamer::note_failure(const AssetIndex::Target& target, Failure failure) {
  Failure& noted = failures_[number_of(target)];
  const std::lock_guard lock(mutex_);
  state_.failing += (failure.times > 0) - (noted.times > 0);
  noted = failure;
}

Streamer::Progress Streamer::no_room(const AssetIndex::Target& target, const absl::Status& status, bool moving) {
  const lightloom_result result = result_of(status);
  if (is_the_chunks_fault(result)) return put_off(target, status);
  // Uploads that are to come free what they replace, and what was dropped is free some frames later.
  // The last of them may have come since the load was refused.
  if (moving || backend_->pending_bytes() > 0) return Progress::kWait;
  if (is_full(result) && failures_[number_of(target)].times > 0) {
    // There was time enough: this is all there is, for now.
    budget_ = state_.bytes;
    squeezed_until_ = seen_view_ + kSqueezed;
    unseen_ = kSights;
  }
  return put_off(target, status);
}

/// Others go on meanwhile.
Streamer::Progress Streamer::put_off(const AssetIndex::Target& target, const absl::Status& status) {
  const uint32_t times = failures_[number_of(target)].times + 1;
  if (times == 1 && options_.report && is_the_chunks_fault(result_of(status))) options_.report(status);
  note_failure(target, {times, seen_view_ + (uint64_t{16} << std::min(times, 10u))});
  return Progress::kStep;
}

}  // namespace lightloom
