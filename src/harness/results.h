// Results files in Google Benchmark's output format, written so that no kill loses or fakes anything.
//
// A regular file F is only ever replaced as a whole. It exists from the start, with `"complete": false` in
// its context and no entries yet; each add puts its entry on stable storage in the journal F.partial before
// it returns; from time to time (when the number of entries has doubled) and at the end the journal is folded
// into F. finish alone writes `"complete": true` and removes the journal. So a kill at any moment leaves
//     F as it was before the run                                   (killed while starting), or
//     F marked incomplete, plus F.partial with all entries added   (killed while running), or
//     F complete, perhaps with a stale F.partial                   (killed while finishing);
// the entries of a run are those of F and F.partial together, and resuming reads both.
//
// Any other target (a pipe, a terminal, /dev/stdout, /dev/full) is written in place, entry by entry; it
// becomes valid JSON only when finish writes the closing brackets. It cannot be resumed.
//
// Costs: add writes one line and syncs it, some milliseconds on a disk, so it belongs between measured
// regions; all folds together write O(n) entries.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "files/output_file.h"

namespace icbench {

class Journal;

/// One repetition of one benchmark.
struct Entry {
  /// E.g. "sweep/WORKLOAD/CACHE/threads:N"; with repetition_index it names the entry in its file.
  std::string name;
  unsigned repetitions = 1;
  unsigned repetition_index = 0;
  unsigned threads = 1;
  double real_time = 0.0;        ///< wall time, in time_unit, finite and >= 0
  double cpu_time = 0.0;         ///< summed over the threads, in time_unit, finite and >= 0
  std::string time_unit = "ms";  ///< "ns", "us", "ms" or "s"
  std::optional<double> items_per_second{};
  /// User counters: numbers, strings, booleans; NaN and infinity are written as null.
  nlohmann::ordered_json counters = nlohmann::ordered_json::object();
};

enum class OnExisting : std::uint8_t {
  replace,  ///< start anew
  resume    ///< keep the entries that are there; nothing there is the same as starting anew
};

class ResultsWriter {
 public:
  using Json = nlohmann::ordered_json;
  using Key = std::pair<std::string, unsigned>;  ///< name, repetition_index

  /// `context` is an environment record; `configuration` an object of everything that must be equal for
  /// entries to belong into one file. Both end up in the file's context.
  ///
  /// Throws std::runtime_error with one line if the target cannot be written, or another process is writing
  /// it; when resuming also if the file has another configuration (the line names the first key that
  /// differs), is damaged (path and byte), or is no file of ours. A file that was refused is left as it was.
  ResultsWriter(const std::filesystem::path& path, Json context, Json configuration,
                OnExisting on_existing = OnExisting::replace);
  /// Without finish: what was added stays, in a file marked incomplete.
  ~ResultsWriter();
  ResultsWriter(const ResultsWriter&) = delete;
  ResultsWriter& operator=(const ResultsWriter&) = delete;

  /// The file's context: of a resumed file the earlier run's.
  const Json& context() const noexcept { return context_; }

  /// Entries that are safe, those of a resumed file included.
  const std::set<Key>& completed() const noexcept { return completed_; }
  bool is_completed(const std::string& name, unsigned repetition_index) const {
    return completed_.contains({name, repetition_index});
  }

  /// The entries, those of a resumed file included, as they stand in the file. Empty when writing in place.
  std::vector<Json> rows() const;

  /// Sets a field of the context after all, also of a resumed file's, which is the earlier run's; in the file from the
  /// next time that it is written. When writing in place what is not in it by then stays out.
  void note(const std::string& key, Json value) { context_[key] = std::move(value); }

  /// Makes the entry safe. Throws std::runtime_error if that fails, or if the entry is not usable: there
  /// already, without name, with a time that is no number, with a counter named like a field.
  void add(const Entry& entry);

  /// Completes the file. Throws std::runtime_error if that fails; the journal then stays. To be called at
  /// most once, and nothing may be added afterwards.
  void finish();

 private:
  void start_in_place();
  void start_journal(OnExisting on_existing, const Json& configuration);
  void take(const Json& context_of_file, const std::vector<Json>& rows, const std::filesystem::path& from,
            const Json& configuration);
  void fold(bool complete);

  std::filesystem::path path_;  ///< symbolic links resolved
  Json context_;
  std::set<Key> completed_;
  std::vector<std::string> rows_;  ///< serialised, in order; empty when writing in place
  std::size_t folded_ = 0;         ///< rows in the file
  std::unique_ptr<Journal> journal_;
  Descriptor in_place_;
  bool finished_ = false;
};

}  // namespace icbench
