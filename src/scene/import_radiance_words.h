// The words of Radiance's text files, with the lines they stand in, and views.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <string>
#include <string_view>

namespace icbench::importing {

/// Reads a text word by word. Errors are std::runtime_error with file and line. The text must outlive it.
class RadianceWords {
 public:
  RadianceWords(std::string file, std::string_view text, std::size_t first_line = 1)
      : file_(std::move(file)), text_(text), line_(first_line) {}

  [[noreturn]] void fail(std::size_t line, const std::string& what) const;

  /// Line of the last word, or of what follows it.
  std::size_t line() const noexcept { return line_; }

  /// Skips space and hands comments on; false at the end. Refuses commands.
  bool more(const std::function<void(std::string_view comment)>& comment);

  /// The next word, or what stands in quotes. `what` tells what it should be.
  std::string_view word(const char* what);
  double number(const char* what);  ///< finite, at most kMostNumber
  std::size_t count(const char* what);

  /// Larger numbers have no meaning in a scene, and their products would overflow.
  static constexpr double kMostNumber = 1e15;

 private:
  void skip_space();

  std::string file_;
  std::string_view text_;
  std::size_t at_ = 0, line_;
};

/// What options such as `-vp 0 0 1 -vd 1 0 0 -vu 0 0 1 -vv 40` describe; the defaults are those of rvu.
struct RadianceView {
  glm::dvec3 p{0.0, 0.0, 0.0}, d{0.0, 1.0, 0.0}, up{0.0, 0.0, 1.0};
  double vertical = 45.0;  ///< degrees, in (0.1, 179) if perspective
  bool perspective = true;
  bool shifted = false;  ///< by -vs or -vl
};

/// Reads the options that matter and skips all other words. The up vector is not parallel to the direction.
RadianceView read_view(RadianceWords& words);

}  // namespace icbench::importing
