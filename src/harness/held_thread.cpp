#include "harness/held_thread.h"

#include <fmt/format.h>
#include <poll.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace icbench {
namespace {

int signal_number() noexcept { return SIGRTMIN + 2; }  // no library of ours uses it

double now_ns() noexcept {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec);
}

void await(sem_t& semaphore) noexcept {
  while (sem_wait(&semaphore) != 0) {
    // Interrupted by a signal of somebody else's.
  }
}

}  // namespace

std::atomic<HeldThread*> HeldThread::current_{nullptr};

HeldThread::HeldThread(unsigned hold_ms) : hold_ms_(static_cast<int>(hold_ms)) {
  static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<HeldThread*>::is_always_lock_free,
                "the handler uses them");
  if (pipe(release_) != 0)
    throw std::runtime_error(fmt::format("cannot make a pipe: {}; close some files or raise ulimit -n",
                                         std::generic_category().message(errno)));
  sem_init(&attached_, 0, 0);
  sem_init(&answered_, 0, 0);
  sem_init(&called_off_, 0, 0);
  HeldThread* none = nullptr;
  // relaxed: nothing is read on failure.
  if (!current_.compare_exchange_strong(none, this, std::memory_order_acq_rel /* H2, H3 */,
                                        std::memory_order_relaxed)) {
    close(release_[0]);
    close(release_[1]);
    throw std::runtime_error("a thread is being held already; one at a time");
  }
  struct sigaction action {};
  action.sa_sigaction = [](int, siginfo_t* signal, void*) { handle(*signal); };
  action.sa_flags = SA_SIGINFO | SA_RESTART;  // waits that are interrupted go on
  sigemptyset(&action.sa_mask);
  sigaction(signal_number(), &action, &before_);
}

HeldThread::~HeldThread() {
  if (has_timer_) timer_delete(timer_);
  sigaction(signal_number(), &before_, nullptr);
  current_.store(nullptr, std::memory_order_release /* H3 */);
  sem_destroy(&attached_);
  sem_destroy(&answered_);
  sem_destroy(&called_off_);
  close(release_[0]);
  close(release_[1]);
}

void HeldThread::attach() noexcept {
  thread_ = static_cast<pid_t>(syscall(SYS_gettid));
  clockid_t processor_time{};
  sigevent to_this_thread{};
  to_this_thread.sigev_notify = SIGEV_THREAD_ID;
  to_this_thread.sigev_signo = signal_number();
  to_this_thread._sigev_un._tid = thread_;  // the C library has no other name for it
  has_timer_ = pthread_getcpuclockid(pthread_self(), &processor_time) == 0 &&
               timer_create(processor_time, &to_this_thread, &timer_) == 0;
  sem_post(&attached_);
}

void HeldThread::ended() noexcept {
  // acq_rel: the first one to end tells the others, once.
  if (is_over_.exchange(true, std::memory_order_acq_rel /* H1 */)) return;
  const char byte = 0;
  // A pipe takes one byte for certain; if it did not, the hold would end by its time.
  [[maybe_unused]] const ssize_t written = write(release_[1], &byte, 1);
  over_.release();
  sem_post(&attached_);  // who waits for a thread that never came waits no longer,
  sem_post(&answered_);  // nor for one that does not run any more
}

bool HeldThread::await_attached() {
  await(attached_);
  return !is_over_.load(std::memory_order_acquire /* H1 */);
}

bool HeldThread::send() noexcept { return syscall(SYS_tgkill, getpid(), thread_, signal_number()) == 0; }

bool HeldThread::interrupt() noexcept {
  itimerspec at_once{};
  at_once.it_value.tv_nsec = 1;
  return has_timer_ ? timer_settime(timer_, 0, &at_once, nullptr) == 0 : send();
}

// Whether a timer that is disarmed still delivers a signal that was on its way depends on the system. Signals of one
// number come to a thread in their order: when one that was sent has come, no other does.
void HeldThread::call_off() noexcept {
  const itimerspec never{};
  timer_settime(timer_, 0, &never, nullptr);
  if (send()) await(called_off_);
}

bool HeldThread::hold() {
  if (is_over_.load(std::memory_order_acquire /* H1 */) || !interrupt()) return false;
  await(answered_);
  if (is_over_.load(std::memory_order_acquire /* H1 */)) {
    // One answer comes from whoever ended the region. The thread's own may never come: it may not run any more.
    if (has_timer_) {
      call_off();
      return false;  // nor does a hold count that the end of the region cut short
    }
    await(answered_);
  }
  if (!was_held_) {
    ++missed_;
    return false;
  }
  ++holds_;
  held_ns_ += last_ns_;
  return true;
}

void HeldThread::handle(const siginfo_t& signal) noexcept {
  const int saved = errno;
  if (HeldThread* self = current_.load(std::memory_order_acquire /* H2 */)) {
    if (self->has_timer_ && signal.si_code == SI_TKILL)
      sem_post(&self->called_off_);
    else
      self->stop_here();
  }
  errno = saved;
}

void HeldThread::stop_here() noexcept {
  // relaxed: written by this very thread. acquire: H1.
  was_held_ =
      in_operation_.load(std::memory_order_relaxed) && !is_over_.load(std::memory_order_acquire /* H1 */);
  if (was_held_) {
    const double begin = now_ns();
    pollfd released{release_[0], POLLIN, 0};
    poll(&released, 1, hold_ms_);
    last_ns_ = now_ns() - begin;
  }
  sem_post(&answered_);
}

}  // namespace icbench
