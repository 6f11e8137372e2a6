// Names in files hold anything; what is said of them is one line that a terminal can show.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>

namespace icbench::importing {

/// The text with '?' for its control characters. An exception's text is to pass this when it is made, for what() ends
/// at the first NUL.
inline std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return text;
}

/// A name of some thing in a file, on one line and cut where it is long: it is copied for every instance of the thing.
inline std::string short_name(std::string name) {
  constexpr std::size_t kLongest = 100;  // bytes
  if (name.size() > kLongest) {
    std::size_t end = kLongest;
    while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xc0) == 0x80)
      --end;  // within a letter of UTF-8
    name = name.substr(0, end) + "...";  // in memory of its own
  }
  return one_line(std::move(name));
}

}  // namespace icbench::importing
