#include "harness/machine.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstring>
#include <fstream>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>

#if defined(__x86_64__)
#include <cpuid.h>
#endif

namespace icbench {
namespace {

namespace fs = std::filesystem;

std::string trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\n\r\"");
  if (first == text.npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(" \t\n\r\"") - first + 1));
}

/// The first line of a file without surrounding blanks; empty if it cannot be read.
std::string first_line(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return trimmed(line);
}

std::optional<double> number(std::string_view text) {
  double value = 0.0;
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  if (result.ec != std::errc() || result.ptr == text.data()) return std::nullopt;
  return value;
}

/// Value after "key<separator>" in a file of such lines; empty if there is none.
std::string field(const fs::path& path, std::string_view key, char separator) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    const auto end = line.find(separator);
    if (end != line.npos && trimmed(line.substr(0, end)) == key) return trimmed(line.substr(end + 1));
  }
  return {};
}

std::optional<double> smaller(std::optional<double> a, std::optional<double> b) {
  if (!a || !b) return a ? a : b;
  return std::min(*a, *b);
}

/// Quota of one group's directory.
std::optional<double> group_quota(const fs::path& group) {
  std::istringstream v2(first_line(group / "cpu.max"));  // "max 100000" or "250000 100000", microseconds
  std::string quota, period;
  if (!(v2 >> quota >> period)) {
    quota = first_line(group / "cpu.cfs_quota_us");  // -1: unlimited
    period = first_line(group / "cpu.cfs_period_us");
  }
  const auto q = number(quota);
  const auto p = number(period);
  if (!q || !p || *q <= 0.0 || *p <= 0.0) return std::nullopt;
  return *q / *p;
}

/// Smallest quota from `group` up to `mount`. In a container the path may be the host's and not exist under
/// the mount; what does exist is read.
std::optional<double> quota_up_to(const fs::path& mount, const std::string& group) {
  std::optional<double> least = group_quota(mount);
  fs::path at = mount;
  for (const fs::path& part : fs::path(group).relative_path()) {
    at /= part;
    least = smaller(least, group_quota(at));
  }
  return least;
}

}  // namespace

std::optional<double> cgroup_cpu_quota(const fs::path& root) {
  std::optional<double> least;
  std::ifstream groups(root / "proc/self/cgroup");  // lines "hierarchy:controllers:path"
  for (std::string line; std::getline(groups, line);) {
    const auto first = line.find(':');
    const auto second = first == line.npos ? line.npos : line.find(':', first + 1);
    if (second == line.npos) continue;
    const std::string controllers = fmt::format(",{},", line.substr(first + 1, second - first - 1));
    const std::string group = line.substr(second + 1);
    const fs::path base = root / "sys/fs/cgroup";
    if (controllers == ",,")
      for (const fs::path& mount : {base, base / "unified"})
        least = smaller(least, quota_up_to(mount, group));
    if (controllers.find(",cpu,") != controllers.npos)
      for (const char* mount : {"cpu", "cpu,cpuacct"})
        least = smaller(least, quota_up_to(base / mount, group));
  }
  return least;
}

std::string frequency_governor(const fs::path& root) {
  std::set<std::string> governors;
  std::error_code ignored;
  fs::directory_iterator policy(root / "sys/devices/system/cpu/cpufreq", ignored);
  for (; policy != fs::directory_iterator(); policy.increment(ignored))
    if (const std::string name = first_line(policy->path() / "scaling_governor"); !name.empty())
      governors.insert(name);
  return governors.empty() ? kNotOffered : fmt::format("{}", fmt::join(governors, ","));
}

std::string frequency_boost(const fs::path& root) {
  const fs::path cpu = root / "sys/devices/system/cpu";
  if (const std::string off = first_line(cpu / "intel_pstate/no_turbo"); !off.empty())
    return off == "0" ? "on" : "off";
  if (const std::string on = first_line(cpu / "cpufreq/boost"); !on.empty()) return on == "0" ? "off" : "on";
  return kNotOffered;
}

double processor_mhz(const fs::path& root) {
  const fs::path cpufreq = root / "sys/devices/system/cpu/cpu0/cpufreq";
  for (const char* file : {"base_frequency", "cpuinfo_max_freq"})  // kHz
    if (const auto khz = number(first_line(cpufreq / file)); khz && *khz > 0.0) return *khz / 1000.0;
  return number(field(root / "proc/cpuinfo", "cpu MHz", ':')).value_or(0.0);
}

std::string processor_model(const fs::path& root) {
  for (const char* key : {"model name", "Model", "Hardware", "cpu"})
    if (std::string model = field(root / "proc/cpuinfo", key, ':'); !model.empty()) return model;
  return {};
}

std::string transparent_huge_pages(const fs::path& root) {
  // "always [madvise] never".
  const std::string modes = first_line(root / "sys/kernel/mm/transparent_hugepage/enabled");
  const auto open = modes.find('[');
  const auto close = modes.find(']');
  if (open == modes.npos || close == modes.npos || close < open) return kNotOffered;
  return modes.substr(open + 1, close - open - 1);
}

std::string operating_system(const fs::path& root) {
  for (const char* file : {"etc/os-release", "usr/lib/os-release"})
    if (std::string name = field(root / file, "PRETTY_NAME", '='); !name.empty()) return name;
  return "unknown";
}

namespace {

/// Hypervisors by the signatures they give at CPUID leaf 0x40000000.
std::string common_name(const std::string& signature) {
  constexpr std::pair<std::string_view, std::string_view> kNames[] = {{"KVMKVMKVM", "KVM"},
                                                                      {"Microsoft Hv", "Hyper-V"},
                                                                      {"VMwareVMware", "VMware"},
                                                                      {"XenVMMXenVMM", "Xen"},
                                                                      {"TCGTCGTCGTCG", "QEMU"}};
  for (const auto& [known, name] : kNames) {
    if (signature == known) return std::string(name);
  }
  return signature;
}

}  // namespace

std::optional<std::string> hypervisor(const fs::path& root) {
#if defined(__x86_64__)
  if (root == "/") {
    unsigned a = 0, b = 0, c = 0, d = 0;
    if (__get_cpuid(1, &a, &b, &c, &d) && (c >> 31) != 0) {
      __cpuid(0x40000000, a, b, c, d);
      std::array<char, 13> name{};
      std::memcpy(name.data(), &b, 4);
      std::memcpy(name.data() + 4, &c, 4);
      std::memcpy(name.data() + 8, &d, 4);
      const std::string text = trimmed(name.data());
      const bool readable =
          std::all_of(text.begin(), text.end(), [](unsigned char ch) { return std::isprint(ch); });
      return text.empty() || !readable ? "unknown" : common_name(text);
    }
  }
#endif
  if (std::string type = first_line(root / "sys/hypervisor/type"); !type.empty()) return type;
  std::error_code ignored;
  if (fs::exists(root / "sys/firmware/devicetree/base/hypervisor", ignored)) return "unknown";
  const std::string product = first_line(root / "sys/class/dmi/id/product_name");
  for (const char* known :
       {"KVM", "QEMU", "VMware", "VirtualBox", "Virtual Machine", "Amazon EC2", "HVM domU"})
    if (product.find(known) != product.npos) return product;
  return std::nullopt;
}

}  // namespace icbench
