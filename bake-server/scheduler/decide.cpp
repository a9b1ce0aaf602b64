#include "bake-server/scheduler/decide.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <tuple>

namespace lightloom {
namespace {

class Deciding {
 public:
  Deciding(std::vector<JobView> jobs, std::set<std::string> workers, const std::set<std::string>& suspects,
           int64_t now_ms, const DecideOptions& options)
      : jobs_(std::move(jobs)), workers_(std::move(workers)), suspects_(suspects), now_ms_(now_ms), options_(options) {
    for (const JobView& job : jobs_) {
      priority_[job.id] = job.priority;
      out_of_client_[job.client] += job.live;
      out_of_job_[job.id] += job.live;
      for (const JobView::Running& task : job.running) {
        for (const std::string& worker : task.workers) runs_[job.id].insert({run_of(task.order), worker});
      }
    }
  }

  std::optional<Decision> next(const Demand& demand) {
    if (auto decision = fresh(demand)) return decision;
    if (demand.room == 0) return std::nullopt;
    return straggler(demand);
  }

 private:
  int64_t run_of(int64_t order) const {
    const int64_t run = order / options_.run;
    return order % options_.run < 0 ? run - 1 : run;
  }

  Decision give(JobView* job, TaskId task, int64_t order, const std::string& worker) {
    ++out_of_client_[job->client];
    ++out_of_job_[job->id];
    runs_[job->id].insert({run_of(order), worker});
    return {job->id, task, order, worker};
  }

  std::optional<Decision> fresh(const Demand& demand) {
    JobView* best = nullptr;
    const auto rank = [&](const JobView& job) {
      return std::tuple(-static_cast<int64_t>(job.priority), out_of_client_[job.client], out_of_job_[job.id], job.id);
    };
    for (JobView& job : jobs_) {
      if ((best == nullptr || rank(job) < rank(*best)) && has_one_for(job, demand.worker)) best = &job;
    }
    if (best == nullptr || (demand.room == 0 && !is_urgent(*best, demand))) return std::nullopt;

    const auto chosen = choose(*best, demand);
    const JobView::Ready task = *chosen;
    best->ready.erase(chosen);
    best->running.push_back({task.task, task.order, 1, now_ms_, {demand.worker}});
    return give(best, task.task, task.order, demand.worker);
  }

  bool may_have(const JobView::Ready& task, const std::string& worker) const {
    const auto failed = [&](const std::string& w) {
      return std::find(task.failed_by.begin(), task.failed_by.end(), w) != task.failed_by.end();
    };
    if (!task.failed_by.empty() && suspects_.contains(worker) &&
        std::any_of(workers_.begin(), workers_.end(),
                    [&](const std::string& w) { return !suspects_.contains(w) && !failed(w); })) {
      return false;
    }
    return !failed(worker) || std::all_of(workers_.begin(), workers_.end(), failed);
  }
  bool has_one_for(const JobView& job, const std::string& worker) const {
    return std::any_of(job.ready.begin(), job.ready.end(), [&](const auto& t) { return may_have(t, worker); });
  }

  bool is_urgent(const JobView& job, const Demand& demand) const {
    // Jobs that ended meanwhile have no priority, and do not matter.
    const auto as_urgent = std::count_if(demand.held.begin(), demand.held.end(), [&](JobId held) {
      const auto known = priority_.find(held);
      return known != priority_.end() && known->second >= job.priority;
    });
    return as_urgent < static_cast<int64_t>(demand.threads);
  }

  std::vector<JobView::Ready>::const_iterator choose(const JobView& job, const Demand& demand) {
    const auto& runs = runs_[job.id];
    const auto first_that = [&](const auto& fits) {
      return std::find_if(job.ready.begin(), job.ready.end(),
                          [&](const JobView::Ready& t) { return fits(t) && may_have(t, demand.worker); });
    };
    if (demand.last_job == job.id) {
      const auto own =
          first_that([&](const JobView::Ready& t) { return run_of(t.order) == run_of(demand.last_order); });
      if (own != job.ready.end()) return own;
    }
    const auto free = first_that([&](const JobView::Ready& t) {
      const auto at = runs.lower_bound({run_of(t.order), std::string()});
      return at == runs.end() || at->first != run_of(t.order);
    });
    return free != job.ready.end() ? free : first_that([](const JobView::Ready&) { return true; });
  }

  std::optional<Decision> straggler(const Demand& demand) {
    JobView* of = nullptr;
    JobView::Running* oldest = nullptr;
    for (JobView& job : jobs_) {
      for (JobView::Running& task : job.running) {
        if (task.workers.size() != 1 || task.workers.front() == demand.worker) continue;
        if (now_ms_ - task.leased_ms < options_.straggler_ms) continue;
        if (oldest == nullptr || std::pair(task.leased_ms, task.task) < std::pair(oldest->leased_ms, oldest->task)) {
          of = &job, oldest = &task;
        }
      }
    }
    if (oldest == nullptr) return std::nullopt;
    oldest->workers.push_back(demand.worker);
    return give(of, oldest->task, oldest->order, demand.worker);
  }

  std::vector<JobView> jobs_;
  std::set<std::string> workers_;
  const std::set<std::string>& suspects_;
  int64_t now_ms_;
  DecideOptions options_;
  std::map<JobId, int32_t> priority_;
  std::map<std::string, uint64_t> out_of_client_;
  std::map<JobId, uint64_t> out_of_job_;
  std::map<JobId, std::set<std::pair<int64_t, std::string>>> runs_;  // per job: runs that workers are in
};

}  // namespace

std::vector<Decision> decide(std::vector<JobView> jobs, std::vector<Demand> demands, int64_t now_ms,
                             const DecideOptions& options, const std::vector<std::string>& others,
                             const std::set<std::string>& suspects) {
  std::set<std::string> workers(others.begin(), others.end());
  for (const Demand& demand : demands) workers.insert(demand.worker);
  Deciding deciding(std::move(jobs), std::move(workers), suspects, now_ms, options);
  std::vector<Decision> out;
  // In turns, so that a worker with many threads does not take all.
  for (bool gave = true; gave;) {
    gave = false;
    for (Demand& demand : demands) {
      const auto decision = deciding.next(demand);
      if (!decision) {
        demand.room = demand.threads = 0;
        continue;
      }
      if (demand.room > 0) --demand.room;
      demand.held.push_back(decision->job);
      demand.last_job = decision->job;
      demand.last_order = decision->order;
      out.push_back(*decision);
      gave = true;
    }
  }
  return out;
}

}  // namespace lightloom
