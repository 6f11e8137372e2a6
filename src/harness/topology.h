// The processing units this process may use, and the order in which threads are pinned to them.
//
// Read once with hwloc, from the main thread and before anything is pinned: the affinity mask, cgroup or
// batch job the process was started in is respected, and no thread is ever placed outside it.
//
// Orders of placement, over the allowed units:
//   compact   fills a package before it opens the next; within one, every core gets a thread before any core
//             gets a second (SMT siblings last), caches and NUMA nodes in order. Few sockets, shared caches.
//   scatter   deals threads round over packages, then NUMA nodes, then last-level caches, then cores; SMT
//             siblings last. Most memory bandwidth and cache per thread.
//   none      unbound; the kernel's scheduler decides.
// Plans are prefixes of each other: thread i sits at the same place whatever the number of threads. Past the
// number of units they wrap round, which is marked as oversubscribed.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

struct hwloc_topology;

namespace icbench {

enum class Placement : std::uint8_t { compact, scatter, none };

std::string_view to_string(Placement placement) noexcept;
/// Throws std::runtime_error that lists the choices.
Placement parse_placement(std::string_view text);

/// Where a thread is pinned: the operating system's index of a processing unit, or kUnbound.
using Binding = int;
inline constexpr Binding kUnbound = -1;

/// Most threads that a plan can be made for.
inline constexpr unsigned kMaxThreads = 8192;

/// Thread counts to measure on so many units, ascending: powers of two up to them, themselves, and four times
/// as many. Six units or more get at least six counts that are not oversubscribed, as fitting a scaling law
/// takes: where powers of two are too few, 3, 6, 12 ... come in between.
std::vector<unsigned> default_thread_counts(unsigned units);

/// One allowed processing unit. All indices but os_index are numbered from 0 over the allowed units.
struct ProcessingUnit {
  unsigned os_index;   ///< the operating system's number
  unsigned core;       ///< physical core
  unsigned smt;        ///< rank among the allowed units of its core: 0 for the first, 1 for its sibling ...
  unsigned cache;      ///< last-level cache domain
  unsigned numa_node;  ///< nearest NUMA node
  unsigned package;    ///< socket
  int kind;            ///< hwloc's CPU kind (slower kinds have smaller numbers), -1 if unknown
};

struct DataCache {
  unsigned level;
  std::string type;      ///< "Data" or "Unified"
  std::uint64_t size;    ///< bytes
  unsigned line;         ///< bytes, 0 if unknown
  unsigned num_sharing;  ///< processing units behind one of them
  unsigned count;        ///< how many of this sort the machine has
};

/// Counts of hardware, of the whole machine or of the allowed part.
struct HardwareCounts {
  unsigned units, cores, packages, numa_nodes;
};

/// A thread count at which compact placement starts to use something new; plots draw a line there.
struct Boundary {
  unsigned threads;
  std::string_view kind;  ///< "smt", "numa_node", "package" or "oversubscribed"
};

enum class EqualSpeed : std::uint8_t { yes, no, unknown };

class Topology {
 public:
  /// The machine, restricted to what this process may use. Throws std::runtime_error if it cannot be read.
  static Topology of_this_process();
  /// An imagined machine in hwloc's synthetic notation ("package:2 core:12 pu:2"), to plan for.
  static Topology synthetic(const std::string& description);

  /// Allowed units in compact order; never empty.
  const std::vector<ProcessingUnit>& units() const noexcept { return compact_; }
  HardwareCounts allowed() const noexcept { return allowed_; }
  HardwareCounts machine() const noexcept { return machine_; }
  const std::vector<DataCache>& caches() const noexcept { return caches_; }
  /// Whether all allowed units run at the same speed, as far as the system tells.
  EqualSpeed equal_speed() const noexcept { return equal_speed_; }
  std::string_view cpu_model() const noexcept { return cpu_model_; }  ///< empty if unknown
  std::string_view hwloc_version() const noexcept { return hwloc_version_; }

  /// Ascending; the last one is always "oversubscribed".
  std::vector<Boundary> boundaries() const;
  /// Bindings of threads 0 .. n-1. Throws std::runtime_error unless 1 <= n <= kMaxThreads.
  std::vector<Binding> plan(Placement placement, unsigned n) const;
  /// Whether n threads are more than the allowed units.
  bool oversubscribed(unsigned n) const noexcept { return n > compact_.size(); }

 private:
  explicit Topology(hwloc_topology* topology);
  void read_units(hwloc_topology* topology);
  void read_caches(hwloc_topology* topology);
  void order_units();

  std::vector<ProcessingUnit> compact_;
  std::vector<unsigned> scatter_;  ///< os indices
  HardwareCounts allowed_{};
  HardwareCounts machine_{};
  std::vector<DataCache> caches_;
  EqualSpeed equal_speed_ = EqualSpeed::unknown;
  std::string cpu_model_;
  std::string hwloc_version_ = "unknown";
};

/// Pins the calling thread to one processing unit and reads the binding back. Returns what went wrong, if
/// anything did.
///
/// Asks the kernel rather than hwloc, whose call allocates and does not survive a full address space: threads
/// start until memory ends, and a started one has to be able to tell.
[[nodiscard]] std::error_code bind_this_thread(unsigned os_index) noexcept;

}  // namespace icbench
