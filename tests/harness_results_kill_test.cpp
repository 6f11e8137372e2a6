// A process that writes results is killed at every moment that matters; nothing may be lost, doubled or
// faked.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <exception>
#include <new>
#include <random>

#include "harness/results.h"
#include "harness_results_fixture.h"
#include "sanitized.h"

namespace icbench::testing {
namespace {

constexpr unsigned kEntries = 24;

/// Memory that outlives the child: how many entries it knows to be safe, counted by serial number.
class Acknowledged {
 public:
  Acknowledged()
      : count_(new (mmap(nullptr, sizeof(std::atomic<unsigned>), PROT_READ | PROT_WRITE,
                         MAP_SHARED | MAP_ANONYMOUS, -1, 0)) std::atomic<unsigned>(0)) {}
  ~Acknowledged() { munmap(count_, sizeof(*count_)); }
  std::atomic<unsigned>& operator*() const { return *count_; }

 private:
  std::atomic<unsigned>* count_;
};

/// Writes what is missing and completes the file.
void write_rest(const fs::path& path, OnExisting mode, std::atomic<unsigned>* acknowledged) {
  ResultsWriter out(path, context(), configuration(), mode);
  for (unsigned i = 0; i < kEntries; ++i) {
    if (!out.is_completed(entry(i).name, entry(i).repetition_index)) out.add(entry(i));
    if (acknowledged) *acknowledged = std::max(acknowledged->load(), i + 1);
  }
  out.finish();
}

/// The same in a child, which never returns into the test program.
[[noreturn]] void write_rest_and_exit(const fs::path& path, OnExisting mode,
                                      std::atomic<unsigned>& acknowledged) {
  try {
    write_rest(path, mode, &acknowledged);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "writer: %s\n", error.what());
    _exit(1);
  }
  _exit(0);
}

/// What must hold after a kill: readers are never misled, and resuming finds all that was acknowledged.
void check_remains(const fs::path& path, unsigned acknowledged) {
  if (fs::exists(path)) {
    const Json r = load(path);  // throws unless whole
    if (r["context"]["complete"] == true) {
      EXPECT_EQ(serials(r), first(kEntries));
    }
  }
  ResultsWriter out(path, context(), configuration(), OnExisting::resume);
  for (unsigned i = 0; i < acknowledged; ++i)
    EXPECT_TRUE(out.is_completed(entry(i).name, entry(i).repetition_index)) << "lost entry " << i;
}

void check_end(const TemporaryDirectory& dir, const fs::path& path) {
  write_rest(path, OnExisting::resume, nullptr);
  const Json r = load(path);
  EXPECT_EQ(serials(r), first(kEntries));
  EXPECT_EQ(r["context"]["complete"], true);
  EXPECT_EQ(dir.entries(), 1u);
}

bool may_trace() {
  const pid_t child = fork();
  if (child == 0) _exit(ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) == 0 ? 0 : 1);
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

/// These tests need ptrace, which some containers forbid; the test at random moments runs everywhere.
class ResultsKillTraced : public ::testing::Test {
 protected:
  void SetUp() override {
    // What ends at a system call is judged by the file it leaves; sanitizers see no more there, and take a minute.
    if (kSanitized) GTEST_SKIP() << "told without a sanitizer";
    if (!may_trace()) GTEST_SKIP() << "ptrace is forbidden here";
  }
};

/// Runs a writer and kills it when it stops at its `calls`-th system call boundary. False once it ended by
/// itself.
bool run_and_kill(const fs::path& path, OnExisting mode, long calls, std::atomic<unsigned>& acknowledged) {
  const pid_t child = fork();
  if (child == 0) {
    ptrace(PTRACE_TRACEME, 0, nullptr, nullptr);
    raise(SIGSTOP);
    write_rest_and_exit(path, mode, acknowledged);
  }
  int status = 0;
  waitpid(child, &status, 0);
  for (long i = 0; i < calls; ++i) {
    ptrace(PTRACE_SYSCALL, child, nullptr, nullptr);
    waitpid(child, &status, 0);
    if (WIFEXITED(status)) {
      EXPECT_EQ(WEXITSTATUS(status), 0);
      return false;
    }
    if (WIFSIGNALED(status)) {
      ADD_FAILURE() << "the writer died of signal " << WTERMSIG(status);
      return false;
    }
  }
  kill(child, SIGKILL);
  waitpid(child, &status, 0);
  return true;
}

// Files change in system calls only: killing before and after each of them visits every state there is.
TEST_F(ResultsKillTraced, AtEverySystemCallNothingIsLostDoubledOrFaked) {
  for (long calls = 1;; ++calls) {
    const TemporaryDirectory dir;
    const Acknowledged acknowledged;
    const bool killed = run_and_kill(dir / "r.json", OnExisting::replace, calls, *acknowledged);
    check_remains(dir / "r.json", *acknowledged);
    check_end(dir, dir / "r.json");
    if (HasFailure()) FAIL() << "killed at system call boundary " << calls;
    if (!killed) break;
  }
}

TEST_F(ResultsKillTraced, WhileResumingAtEverySystemCallNothingIsLostDoubledOrFaked) {
  for (long calls = 1;; ++calls) {
    const TemporaryDirectory dir;
    const Acknowledged acknowledged;
    {
      ResultsWriter out(dir / "r.json", context(), configuration());
      for (unsigned i = 0; i < 12; ++i) out.add(entry(i));
    }
    *acknowledged = 12;
    const bool killed = run_and_kill(dir / "r.json", OnExisting::resume, calls, *acknowledged);
    check_remains(dir / "r.json", *acknowledged);
    check_end(dir, dir / "r.json");
    if (HasFailure()) FAIL() << "killed at system call boundary " << calls;
    if (!killed) break;
  }
}

TEST_F(ResultsKillTraced, ReplacingAnEarlierRunLeavesTheOldFileOrTheNewOneButNoMixture) {
  for (long calls = 1;; ++calls) {
    const TemporaryDirectory dir;
    const Acknowledged acknowledged;
    {
      ResultsWriter old(dir / "r.json", context(), {{"old", true}});
      for (unsigned i = 0; i < 10; ++i) old.add(entry(i));
      if (calls % 2 == 0) old.finish();  // both a complete and an interrupted one
    }
    const std::string before = text_of(dir / "r.json");
    const bool killed = run_and_kill(dir / "r.json", OnExisting::replace, calls, *acknowledged);
    if (text_of(dir / "r.json") == before) {
      EXPECT_EQ(*acknowledged, 0u);
    } else {
      check_remains(dir / "r.json", *acknowledged);
      check_end(dir, dir / "r.json");
    }
    if (HasFailure()) FAIL() << "killed at system call boundary " << calls;
    if (!killed) break;
  }
}

TEST(ResultsKill, AtRandomMomentsOverAndOverOneRunStillEndsWhole) {
  const TemporaryDirectory dir;
  const Acknowledged acknowledged;
  std::mt19937_64 random(99);
  for (int round = 0; round < 40; ++round) {
    const pid_t child = fork();
    if (child == 0) write_rest_and_exit(dir / "r.json", OnExisting::resume, *acknowledged);
    usleep(static_cast<useconds_t>(random() % 3000));
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status) || WEXITSTATUS(status) == 0);
    check_remains(dir / "r.json", *acknowledged);
  }
  check_end(dir, dir / "r.json");
}

}  // namespace
}  // namespace icbench::testing
