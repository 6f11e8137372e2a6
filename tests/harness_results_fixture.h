// A temporary directory and the small vocabulary that the tests of results files share.
#pragma once

#include <fmt/format.h>
#include <stdlib.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <utility>

#include "harness/results.h"

namespace icbench::testing {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Deleted at the end. In memory where possible: thousands of syncs to a disk would take minutes, and the
/// death of a process, unlike that of the machine, leaves the same behind on any file system.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    const fs::path memory = "/dev/shm";
    const bool in_memory = access(memory.c_str(), W_OK) == 0;
    std::string name = ((in_memory ? memory : fs::temp_directory_path()) / "icbench_results_XXXXXX").string();
    if (!mkdtemp(name.data())) throw std::runtime_error("no temporary directory");
    path_ = name;
  }
  ~TemporaryDirectory() { fs::remove_all(path_); }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  fs::path operator/(const char* name) const { return path_ / name; }
  std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(path_), fs::directory_iterator()));
  }

 private:
  fs::path path_;
};

inline Json context() { return {{"date", "2024-01-01T00:00:00+00:00"}, {"host_name", "here"}}; }
inline Json configuration() {
  return {{"threads", {1, 2}}, {"workload", {{"records", 100}, {"skew", 0.99}}}};
}

inline Entry entry(unsigned i) {
  Entry e;
  e.name = fmt::format("sweep/uniform/null/threads:{}", i / 3 + 1);
  e.repetitions = 3;
  e.repetition_index = i % 3;
  e.threads = i / 3 + 1;
  e.real_time = 1.5 + i;
  e.cpu_time = 3.0 + i;
  e.counters["serial"] = i;
  return e;
}

inline std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline void write_text(const fs::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
}

inline Json load(const fs::path& path) { return Json::parse(text_of(path)); }

inline fs::path journal_of(fs::path path) { return path += ".partial"; }

/// Serial numbers of the entries with how often each is there.
inline std::map<unsigned, int> serials(const Json& results) {
  std::map<unsigned, int> found;
  for (const Json& e : results["benchmarks"]) ++found[e["serial"].get<unsigned>()];
  return found;
}

/// Serial numbers 0 .. n-1, once each.
inline std::map<unsigned, int> first(unsigned n) {
  std::map<unsigned, int> all;
  for (unsigned i = 0; i < n; ++i) all[i] = 1;
  return all;
}

/// The message of the std::runtime_error that f throws; empty if it throws none.
template <class F>
std::string error_of(F&& f) {
  try {
    f();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

}  // namespace icbench::testing
