#include "files/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <limits.h>
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

/// N for /dev/fd/N and its other names, if `path` is one; "-" is standard output, as for most programs.
std::optional<int> named_descriptor(const fs::path& path) {
  if (path == "-") return STDOUT_FILENO;
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

/// Throws if another process has locked the same. Other errors come from file systems without locks; one writer is then
/// the caller's care.
void lock(const Descriptor& opened, const fs::path& output, std::string_view kind) {
  if (flock(opened.get(), LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  throw std::runtime_error(fmt::format("another process is writing '{}'; wait for it or choose another {}",
                                       output.string(), kind));
}

// Characters by which the longest name of a temporary file is longer: that of a cache's or trace's
// (caches/cache_file_bytes.h), with a process and a number.
constexpr std::size_t kTemporaryAddition = std::string_view(".tmp4194304.4294967295").size();

/// Whether renaming over a file there is denied although one may write to both: in a sticky folder its owner alone may,
/// or the folder's.
bool is_kept_by_its_owner(const fs::path& file, const fs::path& folder) {
  struct stat f {};
  struct stat d {};
  const uid_t me = geteuid();
  return me != 0 && stat(file.c_str(), &f) == 0 && stat(folder.c_str(), &d) == 0 &&
         (d.st_mode & S_ISVTX) != 0 && f.st_uid != me && d.st_uid != me;
}

}  // namespace

void require_writable(std::string_view option, const fs::path& path) {
  const auto refuse = [&](const std::string& why) {
    throw std::runtime_error(fmt::format("{} '{}': {}", option, path.string(), why));
  };
  if (path.empty()) refuse("this names no file");
  std::error_code none;
  if (fs::is_directory(path, none)) refuse("this is a folder; name a file");
  if (path.is_relative() && fs::current_path(none).empty())
    refuse("the working directory is gone; change to one that is there");
  const fs::path folder = path.has_parent_path() ? path.parent_path() : ".";
  if (!fs::is_directory(folder, none)) {
    refuse(fmt::format("there is no folder '{}'; make it first", folder.string()));
  }
  // A regular file is replaced by another that is written beside it.
  const bool is_there = fs::exists(path, none);
  const bool is_replaced = !is_written_in_place(path);
  const fs::path target = fs::is_symlink(path, none) ? fs::weakly_canonical(path, none) : path;
  if (is_replaced && target.empty()) refuse("this link leads nowhere; choose another place");
  const fs::path place = target.has_parent_path() ? target.parent_path() : ".";
  if ((is_there && access(path.c_str(), W_OK) != 0) ||
      (is_replaced && (access(place.c_str(), W_OK | X_OK) != 0 || is_kept_by_its_owner(target, place)))) {
    refuse("no permission to write there; choose another place");
  }
  if (is_replaced && target.filename().native().size() + kTemporaryAddition > NAME_MAX)
    refuse(fmt::format("this name is too long; {} characters at most", NAME_MAX - kTemporaryAddition));
}

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
    lock(file, output, "file");
    if (is_current(file, path)) return file;
  }
}

Descriptor lock_folder(const fs::path& folder) {
  Descriptor opened(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!opened) throw_output_error(folder, errno);
  lock(opened, folder, "folder");
  return opened;
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
