#include "harness/environment.h"

#include <fmt/format.h>
#include <stdlib.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>
#include <vector>

#include "harness/build_info.h"
#include "harness/fnv1a.h"
#include "harness/machine.h"

namespace icbench {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const HardwareCounts& c) {
  return {{"units", c.units}, {"cores", c.cores}, {"packages", c.packages}, {"numa_nodes", c.numa_nodes}};
}

Json caches_of(const Topology& topology) {
  Json caches = Json::array();
  for (const DataCache& c : topology.caches())
    caches.push_back({{"type", c.type},
                      {"level", c.level},
                      {"size", c.size},
                      {"num_sharing", c.num_sharing},
                      {"line", c.line},
                      {"count", c.count}});
  return caches;
}

Json boundaries_of(const Topology& topology) {
  Json boundaries = Json::array();
  for (const Boundary& b : topology.boundaries())
    boundaries.push_back({{"threads", b.threads}, {"kind", b.kind}});
  return boundaries;
}

Json pin_map(const Topology& topology, const RunInfo& run) {
  Json map = Json::object();
  const auto units = static_cast<unsigned>(topology.units().size());
  for (unsigned n : run.thread_counts) {
    std::vector<Binding> plan = topology.plan(run.placement, n);
    plan.resize(std::min(n, units));  // beyond, the plan repeats
    map[std::to_string(n)] = run.placement == Placement::none ? Json("unbound") : Json(plan);
  }
  return map;
}

Json equal_speed(const Topology& topology) {
  if (topology.equal_speed() == EqualSpeed::unknown) return "unknown";
  return topology.equal_speed() == EqualSpeed::yes;
}

std::string executable(const RunInfo& run) {
  std::error_code error;
  const auto path = std::filesystem::read_symlink("/proc/self/exe", error);
  if (!error) return path.string();
  return run.command_line.empty() ? "unknown" : run.command_line.front();
}

/// What tells a program from others of the same commit: a hash of its file.
std::string program_hash() {
  std::ifstream file("/proc/self/exe", std::ios::binary);
  Fnv1a hash;
  std::vector<char> bytes(1u << 20);
  do {
    file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    hash.add({bytes.data(), static_cast<std::size_t>(file.gcount())});
  } while (file);
  return hash.digits();
}

std::string host_name() {
  std::array<char, 257> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "unknown";
}

std::vector<unsigned> allowed_units(const Topology& topology) {
  std::vector<unsigned> units;
  for (const ProcessingUnit& u : topology.units()) units.push_back(u.os_index);
  std::sort(units.begin(), units.end());
  return units;
}

}  // namespace

std::vector<double> load_averages() {
  std::array<double, 3> averages{};
  const int n = getloadavg(averages.data(), static_cast<int>(averages.size()));
  return {averages.begin(), averages.begin() + std::max(n, 0)};
}

std::string date_now() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S%z", &local);
  const std::string_view date = text.data();
  if (date.size() < 2) return "unknown";
  // strftime's offset has no colon.
  return fmt::format("{}:{}", date.substr(0, date.size() - 2), date.substr(date.size() - 2));
}

Json environment(const Topology& topology, const RunInfo& run) {
  const BuildInfo build = build_info();
  const std::string governor = frequency_governor();
  const auto quota = cgroup_cpu_quota();
  const auto host = hypervisor();
  utsname kernel{};
  uname(&kernel);
  Json e;
  e["date"] = date_now();
  e["host_name"] = host_name();
  e["executable"] = executable(run);
  e["num_cpus"] = topology.machine().units;
  e["mhz_per_cpu"] = static_cast<std::int64_t>(processor_mhz() + 0.5);
  e["cpu_scaling_enabled"] = governor != kNotOffered && governor != "performance";
  e["caches"] = caches_of(topology);
  e["load_avg"] = load_averages();
  e["library_build_type"] = build.assertions ? "debug" : "release";

  e["schema_version"] = kSchemaVersion;
  e["commit"] = build.commit;
  e["dirty"] = build.dirty;
  // Of what no commit tells.
  e["program"] = build.dirty || build.commit == "unknown" ? program_hash() : "";
  e["compiler"] = build.compiler;
  e["compiler_flags"] = build.compiler_flags;
  e["build_type"] = build.build_type;
  e["cpu_model"] = topology.cpu_model().empty() ? processor_model() : std::string(topology.cpu_model());
  e["machine"] = to_json(topology.machine());
  e["allowed"] = to_json(topology.allowed());
  e["allowed_units"] = allowed_units(topology);
  e["boundaries"] = boundaries_of(topology);
  e["equal_speed_pus"] = equal_speed(topology);
  e["governor"] = governor;
  e["boost"] = frequency_boost();
  e["architecture"] = kernel.machine;
  e["kernel"] = fmt::format("{} {}", kernel.sysname, kernel.release);
  e["os"] = operating_system();
  e["memory_bytes"] = static_cast<std::int64_t>(sysconf(_SC_PHYS_PAGES)) * sysconf(_SC_PAGESIZE);
  e["page_bytes"] = sysconf(_SC_PAGESIZE);
  e["transparent_huge_pages"] = transparent_huge_pages();
  e["cgroup_cpu_quota"] = quota ? Json(*quota) : Json(nullptr);
  e["virtualised"] = host.has_value();
  e["hypervisor"] = host ? Json(*host) : Json(nullptr);
  e["hwloc_version"] = topology.hwloc_version();
  e["command_line"] = run.command_line;
  e["seed"] = run.seed;
  e["placement"] = to_string(run.placement);
  e["pin_map"] = pin_map(topology, run);
  return e;
}

std::string program_of(const Json& environment) {
  const std::string commit = environment.value("commit", ""), program = environment.value("program", "");
  return program.empty() ? commit : fmt::format("{} with changes, program {}", commit, program);
}

Json environment_identity(const Json& environment) {
  Json identity = Json::object();
  for (const char* key :
       {"schema_version", "host_name", "cpu_model", "machine", "allowed_units", "kernel", "governor", "boost",
        "transparent_huge_pages", "cgroup_cpu_quota", "hypervisor", "commit", "dirty", "program", "compiler",
        "compiler_flags", "build_type", "library_build_type"})
    identity[key] = environment.value(key, Json(nullptr));
  return identity;
}

}  // namespace icbench
