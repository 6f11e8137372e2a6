#include "harness/perf_counters.h"

#include <fmt/format.h>
#include <linux/perf_event.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <fstream>
#include <system_error>

namespace icbench {
namespace {

constexpr std::uint64_t kL1dReadMisses =
    PERF_COUNT_HW_CACHE_L1D | (PERF_COUNT_HW_CACHE_OP_READ << 8) | (PERF_COUNT_HW_CACHE_RESULT_MISS << 16);

perf_event_attr attr_of(const PerfEvent& event) {
  perf_event_attr attr{};
  attr.size = sizeof attr;
  attr.type = event.type;
  attr.config = event.config;
  attr.disabled = 1;
  attr.exclude_kernel = 1;  // what an unprivileged user may count
  attr.exclude_hv = 1;
  attr.read_format = PERF_FORMAT_TOTAL_TIME_ENABLED | PERF_FORMAT_TOTAL_TIME_RUNNING;
  return attr;
}

std::string_view value_after_colon(std::string_view line) {
  const std::size_t at = line.find(": ");
  return at == line.npos ? std::string_view() : line.substr(at + 2);
}

std::vector<PerfEvent> of_this_machine() {
  std::string vendor;
  unsigned family = 0, model = 0;
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line) && !line.empty();) {
    const std::string_view value = value_after_colon(line);
    if (line.starts_with("vendor_id")) vendor = value;
    if (line.starts_with("cpu family")) std::from_chars(value.data(), value.data() + value.size(), family);
    if (line.starts_with("model\t")) std::from_chars(value.data(), value.data() + value.size(), model);
  }
  return perf_events_of(vendor, family, model);
}

std::string reason(int code) {
  switch (code) {
    case ENOENT:
    case EOPNOTSUPP:
    case ENODEV:
      return "not offered by this machine";
    case EACCES:
    case EPERM:
      return "not permitted; lower /proc/sys/kernel/perf_event_paranoid or grant CAP_PERFMON";
    case ENOSYS:
      return "this kernel has no perf_event_open";
    default:
      return std::generic_category().message(code);
  }
}

}  // namespace

std::vector<PerfEvent> perf_events_of(std::string_view vendor, unsigned family, unsigned model) {
  std::vector<PerfEvent> events = {
      {"cycles", PERF_TYPE_HARDWARE, PERF_COUNT_HW_CPU_CYCLES, "core cycles"},
      {"instructions", PERF_TYPE_HARDWARE, PERF_COUNT_HW_INSTRUCTIONS, "instructions retired"},
      {"cache_misses", PERF_TYPE_HARDWARE, PERF_COUNT_HW_CACHE_MISSES, "last-level cache misses"},
      {"l1d_misses", PERF_TYPE_HW_CACHE, kL1dReadMisses, "loads that missed the first-level data cache"},
  };
  // Skylake to Comet Lake: elsewhere in the family, Atoms included, the number may mean another event.
  constexpr unsigned kSkylakes[] = {0x4e, 0x5e, 0x55, 0x8e, 0x9e, 0xa5, 0xa6};
  if (vendor == "GenuineIntel" && family == 6 &&
      std::find(std::begin(kSkylakes), std::end(kSkylakes), model) != std::end(kSkylakes)) {
    events.push_back(
        {"line_transfers", PERF_TYPE_RAW, 0x04d2,
         "loads answered by a modified line of another core: MEM_LOAD_L3_HIT_RETIRED.XSNP_HITM, event "
         "D2H umask 04H (Intel Software Developer's Manual, volume 3B)"});
  } else if (vendor == "AuthenticAMD" && family == 0x19) {
    events.push_back(
        {"line_transfers", PERF_TYPE_RAW, 0x1443,
         "demand fills from a cache of another core complex: event 43H, bits 2 and 4 (AMD Processor "
         "Programming Reference, family 19h)"});
  }
  return events;
}

std::span<const PerfEvent> perf_events() {
  static const std::vector<PerfEvent> events = of_this_machine();
  return events;
}

int perf_open_by_kernel(perf_event_attr& attr) {
  return static_cast<int>(syscall(SYS_perf_event_open, &attr, 0, -1, -1, PERF_FLAG_FD_CLOEXEC));
}

PerfGroup::~PerfGroup() {
  for (const Counter& c : counters_) close(c.fd);
}

void PerfGroup::open(std::span<const PerfEvent> events, PerfOpen how) {
  for (const PerfEvent& event : events) {
    perf_event_attr attr = attr_of(event);
    const int fd = how(attr);
    if (fd >= 0) counters_.push_back({event.name, fd});
  }
}

void PerfGroup::start() noexcept {
  for (const Counter& c : counters_) ioctl(c.fd, PERF_EVENT_IOC_ENABLE, 0);
}

void PerfGroup::stop() noexcept {
  for (const Counter& c : counters_) ioctl(c.fd, PERF_EVENT_IOC_DISABLE, 0);
}

std::optional<double> PerfGroup::value(std::string_view name) const {
  for (const Counter& c : counters_) {
    if (c.name != name) continue;
    struct {
      std::uint64_t value, enabled, running;
    } said{};
    if (read(c.fd, &said, sizeof said) != static_cast<ssize_t>(sizeof said) || said.running == 0)
      return std::nullopt;
    return static_cast<double>(said.value) * static_cast<double>(said.enabled) /
           static_cast<double>(said.running);
  }
  return std::nullopt;
}

PerfOffer perf_offer(std::span<const PerfEvent> events, PerfOpen how) {
  PerfOffer offer;
  for (const PerfEvent& event : events) {
    perf_event_attr attr = attr_of(event);
    const int fd = how(attr);
    if (fd >= 0) {
      close(fd);
      offer.names.push_back(event.name);
      continue;
    }
    const std::string why = reason(errno);
    if (!offer.note.empty()) offer.note += "; ";
    offer.note += fmt::format("{}: {}", event.name, why);
  }
  if (std::none_of(events.begin(), events.end(),
                   [](const PerfEvent& e) { return e.name == "line_transfers"; })) {
    if (!offer.note.empty()) offer.note += "; ";
    offer.note += "line_transfers: no documented event of this processor is known here";
  }
  if (offer.names.empty() && !offer.note.empty())
    offer.note = fmt::format("no hardware counters: {}", offer.note);
  return offer;
}

}  // namespace icbench
