// Threads of control that a test switches by hand, all on one thread of the system.
//
// Fibers run until they say `pause`, so a test decides after which step of which fiber the next one goes on: every
// interleaving can be had at will and again. A fiber that is never resumed has stopped forever; its stack is given back
// without being unwound, so bodies must own nothing on it that matters.
//
// Costs: a stack of kStackBytes each, reused by the next body; a switch saves the registers that a call preserves, and
// asks nothing of the system (Boost.Context), for a schedule may switch at every step.
#pragma once

#include <sanitizer/asan_interface.h>

#include <boost/context/detail/fcontext.hpp>
#include <cstddef>
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
    // AddressSanitizer holds to be off limits what frames left there that were given back without being unwound.
    ASAN_UNPOISON_MEMORY_REGION(f.stack.get(), kStackBytes);
    // A stack grows downwards: its top is its end.
    f.context =
        boost::context::detail::make_fcontext(f.stack.get() + kStackBytes, kStackBytes, &Fibers::enter);
  }

  /// Runs fiber `i` until it pauses or ends. Not to be called from a fiber, nor for one that has ended.
  void resume(unsigned i) noexcept {
    current_ = this;
    running_ = i;
    fibers_[i].context = boost::context::detail::jump_fcontext(fibers_[i].context, this).fctx;
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
    self.caller_ = boost::context::detail::jump_fcontext(self.caller_, nullptr).fctx;
  }

 private:
  using Context = boost::context::detail::fcontext_t;

  struct Fiber {
    std::unique_ptr<std::byte[]> stack;
    std::function<void()> body;
    Context context = nullptr;
    bool done = true;
  };

  static void enter(boost::context::detail::transfer_t from) {
    auto& self = *static_cast<Fibers*>(from.data);
    self.caller_ = from.fctx;
    Fiber& f = self.fibers_[self.running_];
    f.body();
    f.done = true;
    boost::context::detail::jump_fcontext(self.caller_, nullptr);  // for good
  }

  static constinit inline thread_local Fibers* current_ = nullptr;

  std::vector<Fiber> fibers_;
  Context caller_ = nullptr;
  unsigned running_ = 0;
};

}  // namespace icbench::stress
