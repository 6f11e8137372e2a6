#include "harness/journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>

#include "files/input_file.h"

namespace icbench {

namespace fs = std::filesystem;

nlohmann::ordered_json parse_json(std::string_view text, const fs::path& path, std::size_t base) {
  // No result nests deeper than a few levels; what does would overflow the stack of whoever prints it.
  constexpr int kMostNested = 64;
  const auto keep = [&path](int depth, nlohmann::ordered_json::parse_event_t, const nlohmann::ordered_json&) {
    if (depth > kMostNested)
      throw std::runtime_error(
          fmt::format("{} is damaged: nested too deeply; move it away or drop --resume", path.string()));
    return true;
  };
  try {
    return nlohmann::ordered_json::parse(text.begin(), text.end(), keep);
  } catch (const nlohmann::json::out_of_range&) {  // which says nothing of where
    throw std::runtime_error(
        fmt::format("{} is damaged: a number after byte {} is too large; move it away or drop --resume",
                    path.string(), base));
  } catch (const nlohmann::json::parse_error& error) {
    throw std::runtime_error(
        fmt::format("{} is damaged: no valid JSON at byte {}; move it away or drop --resume", path.string(),
                    base + error.byte));
  }
}

Journal::Journal(const fs::path& results) : path_(results) {
  path_ += ".partial";
  file_ = open_alone(path_, O_RDWR | O_APPEND, results);
  struct stat status {};
  if (fstat(file_.get(), &status) != 0) throw_output_error(path_, errno);
  size_ = static_cast<std::size_t>(status.st_size);
  sync_directory_of(path_);
}

Journal::~Journal() {
  if (file_ && size_ == 0) unlink(path_.c_str());
}

Journal::Contents Journal::read() {
  const std::string text = load_file(path_);
  Contents contents;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = text.find('\n', at);
    if (end == text.npos) break;  // torn
    const std::string_view line(text.data() + at, end - at);
    // A crash of the machine may leave a last line of the right length whose blocks were never written.
    if (end + 1 == text.size() && !Json::accept(line.begin(), line.end())) break;
    Json row = parse_json(line, path_, at);
    if (contents.header) {
      contents.rows.push_back(std::move(row));
    } else {
      contents.header = std::move(row);
    }
    at = end + 1;
  }
  if (at < text.size()) truncate(at);
  return contents;
}

void Journal::truncate(std::size_t size) {
  if (ftruncate(file_.get(), static_cast<off_t>(size)) != 0) throw_output_error(path_, errno);
  size_ = size;
  sync_file(file_, path_);
}

void Journal::clear() { truncate(0); }

void Journal::append(const std::string& line) {
  try {
    write_all(file_, line + '\n', path_);
    sync_file(file_, path_);
  } catch (...) {
    // If this fails too, read cuts the torn line off.
    [[maybe_unused]] const int is_cut = ftruncate(file_.get(), static_cast<off_t>(size_));
    throw;
  }
  size_ += line.size() + 1;
}

void Journal::remove() {
  unlink(path_.c_str());
  file_.close();
  sync_directory_of(path_);
}

}  // namespace icbench
