#include "scene/import_radiance_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

#include "scene/import_text.h"

namespace icbench::importing {
namespace {

bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

}  // namespace

void RadianceWords::fail(std::size_t line, const std::string& what) const {
  throw std::runtime_error(one_line(fmt::format("{}: line {}: {}", file_, line, what)));
}

void RadianceWords::skip_space() {
  for (; at_ < text_.size() && is_space(text_[at_]); ++at_) line_ += text_[at_] == '\n';
}

bool RadianceWords::more(const std::function<void(std::string_view comment)>& comment) {
  for (;;) {
    skip_space();
    if (at_ == text_.size()) return false;
    if (text_[at_] == '!')
      fail(line_, "commands are not carried out; flatten the scene with `xform -e` first");
    if (text_[at_] != '#') return true;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    comment(text_.substr(at_, end - at_));
    at_ = end;
  }
}

std::string_view RadianceWords::word(const char* what) {
  skip_space();
  if (at_ == text_.size()) fail(line_, fmt::format("the file ends where {} should be", what));
  const char quote = text_[at_];
  if (quote != '"' && quote != '\'') {
    const std::size_t start = at_;
    while (at_ < text_.size() && !is_space(text_[at_])) ++at_;
    return text_.substr(start, at_ - start);
  }
  const std::size_t end = text_.find(quote, at_ + 1);
  if (end == text_.npos) fail(line_, "a quote is not closed");
  const std::string_view word = text_.substr(at_ + 1, end - at_ - 1);
  line_ += static_cast<std::size_t>(std::count(word.begin(), word.end(), '\n'));
  at_ = end + 1;
  return word;
}

double RadianceWords::number(const char* what) {
  const std::string_view w = word(what);
  const char *start = w.data() + (w.starts_with('+') ? 1 : 0), *end = w.data() + w.size();
  double value = 0.0;
  const auto [stop, error] = std::from_chars(start, end, value);
  // Too small a number is 0 or nearly so, too large a one infinite and an error.
  if (error == std::errc::result_out_of_range) value = std::strtod(std::string(start, stop).c_str(), nullptr);
  if (error == std::errc::invalid_argument || stop != end || !(std::abs(value) <= kMostNumber))
    fail(line_, fmt::format("'{}' is not {} of at most {}", w.substr(0, 40), what, kMostNumber));
  return value;
}

std::size_t RadianceWords::count(const char* what) {
  const double n = number(what);
  if (n < 0.0 || n != std::floor(n)) fail(line_, fmt::format("{} is {}; it must be a whole number", what, n));
  return static_cast<std::size_t>(n);
}

RadianceView read_view(RadianceWords& words) {
  RadianceView view;
  const auto vector = [&](glm::dvec3& v) {
    for (int c = 0; c < 3; ++c) v[c] = words.number("a number");
  };
  while (words.more([](std::string_view) {})) {
    const std::string_view word = words.word("an option");
    if (word == "-vp") vector(view.p);
    if (word == "-vd") vector(view.d);
    if (word == "-vu") vector(view.up);
    if (word == "-vv") view.vertical = words.number("an angle");
    if (word == "-vs" || word == "-vl") view.shifted |= words.number("a number") != 0.0;
    if (word.starts_with("-vt")) view.perspective = word == "-vtv";
  }
  if (!(glm::length(glm::cross(view.d, view.up)) > 1e-3 * glm::length(view.d) * glm::length(view.up)))
    words.fail(words.line(), "the view's direction and up vector are parallel; change -vd or -vu");
  if (view.perspective && !(view.vertical > 0.1 && view.vertical < 179.0))
    words.fail(words.line(),
               fmt::format("the view's vertical angle is {}; give -vv in (0.1, 179)", view.vertical));
  return view;
}

}  // namespace icbench::importing
