// Writing that either succeeds durably or throws: thin wrappers over POSIX descriptors.
//
// Every error is a std::runtime_error of one line: what could not be written, why, and how to mend it.
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>
#include <utility>

namespace icbench {

/// Owns a file descriptor.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int fd) noexcept : fd_(fd) {}
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~Descriptor() { reset(); }

  int get() const noexcept { return fd_; }
  explicit operator bool() const noexcept { return fd_ >= 0; }
  void reset() noexcept;

 private:
  int fd_ = -1;
};

/// Throws the error `code` (errno) about `path`.
[[noreturn]] void throw_output_error(const std::filesystem::path& path, int code);

/// Writes all of `text`, waiting where the target is slow. `path` is for the message.
void write_all(const Descriptor& out, std::string_view text, const std::filesystem::path& path);

/// Brings what was written to stable storage; targets that have none (pipes, terminals) are left alone.
void sync_file(const Descriptor& out, const std::filesystem::path& path);

/// Makes creations, renames and removals in the directory of `file` durable, where the file system can.
void sync_directory_of(const std::filesystem::path& file);

/// Replaces a regular file at once: at any moment a reader, or a crash, finds the old or the new content,
/// whole. `write` fills a temporary file "<file>.tmp" beside it. One process at a time.
void replace_file(const std::filesystem::path& file, const std::function<void(const Descriptor&)>& write);

/// Whether `path` is to be written in place: it exists and is no regular file, or names an open descriptor.
bool is_written_in_place(const std::filesystem::path& path);

/// Opens such a target. /dev/stdout and the like continue at the stream's own position.
Descriptor open_in_place(const std::filesystem::path& path);

}  // namespace icbench
