#include "simulate/locks.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace icbench {

double BySleep::after(double slept) const noexcept {
  const double place = slept > slept_ns(0) ? std::log2(slept / slept_ns(0)) : 0.0;
  const double last = static_cast<double>(kSleeps - 1);
  const double low = std::min(std::floor(place), last);
  const double part = std::clamp(place - low, 0.0, 1.0);
  const auto i = static_cast<std::size_t>(low);
  return ns[i] + part * (ns[std::min(i + 1, kSleeps - 1)] - ns[i]);
}

namespace {

/// Turns of a loop that waits: so many of one pause, then of two, four, up to the longest, and then the processor is
/// given up each time.
struct Backoff {
  unsigned of_each;
  double longest;
};
constexpr Backoff kOurs{256, 1.0};   // NoHooks::wait_turn
constexpr Backoff kOneTbb{1, 16.0};  // its detail::d0::atomic_backoff

/// The first look, of one who has looked since then, that finds what can be seen from `seen` on.
double look_at(double since, double seen, const Backoff& backoff, double pause_ns, double yield_ns) noexcept {
  double look = since;
  for (double turn = 1.0; turn <= backoff.longest; turn *= 2.0) {
    for (unsigned i = 0; i < backoff.of_each; ++i) {
      if (look >= seen) return look;
      look += turn * pause_ns;
    }
  }
  if (look >= seen || yield_ns <= 0.0) return std::max(look, seen);
  return look + std::ceil((seen - look) / yield_ns) * yield_ns;
}

}  // namespace

QueueHandOver QueueHandOver::reckoned(double pause_ns, double yield_ns, double transfer_ns) {
  QueueHandOver out{.leave_ns = transfer_ns, .transfer_ns = transfer_ns};
  for (std::size_t i = 0; i < kWaits; ++i) {
    const double waited = (static_cast<double>(i) + 0.5) * kStepNs;
    const double seen = waited + 2.0 * transfer_ns;
    out.ns[i] = look_at(0.0, seen, kOneTbb, pause_ns, yield_ns) + transfer_ns - waited;
  }
  return out;
}

double QueueHandOver::after(double waited, double transfer, double yield) const noexcept {
  constexpr double kLast = kStepNs * kWaits;
  // Farther away it is seen later, as if let in later, and its word comes back later.
  const double farther = transfer - transfer_ns;
  const double later = std::max(0.0, waited + 2.0 * farther);
  double place = later;
  if (place >= kLast && yield > 0.0) place -= std::ceil((place - kLast) / yield) * yield;
  const auto i = static_cast<std::size_t>(std::clamp(place / kStepNs, 0.0, kWaits - 1.0));
  return std::max(0.0, later - waited + ns[i] + farther);
}

namespace {

/// What all models have.
class Model : public VirtualLock {
 public:
  Model(const MachineModel& machine, const WaitCosts& costs, std::uint64_t seed, Wake wake)
      : machine_(machine), costs_(costs), random_(seed), wake_(std::move(wake)) {}

 protected:
  struct Waiting {
    Visitor visitor;
    double since;  // it looks at the word, or calls the kernel to sleep
  };

  /// Whose try at t was in vain.
  Arrival waits_from(double t) const noexcept { return {t + costs_.clock_ns, false}; }
  /// Whether one who calls the kernel to sleep is let do so; not if it is let in before the kernel looks.
  bool is_asleep(const Waiting& w, double t) const noexcept { return t >= w.since + costs_.check_ns; }
  double transfer(const Visitor& from, const Visitor& to) const noexcept {
    return machine_.transfer_ns(from.core, to.core);
  }
  /// When one who looks at the word now and then, after ever longer turns, sees what was written at t.
  double noticed(const Visitor& writer, const Waiting& waiting, double t,
                 const Backoff& backoff) const noexcept {
    return look_at(waiting.since, t + transfer(writer, waiting.visitor), backoff, costs_.pause_ns,
                   costs_.yield_ns);
  }
  /// When one who sleeps, or is about to, goes on, if somebody calls for it at t.
  double awake(const Waiting& sleeper, double t) const noexcept {
    return is_asleep(sleeper, t) ? t + costs_.wake_delay_ns.after(t - sleeper.since)
                                 : sleeper.since + costs_.park_ns;
  }
  /// Of the one who calls.
  double call_ns(const Waiting& sleeper, double t) const noexcept {
    return is_asleep(sleeper, t) ? costs_.wake_call_ns.after(t - sleeper.since) : costs_.park_ns;
  }
  static void forget(std::vector<Waiting>& waiting, unsigned thread) {
    std::erase_if(waiting, [&](const Waiting& w) { return w.visitor.thread == thread; });
  }

  const MachineModel& machine_;
  const WaitCosts& costs_;
  Pcg32 random_;
  Wake wake_;
  Line line_;
};

class Mutex final : public Model {
 public:
  using Model::Model;

  Arrival enter(const Visitor& v, double t) override {
    t = line_.write(machine_, v.core, t);
    if (!std::exchange(is_held_, true)) return {t, true};
    const Arrival waits = waits_from(t);
    sleep(v, waits.time);
    return waits;
  }
  std::optional<double> resume(const Visitor& v, double t) override {
    t = line_.write(machine_, v.core, t);
    if (std::exchange(is_held_, true)) {
      sleep(v, t);
      return std::nullopt;
    }
    has_sleepers_ = true;  // who has slept cannot know whether others do, and leaves a mark that they may
    return t;
  }
  double leave(const Visitor& v, double t) override {
    is_held_ = false;
    t = line_.write(machine_, v.core, t);
    if (!std::exchange(has_sleepers_, false)) return t;
    if (sleepers_.empty()) return t + costs_.park_ns;
    const Waiting sleeper = sleepers_.front();
    sleepers_.pop_front();
    wake_(sleeper.visitor.thread, awake(sleeper, t));
    return t + call_ns(sleeper, t);
  }

 private:
  void sleep(const Visitor& v, double t) {
    has_sleepers_ = true;
    sleepers_.push_back({v, t});
  }

  bool is_held_ = false, has_sleepers_ = false;
  std::deque<Waiting> sleepers_;
};

class Spin final : public Model {
 public:
  using Model::Model;

  Arrival enter(const Visitor& v, double t) override {
    t = line_.write(machine_, v.core, t);
    // Whoever waits may be there before.
    if (!is_held_ && (waiting_.empty() || t < first_try_)) {
      is_held_ = true;
      return {t, true};
    }
    const Arrival waits = waits_from(t);
    waiting_.push_back({v, waits.time});
    return waits;
  }
  std::optional<double> resume(const Visitor& v, double t) override {
    if (is_held_) return std::nullopt;
    is_held_ = true;
    forget(waiting_, v.thread);
    return line_.write(machine_, v.core, t);
  }
  double leave(const Visitor& v, double t) override {
    is_held_ = false;
    if (waiting_.empty()) return line_.write(machine_, v.core, t);
    // The word is at those who wait. The store does not hold up the one who leaves.
    const auto n = static_cast<std::uint32_t>(waiting_.size());
    const Waiting& first = waiting_[random_.below(n)];
    const double in_vain = 0.5 * (n - 1) * machine_.transfers.ns[0];
    first_try_ = noticed(v, first, t, kOurs) + in_vain;
    line_.read(machine_, first.visitor.core, t);
    wake_(first.visitor.thread, first_try_);
    return t;
  }

 private:
  bool is_held_ = false;
  double first_try_ = 0.0;  // of who was woken last
  std::vector<Waiting> waiting_;
};

class Queue final : public Model {
 public:
  using Model::Model;

  Arrival enter(const Visitor& v, double t) override {
    t = line_.write(machine_, v.core, t);
    if (!std::exchange(is_held_, true)) return {t, true};
    // The place in the queue is taken after the clock was read.
    const Arrival waits = waits_from(t);
    queue_.push_back({v, waits.time});
    return waits;
  }
  std::optional<double> resume(const Visitor&, double t) override { return t; }
  double leave(const Visitor& v, double t) override {
    if (queue_.empty()) {
      is_held_ = false;
      return line_.write(machine_, v.core, t);
    }
    const Waiting next = queue_.front();
    queue_.pop_front();
    const double line_ns = transfer(v, next.visitor);
    wake_(next.visitor.thread,
          std::max(t, next.since) + costs_.queue.after(t - next.since, line_ns, costs_.yield_ns));
    return t + costs_.queue.leaving(line_ns);
  }

 private:
  bool is_held_ = false;
  std::deque<Waiting> queue_;
};

class FutexRw final : public Model {
 public:
  using Model::Model;

  Arrival enter(const Visitor& v, double t) override {
    t = line_.write(machine_, v.core, t);
    if (v.writes ? try_write() : !has_writer_) {
      readers_ += !v.writes;
      return {t, true};
    }
    const Arrival waits = waits_from(t);
    if (v.writes) {
      sleeping_writers_.push_back({v, waits.time});
    } else {
      sleeping_readers_.push_back({v, waits.time});
    }
    return waits;
  }
  std::optional<double> resume(const Visitor& v, double t) override {
    // Readers, and a writer after readers, were let in by whoever woke them.
    if (!v.writes) return t;
    if (handed_to_ == v.thread) {
      handed_to_ = kNobody;
      return t;
    }
    t = line_.write(machine_, v.core, t);
    if (try_write()) return t;
    sleeping_writers_.push_back({v, t});
    return std::nullopt;
  }
  double leave(const Visitor& v, double t) override {
    t = line_.write(machine_, v.core, t);
    if (!v.writes) {
      if (--readers_ != 0 || sleeping_writers_.empty()) return t;
      has_writer_ = true;
      handed_to_ = sleeping_writers_.front().visitor.thread;
      return wake_writer(t);
    }
    has_writer_ = false;
    if (sleeping_readers_.empty()) return sleeping_writers_.empty() ? t : wake_writer(t);
    for (const Waiting& reader : sleeping_readers_) {
      ++readers_;
      wake_(reader.visitor.thread, awake(reader, t));
      t += call_ns(reader, t);
    }
    sleeping_readers_.clear();
    return t;
  }

 private:
  static constexpr unsigned kNobody = ~0u;

  bool try_write() {
    if (readers_ != 0 || has_writer_) return false;
    has_writer_ = true;
    return true;
  }
  double wake_writer(double t) {
    const Waiting writer = sleeping_writers_.front();
    sleeping_writers_.pop_front();
    wake_(writer.visitor.thread, awake(writer, t));
    return t + call_ns(writer, t);
  }

  unsigned readers_ = 0, handed_to_ = kNobody;
  bool has_writer_ = false;
  std::vector<Waiting> sleeping_readers_;
  std::deque<Waiting> sleeping_writers_;
};

/// Readers and writers that spin; a writer that waits keeps new readers out.
class SpinningRw : public Model {
 public:
  using Model::Model;

  Arrival enter(const Visitor& v, double t) override {
    t = v.writes ? write_word(v, t) : read_word(v, t);
    if (try_enter(v)) return {t, true};
    const Arrival waits = waits_from(t);
    (v.writes ? writers_ : waiting_readers_).push_back({v, waits.time});
    return waits;
  }
  std::optional<double> resume(const Visitor& v, double t) override {
    if (!try_enter(v)) return std::nullopt;
    forget(v.writes ? writers_ : waiting_readers_, v.thread);
    return v.writes ? write_word(v, t) : read_word(v, t);
  }
  double leave(const Visitor& v, double t) override {
    if (!v.writes) {
      t = reader_leaves(v, t);
      if (--readers_ == 0) wake_all(writers_, v, t);
      return t;
    }
    has_writer_ = wants_writer_ = false;
    const double then = line_.write(machine_, v.core, t);
    wake_all(writers_, v, then);
    wake_all(waiting_readers_, v, then);
    return t;
  }

 protected:
  virtual double read_word(const Visitor& v, double t) = 0;
  virtual double write_word(const Visitor& v, double t) = 0;
  virtual double reader_leaves(const Visitor& v, double t) = 0;
  virtual const Backoff& backoff() const noexcept = 0;

 private:
  bool try_enter(const Visitor& v) {
    if (!v.writes) {
      if (has_writer_ || wants_writer_) return false;
      ++readers_;
      return true;
    }
    wants_writer_ = has_writer_ || readers_ != 0;
    if (!wants_writer_) has_writer_ = true;
    return !wants_writer_;
  }
  void wake_all(const std::vector<Waiting>& waiting, const Visitor& by, double t) {
    for (const Waiting& w : waiting) wake_(w.visitor.thread, noticed(by, w, t, backoff()));
  }

  unsigned readers_ = 0;
  bool has_writer_ = false, wants_writer_ = false;
  std::vector<Waiting> waiting_readers_, writers_;
};

class SpinRw final : public SpinningRw {
 public:
  using SpinningRw::SpinningRw;

 private:
  double read_word(const Visitor& v, double t) override { return line_.write(machine_, v.core, t); }
  double write_word(const Visitor& v, double t) override { return line_.write(machine_, v.core, t); }
  double reader_leaves(const Visitor& v, double t) override { return line_.write(machine_, v.core, t); }
  const Backoff& backoff() const noexcept override { return kOneTbb; }
};

class DistributedReaders final : public SpinningRw {
 public:
  using SpinningRw::SpinningRw;

 private:
  // Loads of lines that do not depend on each other are under way together.
  static constexpr double kLooksAtOnce = 4.0;

  double read_word(const Visitor& v, double t) override {
    if (lines_of_readers_.size() <= v.thread) lines_of_readers_.resize(v.thread + 1);
    if (lines_of_readers_[v.thread].is_looked_at) t += machine_.transfer_ns(line_.owner(), v.core);
    lines_of_readers_[v.thread].is_looked_at = false;
    lines_of_readers_[v.thread].has_read = true;
    return line_.read(machine_, v.core, t);
  }
  double write_word(const Visitor& v, double t) override {
    t = line_.write(machine_, v.core, t);
    double looks = 0.0;
    for (unsigned reader = 0; reader < lines_of_readers_.size(); ++reader) {
      if (!lines_of_readers_[reader].has_read) continue;
      lines_of_readers_[reader].has_read = false;
      lines_of_readers_[reader].is_looked_at = reader != v.thread;
      looks += machine_.transfer_ns(reader % machine_.cores, v.core);
    }
    return t + looks / kLooksAtOnce;
  }
  double reader_leaves(const Visitor&, double t) override { return t; }
  const Backoff& backoff() const noexcept override { return kOurs; }

  struct Reader {
    bool has_read = false;      // has written its line since a writer looked
    bool is_looked_at = false;  // a writer has looked since
  };
  std::vector<Reader> lines_of_readers_;
};

}  // namespace

std::unique_ptr<VirtualLock> make_lock(LockKind kind, const MachineModel& machine, const WaitCosts& costs,
                                       std::uint64_t seed, VirtualLock::Wake wake) {
  switch (kind) {
    case LockKind::none:
      return nullptr;
    case LockKind::mutex:
      return std::make_unique<Mutex>(machine, costs, seed, std::move(wake));
    case LockKind::spin:
      return std::make_unique<Spin>(machine, costs, seed, std::move(wake));
    case LockKind::queue:
      return std::make_unique<Queue>(machine, costs, seed, std::move(wake));
    case LockKind::futex_rw:
      return std::make_unique<FutexRw>(machine, costs, seed, std::move(wake));
    case LockKind::spin_rw:
      return std::make_unique<SpinRw>(machine, costs, seed, std::move(wake));
    case LockKind::distributed_rw:
      return std::make_unique<DistributedReaders>(machine, costs, seed, std::move(wake));
  }
  return nullptr;
}

}  // namespace icbench
