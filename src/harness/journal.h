// The journal of an unfinished results file: one JSON object per line, each safe before append returns.
//
// The first line is the header, the others are rows. What a kill can leave behind is a last line without its
// end; `read` cuts it off (it was never acknowledged). The lock on the journal is held while it is open, so
// that two processes never write one results file at once; it goes with the process.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "files/output_file.h"

namespace icbench {

class Journal {
 public:
  using Json = nlohmann::ordered_json;

  struct Contents {
    std::optional<Json> header;  ///< nullopt in an empty journal
    std::vector<Json> rows;
  };

  /// Opens or creates the journal of `results` ("<results>.partial"). Throws std::runtime_error if that is
  /// impossible or another process has it.
  explicit Journal(const std::filesystem::path& results);
  /// Removes the journal if it holds nothing.
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  const std::filesystem::path& path() const noexcept { return path_; }

  /// Everything that was acknowledged; cuts off a torn end. Throws std::runtime_error (path, byte) if the
  /// journal is damaged anywhere else.
  Contents read();
  /// Forgets everything.
  void clear();
  /// Adds a line, durably. If that fails the error is thrown, and the journal is as before or ends in a torn line, which
  /// `read` cuts off: nothing may be appended before.
  void append(const std::string& line);
  /// Deletes the journal; nothing may be appended afterwards.
  void remove();

 private:
  void truncate(std::size_t size);

  std::filesystem::path path_;
  Descriptor file_;
  std::size_t size_ = 0;  ///< bytes of acknowledged lines
};

/// Parses JSON text; the std::runtime_error of damaged text names `path` and the byte (counted from `base`).
nlohmann::ordered_json parse_json(std::string_view text, const std::filesystem::path& path,
                                  std::size_t base = 0);

}  // namespace icbench
