// Code that runs where there is little memory: in a child of the test. Not under sanitizers, whose shadow memory does not
// live with a limit on the address space.
#pragma once

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace icbench {

/// Calls f() in a child process of 2 GiB of address space, in which some 200 stacks of 8 MB fit. Its result is the
/// child's status, which this returns; negative, and the signal's number, where one ended it. A hang ends after a
/// minute.
template <class F>
int status_with_little_memory(F&& f) {
  const pid_t child = fork();
  if (child == 0) {
    alarm(60);
    const rlimit limit{2ull << 30, 2ull << 30};
    setrlimit(RLIMIT_AS, &limit);
    _exit(f());
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

}  // namespace icbench
