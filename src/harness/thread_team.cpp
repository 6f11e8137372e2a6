// Publication pairs. A region number never repeats within 2^32 regions.
//
//   P1  run: region_ store -> worker: region_ wait; publishes call_, context_, stopping_, arrived_, unfinished_
//
//   P2  last to arrive: go_ store -> worker: go_ wait; nothing but the start signal
//
//   P3  worker: unfinished_ fetch_sub -> last worker: same; hands every slot to the last worker, and then
//       last worker: finished_ store -> run: finished_ wait
//
// The stores that are followed by notify_all are seq_cst: notify skips the system call when no waiter is
// registered, and a weaker store could be overtaken by that look.
#include "harness/thread_team.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <new>
#include <stdexcept>
#include <system_error>

#include "harness/ticks.h"

namespace icbench {
namespace {

std::int64_t now_ns() noexcept {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// Blocks until `word` holds `wanted`.
void await(const std::atomic<int>& word, int wanted) noexcept {
  for (int seen; (seen = word.load(std::memory_order_acquire)) != wanted;)
    word.wait(seen, std::memory_order_acquire);
}

int next(int region) noexcept { return static_cast<int>(static_cast<unsigned>(region) + 1u); }

}  // namespace

std::int64_t TeamTimes::wall_ns() const noexcept {
  if (threads.empty()) return 0;
  std::int64_t first = std::numeric_limits<std::int64_t>::max();
  std::int64_t last = std::numeric_limits<std::int64_t>::min();
  for (const ThreadTime& t : threads) {
    first = std::min(first, t.begin_ns);
    last = std::max(last, t.end_ns);
  }
  return last - first;
}

std::int64_t TeamTimes::cpu_ns() const noexcept {
  std::int64_t sum = 0;
  for (const ThreadTime& t : threads) sum += t.cpu_ns;
  return sum;
}

std::int64_t TeamTimes::start_skew_ns() const noexcept {
  if (threads.empty()) return 0;
  const auto [first, last] = std::minmax_element(
      threads.begin(), threads.end(), [](const auto& a, const auto& b) { return a.begin_ns < b.begin_ns; });
  return last->begin_ns - first->begin_ns;
}

ThreadTeam::ThreadTeam(const std::vector<Binding>& bindings) : slots_(bindings.size()) {
  if (bindings.empty() || bindings.size() > kMaxThreads)
    throw std::runtime_error(
        fmt::format("a team cannot have {} threads; choose 1 to {}", bindings.size(), kMaxThreads));
  const auto n = static_cast<unsigned>(bindings.size());
  unfinished_.store(static_cast<int>(n),
                    std::memory_order_relaxed);  // published by the creation of the threads
  threads_.reserve(n);
  for (unsigned i = 0; i < n; ++i) {
    try {
      threads_.emplace_back([this, i, binding = bindings[i]] { work(i, binding); });
    } catch (const std::bad_alloc&) {
      stop(i);
      throw;
    } catch (const std::system_error& error) {
      stop(i);
      throw std::runtime_error(fmt::format(
          "cannot create thread {} of {}: {}; use fewer --threads, or raise ulimit -u, ulimit -v or "
          "the cgroup's pids.max",
          i + 1, n, error.code().message()));
    }
  }
  await(finished_, 1);
  for (unsigned i = 0; i < n; ++i) {
    const std::error_code error = slots_[i].bind_error;
    if (!error) continue;
    stop(n);
    throw std::runtime_error(fmt::format(
        "cannot pin thread {} to processing unit {}: {}; use --placement none, or start the program with "
        "other cpus allowed",
        i, bindings[i], error.message()));
  }
}

ThreadTeam::~ThreadTeam() {
  if (!threads_.empty()) stop(size());
}

// The workers' start-up counts as region 0 -> 1: they bind themselves, report, and then wait for region 1.
// Nothing is allocated or thrown there, since the threads before may have used up all memory.
void ThreadTeam::work(unsigned index, Binding binding) {
  if (binding != kUnbound) slots_[index].bind_error = bind_this_thread(static_cast<unsigned>(binding));
  finish_one();
  for (int region = 1;; region = next(region)) {
    await(region_, region);  // P1
    if (stopping_) return;
    slots_[index].time.ready_ns = now_ns();
    // acq_rel: the last one to arrive inherits what the others did before the barrier.
    if (arrived_.fetch_add(1, std::memory_order_acq_rel) + 1 == static_cast<int>(slots_.size())) {
      go_.store(region, std::memory_order_seq_cst);  // P2
      go_.notify_all();
    } else {
      await(go_, region);  // P2
    }
    run_slot(index);
    finish_one();
  }
}

void ThreadTeam::run_slot(unsigned index) noexcept {
  Slot& slot = slots_[index];
  const std::int64_t cpu_before = thread_cpu_ns();
  slot.time.begin_ns = now_ns();
  try {
    call_(context_, index);
  } catch (...) {
    slot.error = std::current_exception();
  }
  slot.time.end_ns = now_ns();
  slot.time.cpu_ns = thread_cpu_ns() - cpu_before;
}

void ThreadTeam::finish_one() noexcept {
  if (unfinished_.fetch_sub(1, std::memory_order_acq_rel) != 1) return;  // P3
  // relaxed: only the last worker of a region writes finished_, and it has synchronised with all others
  // through P3.
  const int done = next(finished_.load(std::memory_order_relaxed));
  finished_.store(done, std::memory_order_seq_cst);  // P3
  finished_.notify_all();
}

TeamTimes ThreadTeam::run_erased(Call call, void* context) {
  TeamTimes times;
  times.threads.resize(slots_.size());
  call_ = call;
  context_ = context;
  for (Slot& slot : slots_) slot = {};
  // relaxed: published by P1; the workers' last accesses came before the previous P3.
  arrived_.store(0, std::memory_order_relaxed);
  unfinished_.store(static_cast<int>(slots_.size()), std::memory_order_relaxed);
  const int region = next(region_.load(std::memory_order_relaxed));  // relaxed: only this thread writes it
  region_.store(region, std::memory_order_seq_cst);                  // P1
  region_.notify_all();
  await(finished_, next(region));  // P3
  std::exception_ptr error;
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    times.threads[i] = slots_[i].time;
    if (!error) error = slots_[i].error;
  }
  if (error) std::rethrow_exception(error);
  return times;
}

void ThreadTeam::stop(unsigned started) noexcept {
  stopping_ = true;
  region_.store(next(region_.load(std::memory_order_relaxed)),
                std::memory_order_seq_cst);  // P1; only we write it
  region_.notify_all();
  for (unsigned i = 0; i < started; ++i) threads_[i].join();
  threads_.clear();
}

}  // namespace icbench
