// Takes the place of a function of Highway's shared library that this runs as it is loaded, in every program: its
// timer's resolution, by the instruction rdtscp. Where a virtual machine does not offer that, valgrind knows none, and
// no program that is linked with Highway could be counted by it (bench/instructions). Nothing here asks for the figure.
#include <hwy/nanobenchmark.h>

#include <cstdint>

namespace hwy::platform {

__attribute__((visibility("default"))) std::uint64_t TimerResolution() { return 1; }

}  // namespace hwy::platform
