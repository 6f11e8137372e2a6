#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "harness/build_info.h"
#include "harness/environment.h"
#include "harness/machine.h"

namespace icbench {
namespace {

namespace fs = std::filesystem;

/// A directory that stands in for "/", deleted at the end.
class FakeRoot {
 public:
  FakeRoot() {
    std::string name = (fs::temp_directory_path() / "icbench_root_XXXXXX").string();
    if (!mkdtemp(name.data())) throw std::runtime_error("no temporary directory");
    path_ = name;
  }
  ~FakeRoot() { fs::remove_all(path_); }
  void put(const fs::path& file, const std::string& content) const {
    fs::create_directories((path_ / file).parent_path());
    std::ofstream(path_ / file) << content;
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

TEST(CgroupQuota, IsNoneOnAnEmptySystem) { EXPECT_EQ(cgroup_cpu_quota(FakeRoot().path()), std::nullopt); }

TEST(CgroupQuota, Version2TakesTheSmallestUpThePath) {
  const FakeRoot root;
  root.put("proc/self/cgroup", "0::/job/step\n");
  root.put("sys/fs/cgroup/job/cpu.max", "250000 100000\n");
  root.put("sys/fs/cgroup/job/step/cpu.max", "max 100000\n");
  EXPECT_EQ(cgroup_cpu_quota(root.path()), 2.5);
  root.put("sys/fs/cgroup/cpu.max", "150000 100000\n");
  EXPECT_EQ(cgroup_cpu_quota(root.path()), 1.5);
}

TEST(CgroupQuota, Version1KnowsMinusOneAsUnlimited) {
  const FakeRoot root;
  root.put("proc/self/cgroup", "4:memory:/x\n3:cpu,cpuacct:/x\n");
  root.put("sys/fs/cgroup/cpu,cpuacct/x/cpu.cfs_quota_us", "-1\n");
  root.put("sys/fs/cgroup/cpu,cpuacct/x/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(cgroup_cpu_quota(root.path()), std::nullopt);
  root.put("sys/fs/cgroup/cpu,cpuacct/x/cpu.cfs_quota_us", "400000\n");
  EXPECT_EQ(cgroup_cpu_quota(root.path()), 4.0);
}

TEST(CgroupQuota, AContainersOwnMountIsReadWhenThePathIsTheHosts) {
  const FakeRoot root;
  root.put("proc/self/cgroup", "0::/docker/abcdef\n");
  root.put("sys/fs/cgroup/cpu.max", "50000 100000\n");
  EXPECT_EQ(cgroup_cpu_quota(root.path()), 0.5);
}

TEST(CgroupQuota, GarbageIsNoQuota) {
  const FakeRoot root;
  root.put("proc/self/cgroup", "nonsense\n0::/a\n:::\n");
  root.put("sys/fs/cgroup/a/cpu.max", "0 0\n");
  root.put("sys/fs/cgroup/cpu.max", "\n");
  EXPECT_EQ(cgroup_cpu_quota(root.path()), std::nullopt);
}

TEST(Governor, IsJoinedOverPoliciesOrNotOffered) {
  const FakeRoot root;
  EXPECT_EQ(frequency_governor(root.path()), "not offered");
  root.put("sys/devices/system/cpu/cpufreq/policy0/scaling_governor", "performance\n");
  EXPECT_EQ(frequency_governor(root.path()), "performance");
  root.put("sys/devices/system/cpu/cpufreq/policy1/scaling_governor", "powersave\n");
  EXPECT_EQ(frequency_governor(root.path()), "performance,powersave");
}

TEST(Boost, IsReadFromEitherDriver) {
  const FakeRoot acpi, intel;
  EXPECT_EQ(frequency_boost(acpi.path()), "not offered");
  acpi.put("sys/devices/system/cpu/cpufreq/boost", "1\n");
  EXPECT_EQ(frequency_boost(acpi.path()), "on");
  intel.put("sys/devices/system/cpu/intel_pstate/no_turbo", "1\n");
  EXPECT_EQ(frequency_boost(intel.path()), "off");
}

TEST(SystemFacts, AreReadFromTheirFiles) {
  const FakeRoot root;
  root.put("sys/kernel/mm/transparent_hugepage/enabled", "always [madvise] never\n");
  root.put("etc/os-release", "NAME=\"X\"\nPRETTY_NAME=\"Some Linux 12\"\n");
  root.put("proc/cpuinfo", "processor\t: 0\nmodel name\t: Some CPU @ 3 GHz\ncpu MHz\t\t: 2599.99\n");
  EXPECT_EQ(transparent_huge_pages(root.path()), "madvise");
  EXPECT_EQ(operating_system(root.path()), "Some Linux 12");
  EXPECT_EQ(processor_model(root.path()), "Some CPU @ 3 GHz");
  EXPECT_DOUBLE_EQ(processor_mhz(root.path()), 2599.99);
}

TEST(SystemFacts, MissingOnesAreToldApart) {
  const FakeRoot root;
  EXPECT_EQ(transparent_huge_pages(root.path()), "not offered");
  EXPECT_EQ(operating_system(root.path()), "unknown");
  EXPECT_EQ(processor_model(root.path()), "");
  EXPECT_EQ(processor_mhz(root.path()), 0.0);
  EXPECT_EQ(hypervisor(root.path()), std::nullopt);
}

TEST(Hypervisor, IsKnownByFirmwareToo) {
  const FakeRoot root;
  root.put("sys/class/dmi/id/product_name", "PowerEdge\n");
  EXPECT_EQ(hypervisor(root.path()), std::nullopt);
  root.put("sys/class/dmi/id/product_name", "KVM Virtual Machine\n");
  EXPECT_EQ(hypervisor(root.path()), "KVM Virtual Machine");
  root.put("sys/hypervisor/type", "xen\n");
  EXPECT_EQ(hypervisor(root.path()), "xen");
}

TEST(BuildInfo, NamesCompilerAndFlags) {
  const BuildInfo b = build_info();
  EXPECT_FALSE(b.compiler.empty());
  EXPECT_NE(b.compiler_flags.find("-ffp-contract=off"), b.compiler_flags.npos);
  EXPECT_TRUE(b.commit == "unknown" || b.commit.size() == 40 || b.commit.size() == 64) << b.commit;
}

nlohmann::ordered_json record(const std::vector<unsigned>& threads,
                              Placement placement = Placement::compact) {
  return environment(Topology::synthetic("package:2 core:2 pu:2"),
                     {{"icbench", "sweep"}, 42, placement, threads});
}

TEST(Environment, HasEveryPromisedKey) {
  const auto e = record({1});
  for (const char* key : {"date",
                          "host_name",
                          "executable",
                          "num_cpus",
                          "mhz_per_cpu",
                          "cpu_scaling_enabled",
                          "caches",
                          "load_avg",
                          "library_build_type",
                          "schema_version",
                          "commit",
                          "dirty",
                          "compiler",
                          "compiler_flags",
                          "build_type",
                          "cpu_model",
                          "machine",
                          "allowed",
                          "allowed_units",
                          "boundaries",
                          "equal_speed_pus",
                          "governor",
                          "kernel",
                          "os",
                          "memory_bytes",
                          "transparent_huge_pages",
                          "cgroup_cpu_quota",
                          "virtualised",
                          "hwloc_version",
                          "command_line",
                          "seed",
                          "placement",
                          "pin_map"})
    EXPECT_TRUE(e.contains(key)) << key;
  EXPECT_EQ(e["num_cpus"], 8);
  EXPECT_EQ(e["allowed"]["cores"], 4);
  EXPECT_EQ(e["machine"]["packages"], 2);
  EXPECT_EQ(e["seed"], 42);
  EXPECT_EQ(e["command_line"].size(), 2u);
  EXPECT_EQ(e["boundaries"].back()["kind"], "oversubscribed");
}

TEST(Environment, PinMapHoldsOnePeriodPerThreadCount) {
  const auto map = record({1, 4, 8192})["pin_map"];
  EXPECT_EQ(map["1"], (std::vector<int>{0}));
  EXPECT_EQ(map["4"], (std::vector<int>{0, 2, 1, 3}));
  EXPECT_EQ(map["8192"], (std::vector<int>{0, 2, 1, 3, 4, 6, 5, 7}));
  EXPECT_EQ(record({4}, Placement::none)["pin_map"]["4"], "unbound");
}

TEST(Environment, DateIsIso8601WithOffset) {
  const std::string date = date_now();
  ASSERT_EQ(date.size(), 25u) << date;
  EXPECT_EQ(date[10], 'T');
  EXPECT_EQ(date[22], ':');
}

TEST(Environment, IdentityIgnoresWhatChangesFromCallToCall) {
  auto a = record({1}), b = record({2});
  b["date"] = "later";
  b["load_avg"] = {9.0};
  EXPECT_EQ(environment_identity(a), environment_identity(b));
  b["commit"] = "another";
  EXPECT_NE(environment_identity(a), environment_identity(b));
}

}  // namespace
}  // namespace icbench
