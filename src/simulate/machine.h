// The virtual machine: cores, how far apart they are, and what a shared cache line costs to move between them.
//
// Only words that many threads write are simulated as lines (lock words, counters, clocks) and records that one thread
// has published and another reads for the first time. All else that an operation touches is in its measured cost.
//
// A line is at one place at a time. Who writes it waits until those before have had it, and then for the transfer:
// so a word that all write serves at most one thread per transfer, however many cores there are.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace icbench {

/// How far apart two cores are.
enum class Distance : std::uint8_t { complex, socket, machine };

/// Nanoseconds until a core has a cache line that another one wrote last.
///
/// Within a complex (cores that share a last-level cache) the calibration measures it where the machine has two cores.
/// The defaults are those of a two-socket AMD EPYC 7R13 (Milan): 23 ns among the eight cores of a complex, 107 ns
/// across complexes of a socket, 197 ns across sockets; medians of N. Viennot's core-to-core-latency
/// (github.com/nviennot/core-to-core-latency, README). Two-socket Intel Xeons of 2016 to 2021 have there 44 to 51 ns
/// within and 108 to 136 ns across sockets. David, Guerraoui and Trigonakis, "Everything you always wanted to know
/// about synchronization but were afraid to ask" (SOSP 2013), find the same order of sizes on four older machines, and
/// that crossing sockets decides how locks scale.
struct Transfers {
  std::array<double, 3> ns{23.0, 107.0, 197.0};  ///< by Distance

  /// With what is within a complex as measured. Where that is more than what is farther (a virtual machine's two cores
  /// may lie in two complexes), it is taken for those, too: nothing near costs more than what is far.
  Transfers with_near(double measured_ns) const noexcept {
    return {{measured_ns, std::max(measured_ns, ns[1]), std::max(measured_ns, ns[2])}};
  }
};

/// What computing takes, over what it takes undisturbed (harness/calibrated_work.h): processors slow down when all of
/// them are busy, and virtual ones are taken away now and then.
struct WorkPace {
  double alone = 1.0;     ///< by one core, the others idle; > 0
  double together = 1.0;  ///< by each of several at once; > 0

  double of(unsigned cores) const noexcept { return cores == 1 ? alone : together; }
};

struct MachineModel {
  unsigned cores = 1;
  unsigned cores_per_complex = 8;  ///< as the EPYC's
  unsigned cores_per_socket = 64;
  Transfers transfers{};
  WorkPace pace{};

  /// Nanoseconds for a line from core a to core b, 0 if they are one.
  double transfer_ns(unsigned a, unsigned b) const noexcept {
    if (a == b) return 0.0;
    if (a / cores_per_socket != b / cores_per_socket) return transfers.ns[2];
    return transfers.ns[a / cores_per_complex == b / cores_per_complex ? 0 : 1];
  }
};

/// A word on a cache line of its own. Times in virtual nanoseconds.
class Line {
 public:
  /// `core` writes it at time t, or reads and writes it at once; returns when that is done.
  double write(const MachineModel& machine, unsigned core, double t) noexcept {
    if (owner_ == core && !is_read_by_others_) return t;
    if (owner_ != kNobody) {
      // Readers are told to forget it: as far as the last one who has it.
      t = std::max(t, free_at_) + std::max(machine.transfer_ns(owner_, core), reader_ns(machine, core));
    }
    free_at_ = t;
    owner_ = core;
    is_read_by_others_ = false;
    ++version_;
    if (!seen_.empty()) seen_[core] = version_;
    return t;
  }

  /// `core` reads it at time t: a transfer if it was written since this core last did.
  double read(const MachineModel& machine, unsigned core, double t) {
    if (owner_ == kNobody || owner_ == core) return t;
    if (seen_.empty()) seen_.resize(machine.cores);
    if (seen_[core] == version_) return t;
    seen_[core] = version_;
    is_read_by_others_ = true;
    reader_ = core;
    return std::max(t, free_at_) + machine.transfer_ns(owner_, core);
  }

  unsigned owner() const noexcept { return owner_; }

 private:
  static constexpr unsigned kNobody = ~0u;

  double reader_ns(const MachineModel& machine, unsigned core) const noexcept {
    return is_read_by_others_ ? machine.transfer_ns(reader_, core) : 0.0;
  }

  unsigned owner_ = kNobody, reader_ = 0;
  bool is_read_by_others_ = false;
  double free_at_ = 0.0;
  std::uint64_t version_ = 0;
  std::vector<std::uint64_t> seen_;  // by core, of lines that are read: the version it has
};

}  // namespace icbench
