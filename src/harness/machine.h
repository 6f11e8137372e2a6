// What Linux tells about the machine under /proc, /sys and /etc. Everything here is read afresh at each call
// and never fails: what a system does not offer comes back as nullopt, an empty string or "not offered".
//
// `root` stands in for "/" so that tests can show other machines.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace icbench {

inline constexpr const char* kNotOffered = "not offered";

/// Processors' worth of time that the control group allows (a container's --cpus, a job's share): the
/// smallest quota over the group and its parents, cgroup v1 and v2. nullopt when unlimited.
std::optional<double> cgroup_cpu_quota(const std::filesystem::path& root = "/");

/// Frequency governor of the processors, "performance" say; several are joined by commas.
std::string frequency_governor(const std::filesystem::path& root = "/");

/// Whether the frequency may exceed the nominal one: "on", "off" or "not offered".
std::string frequency_boost(const std::filesystem::path& root = "/");

/// Nominal or highest frequency of the first processor, MHz; 0 if unknown.
double processor_mhz(const std::filesystem::path& root = "/");

/// Processor's name from /proc/cpuinfo; empty if it has none there.
std::string processor_model(const std::filesystem::path& root = "/");

/// Transparent huge pages: "always", "madvise" or "never".
std::string transparent_huge_pages(const std::filesystem::path& root = "/");

/// Distribution's name and version.
std::string operating_system(const std::filesystem::path& root = "/");

/// Name of the hypervisor ("unknown" for one that does not tell its name); nullopt on bare metal as far as
/// the processor and the firmware tell.
std::optional<std::string> hypervisor(const std::filesystem::path& root = "/");

}  // namespace icbench
