#include "files/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <csignal>
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
      return "create the directory first or choose another file";
    case EACCES:
    case EPERM:
    case EROFS:
      return "choose a file that you may write to";
    case ENOSPC:
    case EDQUOT:
      return "free some space or choose another file";
    default:
      return "choose another file";
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

/// Whether the descriptor is still the file of that name: who held its lock may have deleted or renamed it.
bool is_current(const Descriptor& file, const fs::path& path) {
  struct stat opened {};
  struct stat named {};
  return fstat(file.get(), &opened) == 0 && stat(path.c_str(), &named) == 0 &&
         opened.st_ino == named.st_ino && opened.st_dev == named.st_dev;
}

}  // namespace

void write_file(const fs::path& path, std::string_view bytes) {
  if (!is_written_in_place(path)) {
    replace_file(path, [&](const Descriptor& out) { write_all(out, bytes, path); });
    return;
  }
  Descriptor out = open_in_place(path);
  write_all(out, bytes, path);
  if (!out.close()) throw_output_error(path, errno);
}

void throw_output_error(const fs::path& path, int code) {
  throw std::runtime_error(fmt::format("cannot write '{}': {}; {}", path.string(),
                                       std::generic_category().message(code), remedy(code)));
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

void survive_file_size_limits() noexcept { std::signal(SIGXFSZ, SIG_IGN); }

void sync_directory_of(const fs::path& file) {
  const fs::path directory = file.has_parent_path() ? file.parent_path() : fs::path(".");
  const Descriptor d(open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (d) fsync(d.get());  // some file systems refuse this for directories; the rename itself stays atomic
}

Descriptor open_alone(const fs::path& path, int flags, const fs::path& output) {
  for (;;) {
    Descriptor file(open(path.c_str(), flags | O_CREAT | O_CLOEXEC, 0666));
    if (!file) throw_output_error(output, errno);
    // Other errors come from file systems without locks; one writer is then the caller's care.
    if (flock(file.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
      throw std::runtime_error(fmt::format(
          "another process is writing '{}'; wait for it or choose another file", output.string()));
    if (is_current(file, path)) return file;
  }
}

void replace_file(const fs::path& file, const std::function<void(const Descriptor&)>& write) {
  std::error_code none;
  const fs::path target = fs::is_symlink(file, none) ? fs::weakly_canonical(file, none) : file;
  if (target.empty()) throw_output_error(file, none ? none.value() : ENOENT);
  const fs::path temporary = target.parent_path() / fmt::format(".{}.icbench", target.filename().string());
  const Descriptor out = open_alone(temporary, O_WRONLY, file);
  try {
    if (ftruncate(out.get(), 0) != 0) throw_output_error(file, errno);  // what a kill left behind
    struct stat before {};
    if (stat(target.c_str(), &before) == 0)
      fchmod(out.get(), before.st_mode & 0777);  // not of another user's leftover
    write(out);
    sync_file(out, file);
    if (rename(temporary.c_str(), target.c_str()) != 0) throw_output_error(file, errno);
  } catch (...) {
    unlink(temporary.c_str());
    throw;
  }
  sync_directory_of(target);
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
