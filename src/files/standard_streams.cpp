#include "files/standard_streams.h"

#include <fcntl.h>
#include <unistd.h>

#include <iostream>

namespace icbench {

void occupy_standard_streams() noexcept {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) >= 0) continue;
    // The lowest free number.
    const int taken = open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
    if (taken > stream) close(taken);
  }
}

int status_of_output(std::string_view program, int status) {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.flush().good()) return status;
  tell("{}: cannot write to standard output\n", program);
  return 2;
}

}  // namespace icbench
