#include "harness/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <utility>

namespace icbench {
namespace {

constexpr double kTerminalInterval = 0.1;
constexpr double kFirstPlainInterval = 10.0;
constexpr double kLastPlainInterval = 60.0;
constexpr const char* kWipe = "\r\033[K";  // back to the first column, clear the line

double steady_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

bool is_terminal(std::FILE* out) {
  const char* term = std::getenv("TERM");
  return isatty(fileno(out)) == 1 && term && std::string_view(term) != "dumb";
}

std::size_t columns(std::FILE* out) {
  winsize size{};
  return ioctl(fileno(out), TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

/// `text` in at most `width` columns, cut between characters of UTF-8.
std::string cut(std::string text, std::size_t width) {
  if (text.size() <= width) return text;
  while (width > 0 && (static_cast<unsigned char>(text[width]) & 0xc0u) == 0x80u) --width;
  text.resize(width);
  return text;
}

}  // namespace

std::string format_duration(double seconds) {
  if (!(seconds >= 0.0) || seconds > 1e9) return "?";
  const auto s = static_cast<long long>(std::llround(seconds));
  if (s < 3600) return fmt::format("{}:{:02}", s / 60, s % 60);
  return fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
}

Progress::Progress(std::string label, double total) : Progress(std::move(label), total, Options{}) {}

Progress::Progress(std::string label, double total, const Options& options)
    : label_(std::move(label)),
      total_(total),
      out_(options.out),
      terminal_(options.terminal.value_or(is_terminal(options.out))),
      now_(options.now ? options.now : steady_seconds),
      start_(now_()),
      next_(start_ + (terminal_ ? kTerminalInterval : kFirstPlainInterval)),
      interval_(kFirstPlainInterval) {}

Progress::~Progress() {
  if (!line_open_) return;
  std::fputs(kWipe, out_);
  std::fflush(out_);
}

// relaxed throughout: the counters are statistics, they publish nothing; next_ only thins out the printing.
void Progress::advance(double work, std::string_view note) {
  done_.fetch_add(work, std::memory_order_relaxed);
  const double now = now_();
  if (now < next_.load(std::memory_order_relaxed)) return;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock || finished_ || now < next_.load(std::memory_order_relaxed)) return;
  print(note, now);
  if (!terminal_) interval_ = std::min(1.5 * interval_, kLastPlainInterval);
  next_.store(now + (terminal_ ? kTerminalInterval : interval_), std::memory_order_relaxed);
}

void Progress::skip(double work) {
  skipped_.fetch_add(work, std::memory_order_relaxed);
  done_.fetch_add(work, std::memory_order_relaxed);
}

void Progress::finish() {
  const std::lock_guard lock(mutex_);
  if (finished_) return;
  finished_ = true;
  const std::string line = fmt::format("{}: {:.0f} done in {}", label_, done_.load(std::memory_order_relaxed),
                                       format_duration(now_() - start_));
  std::fputs(fmt::format("{}{}\n", terminal_ ? kWipe : "", line).c_str(), out_);
  std::fflush(out_);
  line_open_ = false;
}

std::string Progress::status(std::string_view note, double now) const {
  const double done = done_.load(std::memory_order_relaxed);
  const double here = done - skipped_.load(std::memory_order_relaxed);
  std::string text = fmt::format("{}: {:.0f}", label_, done);
  if (total_ > 0.0) {
    const double left = here > 0.0 ? std::max(total_ - done, 0.0) * (now - start_) / here : -1.0;
    text += fmt::format("/{:.0f} ({:.0f} %), {} left", total_, std::min(100.0 * done / total_, 100.0),
                        format_duration(left));
  } else {
    text += fmt::format(" in {}", format_duration(now - start_));
  }
  if (!note.empty()) text += fmt::format(", {}", note);
  return text;
}

void Progress::print(std::string_view note, double now) {
  std::string line = status(note, now);
  if (terminal_) {
    line = fmt::format("{}{}", kWipe, cut(std::move(line), columns(out_) - 1));
    line_open_ = true;
  } else {
    line += '\n';
  }
  std::fputs(line.c_str(), out_);
  std::fflush(out_);
}

}  // namespace icbench
