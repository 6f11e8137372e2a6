// A stage: fibers whose atomic steps are counted, and between whose steps a schedule decides.
//
// A fiber on stage passes *points*: one before each of its atomic steps, one before and after its record memory is half
// written, one where it has read a record's mark and not yet the record, and one after its operation's last step. At
// any of them it can be left standing. A fiber that waits for another is on stage, but can only go on once somebody has
// written; if nobody can, it is blocked.
//
// Everything is on one thread of the system, so a schedule is a number of points at a time, and the same numbers give
// the same run again. Memory is sequentially consistent here: this counts steps, it does not explore weak memory.
#pragma once

#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "stress/fibers.h"

namespace icbench::stress {

class Stage {
 public:
  static constexpr std::uint64_t kAll = ~std::uint64_t{0};

  /// An operation that has taken more steps than this will not end by itself.
  static constexpr std::uint64_t kEndless = 200'000;

  explicit Stage(unsigned fibers) : fibers_(fibers), actors_(fibers) {}

  unsigned size() const noexcept { return fibers_.size(); }

  /// Nobody is on stage.
  void clear() noexcept {
    for (Actor& a : actors_) a = {};
  }

  /// Whether pools have no whole pieces left.
  void refuse_pieces(bool refuse) noexcept { refuses_pieces_ = refuse; }

  /// Puts fiber `i` on stage, before `body`'s first instruction.
  void start(unsigned i, std::function<void()> body) {
    actors_[i] = {};
    actors_[i].is_present = true;
    fibers_.start(i, std::move(body));
  }

  /// Lets fiber `i`, which can run, pass `points` points and begin `operations` operations at most.
  void run(unsigned i, std::uint64_t points, std::uint64_t operations = kAll) {
    Actor& a = actors_[i];
    a.points_left = points;
    a.operations_left = operations;
    a.waits = false;
    Stage* const outer = std::exchange(active_, this);
    fibers_.resume(i);
    active_ = outer;
  }

  bool is_done(unsigned i) const noexcept { return !actors_[i].is_present || fibers_.is_done(i); }
  bool can_run(unsigned i) const noexcept {
    const Actor& a = actors_[i];
    return !is_done(i) && !a.is_endless && (!a.waits || a.seen_writes != writes_);
  }
  bool is_endless(unsigned i) const noexcept { return actors_[i].is_endless; }

  /// Points that fiber `i` has passed.
  std::uint64_t points(unsigned i) const noexcept { return actors_[i].points; }
  /// Steps of its operation, or of its last one.
  std::uint64_t steps(unsigned i) const noexcept { return actors_[i].steps; }
  /// How far the lists reached that its operation has read.
  const std::vector<std::uint32_t>& extents(unsigned i) const noexcept { return actors_[i].extents; }

  // For the policies and bodies of fibers; nothing outside of fibers.

  static void begin_operation() {
    if (!is_inside()) return;
    Actor& a = actor();
    while (a.operations_left == 0) Fibers::pause();
    --a.operations_left;
    a.steps = 0;
    a.extents.clear();
  }
  static bool may_take_pieces() noexcept { return !is_inside() || !active_->refuses_pieces_; }
  static void point() noexcept {
    if (is_inside()) actor().pass();
  }
  static void step() noexcept {
    if (!is_inside()) return;
    actor().pass();
    ++actor().steps;
  }
  /// Somebody may go on now who waited for this.
  static void wrote() noexcept {
    if (is_inside()) ++active_->writes_;
  }
  static void wait() noexcept {
    Actor& a = actor();
    a.waits = true;
    a.seen_writes = active_->writes_;
    Fibers::pause();
  }
  static void extent(std::uint32_t items) {
    if (is_inside()) actor().extents.push_back(items);
  }
  static bool is_inside() noexcept { return Fibers::is_inside() && active_ != nullptr; }

  /// The same of the running fiber.
  static std::uint64_t own_steps() noexcept { return actor().steps; }
  static const std::vector<std::uint32_t>& own_extents() noexcept { return actor().extents; }

 private:
  struct Actor {
    void pass() noexcept {
      is_endless = steps > kEndless;
      while (points_left == 0 || is_endless) Fibers::pause();
      --points_left;
      ++points;
    }

    std::uint64_t points_left = 0;
    std::uint64_t operations_left = 0;
    std::uint64_t points = 0;
    std::uint64_t steps = 0;
    std::uint64_t seen_writes = 0;  // while it waits: writes by all fibers when it began to
    std::vector<std::uint32_t> extents;
    bool is_present = false;
    bool waits = false;
    bool is_endless = false;
  };

  static Actor& actor() noexcept { return active_->actors_[Fibers::running()]; }

  static constinit inline thread_local Stage* active_ = nullptr;

  Fibers fibers_;
  std::vector<Actor> actors_;
  std::uint64_t writes_ = 0;
  bool refuses_pieces_ = false;
};

}  // namespace icbench::stress
