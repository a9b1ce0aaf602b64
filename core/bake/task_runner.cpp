#include "core/bake/task_runner.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <string_view>

#include "core/bake/load_glb.h"
#include "core/bake/reuse.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

bool cancelled(const BakeControl& control) { return control.cancel != nullptr && control.cancel->cancelled(); }

/// What a task made, on its way to storage: little by little would cost a message each.
class Outgoing {
 public:
  explicit Outgoing(BlobAccess* blobs) : blobs_(*blobs) {}

  absl::StatusOr<ChunkRef> add(std::span<const uint8_t> bytes) {
    waiting_.emplace_back(bytes.begin(), bytes.end());
    waiting_bytes_ += bytes.size();
    if (waiting_bytes_ > kMostWaiting) LL_RETURN_IF_ERROR(send());
    return ChunkRef{sha256(bytes), bytes.size()};
  }
  absl::Status send() {
    if (waiting_.empty()) return absl::OkStatus();
    LL_RETURN_IF_ERROR(blobs_.put(waiting_));
    waiting_.clear();
    waiting_bytes_ = 0;
    return absl::OkStatus();
  }

 private:
  static constexpr uint64_t kMostWaiting = uint64_t{4} << 20;

  BlobAccess& blobs_;
  std::vector<std::vector<uint8_t>> waiting_;
  uint64_t waiting_bytes_ = 0;
};

/// What a task works with.
struct Context {
  const BakeSession& session;
  BlobAccess& blobs;
  Outgoing& outgoing;
  const BakeTask& task;
  TaskArgument argument;
  const BakeControl& control;

  void report(uint64_t done, uint64_t total, uint64_t rays) const {
    if (control.progress) control.progress(task.kind, done, total, rays);
  }
  ChunkSink sink() const {
    return [this](std::span<const uint8_t> bytes) { return outgoing.add(bytes); };
  }
  absl::StatusOr<Digest> put(std::span<const uint8_t> bytes) const {
    LL_ASSIGN_OR_RETURN(const ChunkRef ref, outgoing.add(bytes));
    return ref.digest;
  }
};

/// The blob, or an error that says what it was wanted for. Storage is not trusted: other bytes would give other bakes.
absl::StatusOr<std::vector<uint8_t>> fetch(BlobAccess* blobs, const Digest& digest, std::string_view what) {
  const std::string name = std::string(what) + ", blob " + digest.hex();
  auto bytes = blobs->get(digest);
  if (!bytes.ok()) {
    return absl::Status(bytes.status().code(),
                        "cannot read " + name + ": " + std::string(bytes.status().message()) + "; store it again");
  }
  if (sha256(*bytes) != digest)
    return absl::DataLossError(name + " has other bytes than its name says; store it again");
  return bytes;
}

absl::StatusOr<BakeTraces> fetch_traces(const Context& c, const Digest& digest) {
  LL_ASSIGN_OR_RETURN(const auto bytes, fetch(&c.blobs, digest, "the traces of the earlier bake"));
  return decode_bake_traces(bytes);
}

ReusedResults reused_results(const Digest& traces, const Reuse& reuse) {
  const auto held = [](const std::vector<ReuseItem>& items) {
    std::vector<ReusedResults::Item> out(items.size());
    for (size_t i = 0; i < items.size(); ++i) {
      if (items[i].why == ReuseItem::kHolds) out[i] = {items[i].earlier, static_cast<float>(items[i].share)};
    }
    return out;
  };
  return {traces, held(reuse.cells), held(reuse.probes)};
}

absl::StatusOr<TaskOutput> run_plan(const Context& c) {
  const Plan& plan = c.session.plan();
  PlanSummary summary;
  summary.plan = c.session.plan_digest();
  summary.receivers = plan.receivers.all.size();
  summary.cells = static_cast<uint32_t>(plan.cells.size());
  summary.probes = static_cast<uint32_t>(plan.placement.probes.size());
  summary.objects = static_cast<uint32_t>(c.session.scene().objects.size());
  TaskOutput out;
  LL_ASSIGN_OR_RETURN(const Digest blob, c.put(encode_plan_summary(summary)));
  out.outputs.push_back(blob);
  auto reuse = std::make_shared<const Reuse>(no_reuse(plan));
  if (!c.task.argument.empty()) {
    LL_ASSIGN_OR_RETURN(const EarlierResults earlier, decode_earlier_results(c.task.argument));
    const auto load = [&] { return fetch_traces(c, earlier.traces); };
    LL_ASSIGN_OR_RETURN(reuse, c.session.reuse(earlier, load, c.control.stage("reuse")));
    LL_ASSIGN_OR_RETURN(const Digest reused, c.put(encode_reused_results(reused_results(earlier.traces, *reuse))));
    out.outputs.push_back(reused);
  }

  // What an edit may have changed most comes first; among equals the octree's order, as neighbours share what a worker
  // remembers.
  int64_t order = 0;
  const auto spawn = [&](const char* kind, uint32_t stage, uint32_t first, uint32_t count) {
    out.spawned.push_back({kind, stage, encode_argument({summary.plan, first, count}), order++});
  };
  for (const uint32_t i : dirty_first(reuse->cells)) spawn("cell", 1, i, 1);
  for (uint32_t i = 0; i < summary.probes;) {
    uint32_t end = i;
    while (end < summary.probes && end - i < kRelightProbes && reuse->probes[end].why != ReuseItem::kHolds) ++end;
    if (end > i) spawn("relight", 1, i, end - i);
    i = std::max(end, i + 1);
  }
  for (uint32_t i = 0; i < summary.objects; i += kSurfaceObjects) {
    spawn("surfaces", 1, i, std::min(kSurfaceObjects, summary.objects - i));
  }
  spawn("assemble", 2, 0, 0);
  return out;
}

/// The session is there: that was all.
absl::StatusOr<TaskOutput> run_warm(const Context&) { return TaskOutput(); }

absl::StatusOr<TaskOutput> run_cell(const Context& c) {
  LL_ASSIGN_OR_RETURN(const BakedCell cell, c.session.cell(c.argument.first, c.sink(), c.control.cancel));
  TaskOutput out;
  LL_ASSIGN_OR_RETURN(const Digest record, c.put(encode_cell_record(cell.record)));
  out.outputs = {record, cell.record.chunk.digest};
  out.rays = cell.record.gather_rays + cell.visibility_rays;
  return out;
}

absl::StatusOr<TaskOutput> run_relight(const Context& c) {
  const uint64_t rays = static_cast<uint64_t>(c.session.plan().params.relight_rays);
  std::vector<RelightRecord> records;
  // One by one, to report each.
  for (uint32_t i = 0; i < c.argument.count; ++i) {
    LL_ASSIGN_OR_RETURN(auto one, c.session.relight(size_t{c.argument.first} + i, 1, c.sink(), c.control.cancel));
    records.push_back(std::move(one.front()));
    c.report(records.size(), c.argument.count, records.size() * rays);
  }
  TaskOutput out;
  LL_ASSIGN_OR_RETURN(const Digest list, c.put(encode_relight_records(records)));
  out.outputs.push_back(list);
  for (const RelightRecord& r : records) out.outputs.push_back(r.chunk.digest);
  out.rays = records.size() * rays;
  return out;
}

absl::StatusOr<TaskOutput> run_surfaces(const Context& c) {
  std::vector<ChunkRef> refs;
  for (uint32_t i = 0; i < c.argument.count; ++i) {
    if (cancelled(c.control)) return absl::CancelledError("task 'surfaces' cancelled");
    LL_ASSIGN_OR_RETURN(const ChunkRef ref, c.session.surface(size_t{c.argument.first} + i, c.sink()));
    refs.push_back(ref);
    c.report(refs.size(), c.argument.count, 0);
  }
  TaskOutput out;
  LL_ASSIGN_OR_RETURN(const Digest list, c.put(encode_chunk_refs(refs)));
  out.outputs.push_back(list);
  for (const ChunkRef& ref : refs) {
    if (ref.size > 0) out.outputs.push_back(ref.digest);
  }
  return out;
}

/// Puts what the tasks of stage 1 made in its place.
class Assembly {
 public:
  explicit Assembly(const Context& c)
      : c_(c),
        cells_(c.session.plan().cells.size()),
        relight_(c.session.plan().placement.probes.size()),
        surfaces_(c.session.scene().objects.size()),
        have_cell_(cells_.size()),
        have_relight_(relight_.size()),
        have_surface_(surfaces_.size()) {}

  absl::Status add(const FinishedTask& task) {
    if (task.kind == "plan") return take_over(task);
    LL_ASSIGN_OR_RETURN(const TaskArgument argument, decode_argument(task.argument));
    if (argument.plan != c_.session.plan_digest())
      return bad("its task '" + printable(task.kind) + "' is another plan's");
    if (task.outputs.empty()) return bad("its task '" + printable(task.kind) + "' has no outputs");
    LL_ASSIGN_OR_RETURN(const auto blob,
                        fetch(&c_.blobs, task.outputs.front(), "what '" + printable(task.kind) + "' gave"));
    if (task.kind == "cell") {
      LL_ASSIGN_OR_RETURN(CellRecord record, decode_cell_record(blob));
      return place<CellRecord>(task.kind, argument, {std::move(record)}, &cells_, &have_cell_);
    }
    if (task.kind == "relight") {
      LL_ASSIGN_OR_RETURN(auto records, decode_relight_records(blob));
      return place(task.kind, argument, std::move(records), &relight_, &have_relight_);
    }
    if (task.kind == "surfaces") {
      LL_ASSIGN_OR_RETURN(auto refs, decode_chunk_refs(blob));
      return place(task.kind, argument, std::move(refs), &surfaces_, &have_surface_);
    }
    return bad("it has a task of the unknown kind '" + printable(task.kind) + "'");
  }

  absl::StatusOr<BakeSession::Finished> finish() {
    LL_RETURN_IF_ERROR(complete("cell", have_cell_));
    LL_RETURN_IF_ERROR(complete("relight", have_relight_));
    LL_RETURN_IF_ERROR(complete("surfaces", have_surface_));
    for (size_t i = 0; i < relight_.size(); ++i) {
      if (relight_[i].probe != c_.session.plan().placement.probes[i].name()) {
        return bad("relight " + std::to_string(i) + " is of another probe");
      }
    }
    return c_.session.finish(std::move(cells_), std::move(relight_), surfaces_);
  }

 private:
  static absl::Status bad(const std::string& why) {
    return absl::InvalidArgumentError("cannot assemble from this task list: " + why +
                                      "; list every task of stage 1 once, with its outputs");
  }

  /// Results of an earlier bake that "plan" found to hold.
  absl::Status take_over(const FinishedTask& plan) {
    if (plan.outputs.size() < 2) return absl::OkStatus();
    LL_ASSIGN_OR_RETURN(const auto blob, fetch(&c_.blobs, plan.outputs[1], "what 'plan' found to hold"));
    LL_ASSIGN_OR_RETURN(const ReusedResults reused, decode_reused_results(blob));
    LL_ASSIGN_OR_RETURN(BakeTraces earlier, fetch_traces(c_, reused.traces));
    LL_RETURN_IF_ERROR(take_over("cell", reused.cells, std::move(earlier.cells), &cells_, &have_cell_));
    for (size_t i = 0; i < cells_.size(); ++i) {
      if (reused.cells[i].earlier != ReusedResults::Item::kNone) cells_[i].stale = reused.cells[i].stale;
    }
    return take_over("relight", reused.probes, std::move(earlier.probes), &relight_, &have_relight_);
  }

  template <class T>
  static absl::Status take_over(const std::string& kind, const std::vector<ReusedResults::Item>& reused,
                                std::vector<T> earlier, std::vector<T>* all, std::vector<bool>* have) {
    if (reused.size() != all->size()) return bad("what 'plan' found to hold does not fit the plan");
    std::vector<bool> taken(earlier.size());
    for (size_t i = 0; i < reused.size(); ++i) {
      if (reused[i].earlier == ReusedResults::Item::kNone) continue;
      if (reused[i].earlier >= earlier.size())
        return bad("'plan' names a " + kind + " that the earlier bake does not have");
      if ((*have)[i]) return bad("it has " + kind + " " + std::to_string(i) + " twice");
      if (taken[reused[i].earlier]) return bad("'plan' uses a " + kind + " of the earlier bake twice");
      (*have)[i] = taken[reused[i].earlier] = true;
      (*all)[i] = std::move(earlier[reused[i].earlier]);
    }
    return absl::OkStatus();
  }

  template <class T>
  static absl::Status place(std::string_view kind, const TaskArgument& argument, std::vector<T> results,
                            std::vector<T>* all, std::vector<bool>* have) {
    if (argument.first > all->size() || argument.count > all->size() - argument.first ||
        results.size() != argument.count) {
      return bad("what its task '" + std::string(kind) + "' gave does not fit the plan");
    }
    for (uint32_t i = 0; i < argument.count; ++i) {
      const size_t at = size_t{argument.first} + i;
      if ((*have)[at]) return bad("it has " + std::string(kind) + " " + std::to_string(at) + " twice");
      (*have)[at] = true;
      (*all)[at] = std::move(results[i]);
    }
    return absl::OkStatus();
  }

  static absl::Status complete(std::string_view kind, const std::vector<bool>& have) {
    const auto hole = std::find(have.begin(), have.end(), false);
    if (hole == have.end()) return absl::OkStatus();
    return bad("it lacks " + std::string(kind) + " " + std::to_string(hole - have.begin()));
  }

  const Context& c_;
  std::vector<CellRecord> cells_;
  std::vector<RelightRecord> relight_;
  std::vector<ChunkRef> surfaces_;
  std::vector<bool> have_cell_, have_relight_, have_surface_;
};

absl::StatusOr<TaskOutput> run_assemble(const Context& c) {
  LL_ASSIGN_OR_RETURN(const auto bytes, fetch(&c.blobs, c.task.inputs, "the task list"));
  LL_ASSIGN_OR_RETURN(const auto tasks, decode_task_list(bytes));
  Assembly assembly(c);
  for (size_t i = 0; i < tasks.size(); ++i) {
    if (cancelled(c.control)) return absl::CancelledError("task 'assemble' cancelled");
    LL_RETURN_IF_ERROR(assembly.add(tasks[i]));
    c.report(i + 1, tasks.size(), 0);
  }
  LL_ASSIGN_OR_RETURN(const BakeSession::Finished finished, assembly.finish());
  LL_ASSIGN_OR_RETURN(const Digest manifest, c.put(encode_manifest(finished.manifest)));
  LL_ASSIGN_OR_RETURN(const Digest traces, c.put(encode_bake_traces(finished.traces)));
  TaskOutput out;
  out.outputs = {manifest, traces};
  return out;
}

struct Kind {
  std::string_view name;
  absl::StatusOr<TaskOutput> (*run)(const Context&);
};
constexpr std::array<Kind, 6> kKinds{{{"plan", run_plan},
                                      {"cell", run_cell},
                                      {"relight", run_relight},
                                      {"surfaces", run_surfaces},
                                      {"assemble", run_assemble},
                                      {"warm", run_warm}}};

absl::Status unknown_kind(std::string_view kind) {
  std::string known;
  for (const Kind& k : kKinds) known.append(" ").append(k.name);
  return absl::InvalidArgumentError("task kind '" + printable(kind) + "' is unknown; this worker runs" + known);
}

/// Of the task, checked against the worker's own plan: were they to differ, so would the outputs.
absl::StatusOr<TaskArgument> argument_of(const BakeTask& task, const BakeSession& session) {
  if (task.kind == "plan") return TaskArgument{};  // it reads its own
  if (task.kind == "warm") {
    if (task.argument.empty()) return TaskArgument{};
    return absl::InvalidArgumentError("task '" + task.kind + "' has an argument; submit it without one");
  }
  LL_ASSIGN_OR_RETURN(const TaskArgument argument, decode_argument(task.argument));
  if (argument.plan != session.plan_digest()) {
    return absl::FailedPreconditionError("this worker plans the bake otherwise (" + session.plan_digest().hex() +
                                         ") than its job (" + argument.plan.hex() +
                                         "); use workers of one release, and submit the bake again");
  }
  return argument;
}

}  // namespace

struct TaskRunner::Warm {
  Digest payload;
  std::shared_ptr<const BakeSession> session;  // null while it is being made
};

SpawnedTask first_task(const EarlierResults* earlier) {
  return {"plan", 0, earlier != nullptr ? encode_earlier_results(*earlier) : std::vector<uint8_t>(), 0};
}

TaskRunner::TaskRunner(BlobAccess* blobs, uint64_t cache_bytes, Aside aside)
    : blobs_(*blobs),
      cache_bytes_(cache_bytes),
      aside_(aside ? std::move(aside) : [](const std::function<void()>& wait) { wait(); }) {}

TaskRunner::~TaskRunner() = default;

void TaskRunner::adopt(std::span<const uint8_t> payload, std::shared_ptr<const BakeSession> session) {
  const std::lock_guard lock(mutex_);
  warm_.insert(warm_.begin(), std::make_shared<Warm>(Warm{sha256(payload), std::move(session)}));
}

absl::StatusOr<TaskOutput> TaskRunner::run(const BakeTask& task, const BakeControl& control) {
  const auto kind = std::find_if(kKinds.begin(), kKinds.end(), [&](const Kind& k) { return k.name == task.kind; });
  if (kind == kKinds.end()) return unknown_kind(task.kind);
  LL_ASSIGN_OR_RETURN(const auto session, session_of(task, control));
  trim();
  LL_ASSIGN_OR_RETURN(const TaskArgument argument, argument_of(task, *session));
  Outgoing outgoing(&blobs_);
  LL_ASSIGN_OR_RETURN(TaskOutput output, kind->run({*session, blobs_, outgoing, task, argument, control}));
  LL_RETURN_IF_ERROR(outgoing.send());
  return output;
}

absl::StatusOr<std::shared_ptr<const BakeSession>> TaskRunner::session_of(const BakeTask& task,
                                                                          const BakeControl& control) {
  const Digest payload = sha256(task.payload);
  std::unique_lock lock(mutex_);
  const auto place = [&] {
    return std::find_if(warm_.begin(), warm_.end(), [&](const auto& w) { return w->payload == payload; });
  };

  // One task makes the session. Others wait, and try by themselves if that fails: it may have been cancelled.
  for (auto at = place(); at != warm_.end(); at = place()) {
    std::rotate(warm_.begin(), at, at + 1);
    if (warm_.front()->session != nullptr) return warm_.front()->session;
    lock.unlock();
    aside_([&] {
      std::unique_lock waiting(mutex_);
      for (auto w = place(); w != warm_.end() && (*w)->session == nullptr && !cancelled(control); w = place()) {
        made_.wait_for(waiting, std::chrono::milliseconds(50));
      }
    });
    lock.lock();
    if (cancelled(control)) return absl::CancelledError("task '" + task.kind + "' cancelled");
  }
  const auto warm = std::make_shared<Warm>(Warm{payload, nullptr});
  warm_.insert(warm_.begin(), warm);
  lock.unlock();

  const auto settle = [&](std::shared_ptr<const BakeSession> session) {
    lock.lock();
    if (session == nullptr) std::erase(warm_, warm);
    warm->session = std::move(session);
    made_.notify_all();
  };
  try {
    auto session = make_session(task, control);
    settle(session.ok() ? *session : nullptr);
    return session;
  } catch (...) {
    settle(nullptr);
    throw;
  }
}

/// Sessions grow while they are used, so each task looks anew.
void TaskRunner::trim() {
  std::vector<std::shared_ptr<Warm>> dropped;  // freed without the lock: that takes a while
  const std::lock_guard lock(mutex_);
  uint64_t bytes = 0;
  for (const auto& w : warm_) bytes += w->session != nullptr ? w->session->bytes() : 0;
  for (size_t i = warm_.size(); i-- > 1 && bytes > cache_bytes_;) {
    const auto& session = warm_[i]->session;
    if (session == nullptr || session.use_count() > 1) continue;
    bytes -= session->bytes();
    dropped.push_back(std::move(warm_[i]));
    warm_.erase(warm_.begin() + static_cast<ptrdiff_t>(i));
  }
}

absl::StatusOr<std::shared_ptr<const BakeSession>> TaskRunner::make_session(const BakeTask& task,
                                                                            const BakeControl& control) {
  LL_ASSIGN_OR_RETURN(const BakePayload payload, decode_payload(task.payload));
  LL_ASSIGN_OR_RETURN(const auto glb, fetch(&blobs_, payload.scene, "the level"));
  LL_ASSIGN_OR_RETURN(Scene scene, load_glb(glb));
  LL_ASSIGN_OR_RETURN(auto session, BakeSession::create(std::move(scene), payload.params, control));
  return std::shared_ptr<const BakeSession>(std::move(session));
}

}  // namespace lightloom
