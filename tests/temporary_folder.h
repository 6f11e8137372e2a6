// A folder of its own for every test, removed afterwards.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <stdexcept>
#include <string>

namespace icbench {

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "icbench-test-XXXXXX").string();
    if (!mkdtemp(name.data())) throw std::runtime_error("cannot make a temporary folder");
    path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  std::filesystem::path operator/(const char* name) const { return path_ / name; }
  std::ptrdiff_t entries() const {
    return std::distance(std::filesystem::directory_iterator(path_), std::filesystem::directory_iterator());
  }

 private:
  std::filesystem::path path_;
};

/// The message of the std::runtime_error that f throws, empty if it throws none; anything else escapes.
template <class F>
std::string error_of(const F& f) {
  try {
    f();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

/// Whether `message` is one line that names what it should.
inline ::testing::AssertionResult is_one_line_with(const std::string& message, const std::string& part) {
  if (message.empty()) return ::testing::AssertionFailure() << "no error";
  if (message.find('\n') != std::string::npos || message.find(part) == std::string::npos) {
    return ::testing::AssertionFailure() << "not one line with '" << part << "': " << message;
  }
  return ::testing::AssertionSuccess();
}

}  // namespace icbench
