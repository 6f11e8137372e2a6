#include "scene/import_trial.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <new>
#include <optional>
#include <system_error>

#include "core/sanitizers.h"

namespace icbench::importing {
namespace {

// A report must fit into a pipe, so that the child need not wait for its reader.
constexpr std::size_t kMostText = 1024;
// By the clock, for a second of processor time: who waits, for a pipe among the files, takes none.
constexpr int kClockPerSecond = 10;

// Sanitizers reserve address space by the terabyte.
constexpr bool kMemoryIsOwn = !kThreadSanitizer && !kAddressSanitizer;

void limit(int what, rlim_t most) {
  rlimit now{};
  if (::getrlimit(static_cast<__rlimit_resource>(what), &now) != 0) return;
  now.rlim_cur = std::min(now.rlim_max, most);
  ::setrlimit(static_cast<__rlimit_resource>(what), &now);
}

std::size_t address_space() {
  std::ifstream statm("/proc/self/statm");
  std::size_t pages = 0;
  statm >> pages;
  return pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

// The child's whole life. Does not return.
[[noreturn]] void run(const std::function<std::string()>& attempt, std::size_t bytes, unsigned seconds,
                      int report) {
  const int nowhere = ::open("/dev/null", O_RDWR);
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, fd);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, seconds);
  if (kMemoryIsOwn) limit(RLIMIT_AS, address_space() + bytes);
  std::string said;
  try {
    said = attempt();
  } catch (const std::bad_alloc&) {
    said = kTooMuchMemory;
  } catch (const std::exception& error) {
    said = error.what();
  } catch (...) {
    said = "cannot be read";
  }
  said.resize(std::min(said.size(), kMostText));
  const bool told = ::write(report, said.data(), said.size()) == static_cast<ssize_t>(said.size());
  ::_exit(told ? 0 : 1);
}

// What comes until its writer is gone; nothing if that is not so by the deadline.
std::optional<std::string> read_all(int fd, std::chrono::steady_clock::time_point deadline) {
  std::string text;
  char buffer[kMostText];
  for (;;) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now())
            .count();
    if (left <= 0) return std::nullopt;
    pollfd waiting{fd, POLLIN, 0};
    const int ready = ::poll(&waiting, 1, static_cast<int>(std::min<std::int64_t>(left, 60'000)));
    if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
    const ssize_t n = ::read(fd, buffer, sizeof buffer);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return text;
    text.append(buffer, static_cast<std::size_t>(n));
  }
}

}  // namespace

std::string try_apart(const std::function<std::string()>& attempt, std::size_t bytes, unsigned seconds) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0)
    return fmt::format("cannot be tried out: {}", std::generic_category().message(errno));
  const pid_t child = ::fork();
  if (child == 0) run(attempt, bytes, seconds, ends[1]);
  const int error = errno;
  ::close(ends[1]);
  const auto deadline = std::chrono::steady_clock::now() + kClockPerSecond * std::chrono::seconds(seconds);
  const std::optional<std::string> said = child > 0 ? read_all(ends[0], deadline) : "";
  if (!said) ::kill(child, SIGKILL);
  ::close(ends[0]);
  if (child < 0) return fmt::format("cannot be tried out: {}", std::generic_category().message(error));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!said || (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU))
    return fmt::format("takes longer than {} s to read", seconds);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) return "makes its reader fail; it is damaged";
  return *said;
}

}  // namespace icbench::importing
