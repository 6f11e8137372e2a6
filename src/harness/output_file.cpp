#include "harness/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>

namespace icbench {
namespace {

namespace fs = std::filesystem;

const char* remedy(int code) noexcept {
  switch (code) {
    case ENOENT:
    case ENOTDIR:
      return "create the directory first or choose another --out";
    case EACCES:
    case EPERM:
    case EROFS:
      return "choose an --out that you may write to";
    case ENOSPC:
    case EDQUOT:
      return "free some space or choose another --out";
    default:
      return "choose another --out";
  }
}

/// N for /dev/fd/N and its other names, if `path` is one.
std::optional<int> named_descriptor(const fs::path& path) {
  const std::string text = path.lexically_normal().string();
  if (text == "/dev/stdout") return STDOUT_FILENO;
  if (text == "/dev/stderr") return STDERR_FILENO;
  for (const std::string_view prefix : {"/dev/fd/", "/proc/self/fd/"}) {
    if (!text.starts_with(prefix)) continue;
    int number = -1;
    const char* end = text.data() + text.size();
    const auto result = std::from_chars(text.data() + prefix.size(), end, number);
    if (result.ec == std::errc() && result.ptr == end) return number;
  }
  return std::nullopt;
}

}  // namespace

void Descriptor::reset() noexcept {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

void throw_output_error(const fs::path& path, int code) {
  throw std::runtime_error(
      fmt::format("cannot write results to {}: {}; {}", path.string(), std::strerror(code), remedy(code)));
}

void write_all(const Descriptor& out, std::string_view text, const fs::path& path) {
  while (!text.empty()) {
    const ssize_t n = write(out.get(), text.data(), text.size());
    if (n >= 0) {
      text.remove_prefix(static_cast<std::size_t>(n));
    } else if (errno == EAGAIN) {
      pollfd ready{out.get(), POLLOUT, 0};
      poll(&ready, 1, -1);
    } else if (errno != EINTR) {
      throw_output_error(path, errno);
    }
  }
}

void sync_file(const Descriptor& out, const fs::path& path) {
  if (fsync(out.get()) != 0 && errno != EINVAL && errno != ENOTSUP && errno != EROFS)
    throw_output_error(path, errno);
}

void sync_directory_of(const fs::path& file) {
  const fs::path directory = file.has_parent_path() ? file.parent_path() : fs::path(".");
  const Descriptor d(open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (d) fsync(d.get());  // some file systems refuse this for directories; the rename itself stays atomic
}

void replace_file(const fs::path& file, const std::function<void(const Descriptor&)>& write) {
  fs::path temporary = file;
  temporary += ".tmp";
  Descriptor out(open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (!out) throw_output_error(file, errno);
  try {
    write(out);
    sync_file(out, file);
    if (rename(temporary.c_str(), file.c_str()) != 0) throw_output_error(file, errno);
  } catch (...) {
    unlink(temporary.c_str());
    throw;
  }
  sync_directory_of(file);
}

bool is_written_in_place(const fs::path& path) {
  std::error_code none;
  const fs::file_status status = fs::status(path, none);
  return named_descriptor(path) || (fs::exists(status) && !fs::is_regular_file(status));
}

Descriptor open_in_place(const fs::path& path) {
  const auto number = named_descriptor(path);
  Descriptor out(number ? fcntl(*number, F_DUPFD_CLOEXEC, 0)
                        : open(path.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY));
  if (!out) throw_output_error(path, errno);
  return out;
}

}  // namespace icbench
