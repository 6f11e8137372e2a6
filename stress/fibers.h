// Threads of control that a test switches by hand, all on one thread of the system.
//
// Fibers run until they say `pause`, so a test decides after which step of which fiber the next one goes on: every
// interleaving can be had at will and again. A fiber that is never resumed has stopped forever; its stack is given back
// without being unwound, so bodies must own nothing on it that matters.
//
// Costs: a stack of kStackBytes each, reused by the next body; a switch saves the registers and the signal mask.
#pragma once

#include <ucontext.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

namespace icbench::stress {

class Fibers {
 public:
  static constexpr std::size_t kStackBytes = std::size_t{256} << 10;

  explicit Fibers(unsigned n) : fibers_(n) {
    for (Fiber& f : fibers_) f.stack = std::make_unique<std::byte[]>(kStackBytes);
  }
  Fibers(const Fibers&) = delete;
  Fibers& operator=(const Fibers&) = delete;

  unsigned size() const noexcept { return static_cast<unsigned>(fibers_.size()); }

  /// Prepares fiber `i` to run `body`, which must not throw. What the fiber did before is forgotten.
  void start(unsigned i, std::function<void()> body) {
    Fiber& f = fibers_[i];
    f.body = std::move(body);
    f.done = false;
    getcontext(&f.context);
    f.context.uc_stack.ss_sp = f.stack.get();
    f.context.uc_stack.ss_size = kStackBytes;
    f.context.uc_link = nullptr;
    // makecontext passes integers only.
    const auto address = reinterpret_cast<std::uintptr_t>(this);
    makecontext(&f.context, reinterpret_cast<void (*)()>(&Fibers::enter), 3,
                static_cast<unsigned>(address >> 32), static_cast<unsigned>(address), i);
  }

  /// Runs fiber `i` until it pauses or ends. Not to be called from a fiber, nor for one that has ended.
  void resume(unsigned i) noexcept {
    current_ = this;
    running_ = i;
    swapcontext(&caller_, &fibers_[i].context);
    current_ = nullptr;
  }

  bool is_done(unsigned i) const noexcept { return fibers_[i].done; }

  /// Whether a fiber is running on this thread.
  static bool is_inside() noexcept { return current_ != nullptr; }
  /// Which one; only inside.
  static unsigned running() noexcept { return current_->running_; }
  /// Goes back to whoever called resume, until resumed again; only inside.
  static void pause() noexcept {
    Fibers& self = *current_;
    swapcontext(&self.fibers_[self.running_].context, &self.caller_);
  }

 private:
  struct Fiber {
    std::unique_ptr<std::byte[]> stack;
    std::function<void()> body;
    ucontext_t context{};
    bool done = true;
  };

  static void enter(unsigned high, unsigned low, unsigned i) {
    auto& self = *reinterpret_cast<Fibers*>(std::uintptr_t{high} << 32 | low);
    Fiber& f = self.fibers_[i];
    f.body();
    f.done = true;
    setcontext(&self.caller_);
  }

  static constinit inline thread_local Fibers* current_ = nullptr;

  std::vector<Fiber> fibers_;
  ucontext_t caller_{};
  unsigned running_ = 0;
};

}  // namespace icbench::stress
