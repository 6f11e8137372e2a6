// Names in files hold anything; what is said of them is one line that a terminal can show.
#pragma once

#include <algorithm>
#include <string>

namespace icbench::importing {

/// The text with '?' for its control characters. An exception's text is to pass this when it is made, for what() ends
/// at the first NUL.
inline std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return text;
}

}  // namespace icbench::importing
