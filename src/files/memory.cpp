#include "files/memory.h"

#include <fmt/format.h>

#include <fstream>
#include <stdexcept>
#include <string>

namespace icbench {

void require_memory(std::string_view what, std::uint64_t bytes, const std::filesystem::path& root) {
  std::ifstream file(root / "proc/meminfo");  // lines "Name:   number kB"
  std::string name;
  std::uint64_t kilobytes = 0;
  for (std::string rest; file >> name >> kilobytes; std::getline(file, rest)) {
    if (name != "MemAvailable:") continue;
    if (bytes / 1024 <= kilobytes) return;
    throw std::runtime_error(fmt::format(
        "{} needs at least {:.1f} GB of memory where {:.1f} GB are available; ask for a smaller size", what,
        1e-9 * static_cast<double>(bytes), 1024e-9 * static_cast<double>(kilobytes)));
  }
}

}  // namespace icbench
