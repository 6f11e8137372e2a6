// Progress of long work with an estimate of the time left.
//
// On a terminal it is a single line that overwrites itself; elsewhere (a log file, a pipe, TERM=dumb) plain
// lines, the first after ten seconds, then ever more rarely, at most one a minute. Work that ends before the
// first line is due prints its final line alone, here and there.
//
// advance may be called from several threads at once and costs an atomic addition and a clock reading; one of
// them prints, the others go on. Not for use inside a measured region. Errors in writing are ignored:
// progress is no result.
#pragma once

#include <atomic>
#include <cstdio>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

namespace icbench {

class Progress {
 public:
  struct Options {
    std::FILE* out = stderr;
    std::optional<bool> terminal{};  ///< by default: whether `out` is one
    double (*now)() = nullptr;       ///< seconds from any origin; by default steady_clock
  };

  /// `total` in any unit of work, such as trials or pixels; 0 if unknown, then no estimate is given.
  Progress(std::string label, double total);  // the default options
  Progress(std::string label, double total, const Options& options);
  /// Wipes the terminal's line if finish was not called, so that an error message starts on a clean line.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Reports `work` more units done; `note` says what is going on now. Work that was done before the start (a
  /// resumed run) goes to skip instead.
  void advance(double work, std::string_view note = {});
  /// Counts `work` as done without letting it speed up the estimate.
  void skip(double work);
  /// Prints the last line, with the time it all took. At most once.
  void finish();

 private:
  void print(std::string_view note, double now);
  std::string status(std::string_view note, double now) const;

  std::string label_;
  double total_;
  std::FILE* out_;
  bool terminal_;
  double (*now_)();
  double start_;
  std::atomic<double> done_{0.0};
  std::atomic<double> skipped_{0.0};
  std::atomic<double> next_;  ///< when the next line is due
  std::mutex mutex_;          ///< held while printing
  double interval_;           ///< between plain lines, seconds; guarded by mutex_
  bool line_open_ = false;    ///< the terminal's line holds text; guarded by mutex_
  bool finished_ = false;
};

/// "0:07", "12:03", "3:04:05"; "?" for a negative, NaN or absurd number of seconds.
std::string format_duration(double seconds);

}  // namespace icbench
