#include "harness/topology.h"

#include <fmt/format.h>
#include <hwloc.h>
#include <sched.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <memory>
#include <new>
#include <set>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "core/names.h"
#include "core/processing_units.h"

namespace icbench {
namespace {

constexpr std::array<std::pair<std::string_view, Placement>, 3> kPlacements{
    {{"compact", Placement::compact}, {"scatter", Placement::scatter}, {"none", Placement::none}}};

struct TopologyDeleter {
  void operator()(hwloc_topology* t) const noexcept { hwloc_topology_destroy(t); }
};
using Handle = std::unique_ptr<hwloc_topology, TopologyDeleter>;

struct BitmapDeleter {
  void operator()(hwloc_bitmap_s* b) const noexcept { hwloc_bitmap_free(b); }
};
using Bitmap = std::unique_ptr<hwloc_bitmap_s, BitmapDeleter>;

Bitmap make_bitmap() {
  Bitmap bitmap(hwloc_bitmap_alloc());
  if (bitmap == nullptr) throw std::bad_alloc();
  return bitmap;
}

Handle make_handle() {
  hwloc_topology_t raw = nullptr;
  if (hwloc_topology_init(&raw) != 0) throw std::runtime_error("hwloc cannot be initialised: out of memory");
  return Handle(raw);
}

void load(const Handle& handle) {
  // The whole machine, so that its counts can be recorded; what this process may use is cut out afterwards.
  hwloc_topology_set_flags(handle.get(), HWLOC_TOPOLOGY_FLAG_INCLUDE_DISALLOWED);
  if (hwloc_topology_load(handle.get()) != 0)
    throw std::runtime_error(
        fmt::format("hwloc cannot read the machine's topology: {}; try `lstopo`", std::strerror(errno)));
}

/// Units the process may run on: those of its cgroup or job that are also in its affinity mask.
Bitmap allowed_units(hwloc_topology_t topology) {
  Bitmap allowed = make_bitmap();
  hwloc_bitmap_copy(allowed.get(), hwloc_topology_get_allowed_cpuset(topology));
  const Bitmap bound = make_bitmap();
  if (hwloc_get_cpubind(topology, bound.get(), HWLOC_CPUBIND_THREAD) == 0)
    hwloc_bitmap_and(allowed.get(), allowed.get(), bound.get());
  return allowed;
}

unsigned count_of(hwloc_topology_t topology, hwloc_obj_type_t type, unsigned at_least) {
  return std::max(static_cast<unsigned>(std::max(hwloc_get_nbobjs_by_type(topology, type), 0)), at_least);
}

/// The outermost data cache above a unit, or null.
hwloc_obj_t last_level_cache(hwloc_obj_t unit) {
  hwloc_obj_t found = nullptr;
  for (hwloc_obj_t o = unit->parent; o; o = o->parent)
    if (hwloc_obj_type_is_dcache(o->type)) found = o;
  return found;
}

/// Stands for a cache where the system reports none.
constexpr std::uint64_t kNoCache = ~std::uint64_t{0};

/// Numbers keys 0, 1, 2 ... in order of first appearance.
class Numbering {
 public:
  unsigned operator()(std::uint64_t key) {
    return numbers_.emplace(key, static_cast<unsigned>(numbers_.size())).first->second;
  }
  unsigned size() const { return static_cast<unsigned>(numbers_.size()); }

 private:
  std::map<std::uint64_t, unsigned> numbers_;
};

/// Ranks children within their parent, in order of first appearance, and numbers the pairs.
class Nesting {
 public:
  struct Place {
    unsigned rank;    ///< of the child within its parent
    unsigned domain;  ///< number of the pair: the parent of the next level
  };
  Place operator()(unsigned parent, unsigned child) {
    auto& children = places_[parent];
    const Place fresh{static_cast<unsigned>(children.size()), domains_};
    const auto [at, is_new] = children.emplace(child, fresh);
    if (is_new) ++domains_;
    return at->second;
  }

 private:
  std::map<unsigned, std::map<unsigned, Place>> places_;
  unsigned domains_ = 0;
};

}  // namespace

std::string_view to_string(Placement placement) noexcept {
  for (const auto& [name, value] : kPlacements)
    if (value == placement) return name;
  return "none";
}

Placement parse_placement(std::string_view text) {
  for (const auto& [name, value] : kPlacements)
    if (name == text) return value;
  std::vector<std::string_view> known;
  for (const auto& [name, value] : kPlacements) known.push_back(name);
  throw std::runtime_error(unknown_name("placement", text, known));
}

Topology::Topology(hwloc_topology* topology) {
  read_units(topology);
  read_caches(topology);
  order_units();
}

Topology Topology::of_this_process() {
  Handle handle = make_handle();
  load(handle);
  if (hwloc_topology_is_thissystem(handle.get()) == 0) {
    throw std::runtime_error(
        "HWLOC_XMLFILE or HWLOC_SYNTHETIC tells of another machine than this; unset it, or set "
        "HWLOC_THISSYSTEM=1 if "
        "it is this one");
  }
  return Topology(handle.get());
}

Topology Topology::synthetic(const std::string& description) {
  Handle handle = make_handle();
  if (hwloc_topology_set_synthetic(handle.get(), description.c_str()) != 0)
    throw std::runtime_error(fmt::format(
        "'{}' is not a topology in hwloc's synthetic notation; an example: package:2 core:12 pu:2",
        description));
  load(handle);
  return Topology(handle.get());
}

void Topology::read_units(hwloc_topology* topology) {
  const Bitmap allowed = allowed_units(topology);
  Numbering packages, nodes, caches, cores;
  std::map<unsigned, unsigned> siblings;
  bool one_kind = true;
  for (hwloc_obj_t unit = nullptr; (unit = hwloc_get_next_obj_by_type(topology, HWLOC_OBJ_PU, unit));) {
    if (!hwloc_bitmap_isset(allowed.get(), unit->os_index)) continue;
    // A level that the system does not report falls back to the next one that it does.
    const auto above = [&](hwloc_obj_type_t type) {
      return hwloc_get_ancestor_obj_by_type(topology, type, unit);
    };
    const hwloc_obj_t package = above(HWLOC_OBJ_PACKAGE);
    const hwloc_obj_t core = above(HWLOC_OBJ_CORE);
    const hwloc_obj_t cache = last_level_cache(unit);
    const int node = unit->nodeset ? hwloc_bitmap_first(unit->nodeset) : 0;
    ProcessingUnit u{};
    u.os_index = unit->os_index;
    u.core = cores((core ? core : unit)->gp_index);
    u.smt = siblings[u.core]++;
    u.cache = caches(cache ? cache->gp_index : kNoCache);
    u.numa_node = nodes(static_cast<std::uint64_t>(std::max(node, 0)));
    u.package = packages(package ? package->gp_index : 0);
    u.kind = hwloc_cpukinds_get_by_cpuset(topology, unit->cpuset, 0);
    if (!compact_.empty() && u.kind != compact_.front().kind) one_kind = false;
    compact_.push_back(u);
  }
  if (compact_.empty())
    throw std::runtime_error(
        "no processing unit is allowed to this process; check its affinity mask and cpuset");
  allowed_ = {static_cast<unsigned>(compact_.size()), cores.size(), packages.size(), nodes.size()};
  machine_ = {count_of(topology, HWLOC_OBJ_PU, 1), count_of(topology, HWLOC_OBJ_CORE, allowed_.cores),
              count_of(topology, HWLOC_OBJ_PACKAGE, 1), count_of(topology, HWLOC_OBJ_NUMANODE, 1)};
  const bool known = std::all_of(compact_.begin(), compact_.end(), [](const auto& u) { return u.kind >= 0; });
  equal_speed_ = !known ? EqualSpeed::unknown : one_kind ? EqualSpeed::yes : EqualSpeed::no;

  const hwloc_obj_t root = hwloc_get_root_obj(topology);
  // The library tells only its interface's version; its own is noted in the root.
  if (const char* version = hwloc_obj_get_info_by_name(root, "hwlocVersion"); version)
    hwloc_version_ = version;
  for (hwloc_obj_t object : {root, hwloc_get_obj_by_type(topology, HWLOC_OBJ_PACKAGE, 0)})
    if (const char* model = object ? hwloc_obj_get_info_by_name(object, "CPUModel") : nullptr; model)
      cpu_model_ = model;
}

void Topology::read_caches(hwloc_topology* topology) {
  for (hwloc_obj_type_t type : {HWLOC_OBJ_L1CACHE, HWLOC_OBJ_L2CACHE, HWLOC_OBJ_L3CACHE, HWLOC_OBJ_L4CACHE}) {
    for (hwloc_obj_t o = nullptr; (o = hwloc_get_next_obj_by_type(topology, type, o));) {
      const DataCache cache{o->attr->cache.depth,
                            o->attr->cache.type == HWLOC_OBJ_CACHE_DATA ? "Data" : "Unified",
                            o->attr->cache.size,
                            o->attr->cache.linesize,
                            static_cast<unsigned>(std::max(hwloc_bitmap_weight(o->cpuset), 0)),
                            1};
      const auto same = std::find_if(caches_.begin(), caches_.end(), [&](const DataCache& c) {
        return std::tie(c.level, c.type, c.size, c.num_sharing) ==
               std::tie(cache.level, cache.type, cache.size, cache.num_sharing);
      });
      if (same != caches_.end()) {
        ++same->count;
      } else {
        caches_.push_back(cache);
      }
    }
  }
}

void Topology::order_units() {
  std::stable_sort(compact_.begin(), compact_.end(), [](const ProcessingUnit& a, const ProcessingUnit& b) {
    return std::tie(a.package, a.smt, a.numa_node, a.cache, a.core) <
           std::tie(b.package, b.smt, b.numa_node, b.cache, b.core);
  });
  struct Dealt {
    unsigned smt, core, cache, node, package, os_index;  // ranks within the next larger domain, slowest first
    auto operator<=>(const Dealt&) const = default;
  };
  // Levels are nested by force: one NUMA node may span packages, and one cache several nodes.
  Nesting nodes, caches, cores;
  std::vector<Dealt> dealt;
  for (const ProcessingUnit& u : compact_) {
    const Nesting::Place node = nodes(u.package, u.numa_node);
    const Nesting::Place cache = caches(node.domain, u.cache);
    const Nesting::Place core = cores(cache.domain, u.core);
    dealt.push_back({u.smt, core.rank, cache.rank, node.rank, u.package, u.os_index});
  }
  std::sort(dealt.begin(), dealt.end());
  for (const Dealt& d : dealt) scatter_.push_back(d.os_index);
}

std::vector<Boundary> Topology::boundaries() const {
  std::vector<Boundary> found;
  std::map<unsigned, bool> seen_nodes{{compact_.front().numa_node, true}};
  for (unsigned i = 1; i < compact_.size(); ++i) {
    const ProcessingUnit& before = compact_[i - 1];
    const ProcessingUnit& u = compact_[i];
    const bool new_node = seen_nodes.emplace(u.numa_node, true).second;
    if (u.package != before.package) {
      found.push_back({i + 1, "package"});
    } else if (u.smt > before.smt) {
      found.push_back({i + 1, "smt"});
    } else if (new_node) {
      found.push_back({i + 1, "numa_node"});
    }
  }
  found.push_back({static_cast<unsigned>(compact_.size()) + 1, "oversubscribed"});
  return found;
}

std::vector<Binding> Topology::plan(Placement placement, unsigned n) const {
  if (n < 1 || n > kMaxThreads)
    throw std::runtime_error(fmt::format("cannot place {} threads; choose 1 to {}", n, kMaxThreads));
  std::vector<Binding> bindings(n, kUnbound);
  for (unsigned i = 0; i < n; ++i) {
    const std::size_t slot = i % compact_.size();
    if (placement == Placement::compact) bindings[i] = static_cast<Binding>(compact_[slot].os_index);
    if (placement == Placement::scatter) bindings[i] = static_cast<Binding>(scatter_[slot]);
  }
  return bindings;
}

std::vector<unsigned> default_thread_counts(unsigned units) {
  constexpr unsigned kEnough = 6;
  std::set<unsigned> counts{units};
  const auto double_from = [&](unsigned n) {
    for (; n < units; n *= 2) counts.insert(n);
  };
  const auto is_short = [&] { return units >= kEnough && counts.size() < kEnough; };
  double_from(1);
  if (is_short()) double_from(3);
  if (is_short()) counts.insert(units - 1);  // six units need every count
  counts.insert(std::min(4 * units, kMaxThreads));
  return {counts.begin(), counts.end()};
}

std::error_code bind_this_thread(unsigned os_index) noexcept {
  const auto failed = [](int code) { return std::error_code(code, std::generic_category()); };
  using Mask = std::array<std::uint64_t, kMaxUnits / 64>;
  if (os_index >= kMaxUnits) return failed(EINVAL);
  Mask wanted{};
  wanted[os_index / 64] = std::uint64_t{1} << os_index % 64;
  // The system calls take words of any number; glibc's type has a fixed one.
  if (sched_setaffinity(0, sizeof wanted, reinterpret_cast<const cpu_set_t*>(wanted.data())) != 0)
    return failed(errno);
  Mask actual{};
  if (sched_getaffinity(0, sizeof actual, reinterpret_cast<cpu_set_t*>(actual.data())) != 0)
    return failed(errno);
  return actual == wanted ? std::error_code{} : failed(ENOTSUP);
}

}  // namespace icbench
