// Writing that either succeeds durably or throws: thin wrappers over POSIX descriptors.
//
// Every error is a std::runtime_error of one line: what could not be written, why, and how to mend it.
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

#include "files/descriptor.h"

namespace icbench {

/// Puts `bytes` under `path`: a regular file (or none) is replaced as by replace_file, anything else, such as a device
/// or a pipe, is written in place.
void write_file(const std::filesystem::path& path, std::string_view bytes);

/// Replaces a regular file at once: at any moment a reader, or a crash, finds the old or the new content, whole.
/// `write` fills a temporary file ".<file>.icbench" beside it, which is gone if anything fails; what a kill leaves is
/// used by the next. Symbolic links that lead to a file are followed, and its permissions stay. Throws, too, if
/// another process is at it.
void replace_file(const std::filesystem::path& file, const std::function<void(const Descriptor&)>& write);

/// Throws if a file of that name can certainly not be written: to be told before the work, not after it. `option`: by
/// which it was named.
void require_writable(std::string_view option, const std::filesystem::path& path);

/// Opens a file, or creates it, that nobody else has opened so: the lock goes with the descriptor. `flags` as of
/// open(2); `output` is for the message.
Descriptor open_alone(const std::filesystem::path& path, int flags, const std::filesystem::path& output);

/// A folder that nobody else has so, for as long as the descriptor is open: for files that belong together.
Descriptor lock_folder(const std::filesystem::path& folder);

/// Whether `path` is to be written in place: it exists and is no regular file, or names an open descriptor.
bool is_written_in_place(const std::filesystem::path& path);

/// Opens such a target. /dev/stdout, "-" and the like continue at the stream's own position.
Descriptor open_in_place(const std::filesystem::path& path);

/// Writes all of `text`, waiting where the target is slow. `path` is for the message.
void write_all(const Descriptor& out, std::string_view text, const std::filesystem::path& path);

/// Brings what was written to stable storage; targets that have none (pipes, terminals) are left alone.
void sync_file(const Descriptor& out, const std::filesystem::path& path);

/// Makes creations, renames and removals in the directory of `file` durable, where the file system can.
void sync_directory_of(const std::filesystem::path& file);

/// Makes writing past a limit on the size of files (ulimit -f) fail like a full disk; without it the process ends. For
/// the beginning of a program.
void survive_file_size_limits() noexcept;

/// Throws the error `code` (errno) about `path`.
[[noreturn]] void throw_output_error(const std::filesystem::path& path, int code);

}  // namespace icbench
