#include "scene/import_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "scene/import_text.h"

namespace icbench::importing {
namespace {

constexpr int kMostNested = 64;

// What the parser would take without end.
void check_depth(std::string_view text) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      if (c == '\\') ++i;
      if (c == '"') quoted = false;
    } else if (c == '"') {
      quoted = true;
    } else if (c == '{' || c == '[') {
      if (++depth > kMostNested)
        throw std::runtime_error(fmt::format("the JSON nests deeper than {}", kMostNested));
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
}

}  // namespace

nlohmann::json parse_json(std::string_view text) {
  check_depth(text);
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::parse_error& error) {
    const std::size_t at = std::min(error.byte, text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
    throw std::runtime_error(fmt::format("line {}, byte {}: not JSON", line, error.byte));
  } catch (const nlohmann::json::exception&) {
    throw std::runtime_error("a number of the JSON is out of range");
  }
}

void Element::fail(const std::string& what) const {
  throw std::runtime_error(one_line(fmt::format("{} {}", place_.empty() ? "the document" : place_, what)));
}

std::optional<Element> Element::find(const char* key) const {
  if (!value_->is_object()) fail("must be an object");
  const auto member = value_->find(key);
  if (member == value_->end()) return std::nullopt;
  return Element(*member, place_.empty() ? key : fmt::format("{}.{}", place_, key));
}

Element Element::at(const char* key) const {
  if (const auto member = find(key)) return *member;
  fail(fmt::format("has no '{}'", key));
}

std::size_t Element::size() const {
  if (!value_->is_array()) fail("must be an array");
  return value_->size();
}

Element Element::operator[](std::size_t i) const {
  if (i >= size()) fail(fmt::format("has {} elements; element {} is asked for", size(), i));
  return {(*value_)[i], fmt::format("{}[{}]", place_, i)};
}

std::size_t Element::items(const char* key) const {
  const auto member = find(key);
  return member ? member->size() : 0;
}

double Element::number() const {
  const double value = value_->is_number() ? value_->get<double>() : NAN;
  if (!std::isfinite(value)) fail("must be a finite number");
  return value;
}

std::uint64_t Element::whole() const {
  const double value = number();
  if (!(value >= 0.0 && value <= 0x1p53) || value != std::floor(value))
    fail(fmt::format("is {}; it must be a whole number, not negative", value));
  return static_cast<std::uint64_t>(value);
}

bool Element::truth() const {
  if (!value_->is_boolean()) fail("must be true or false");
  return value_->get<bool>();
}

const std::string& Element::text() const {
  if (!value_->is_string()) fail("must be a string");
  return value_->get_ref<const std::string&>();
}

double Element::number(const char* key, double fallback) const {
  const auto member = find(key);
  return member ? member->number() : fallback;
}

std::uint64_t Element::whole(const char* key, std::uint64_t fallback) const {
  const auto member = find(key);
  return member ? member->whole() : fallback;
}

std::string Element::text(const char* key, const std::string& fallback) const {
  const auto member = find(key);
  return member ? member->text() : fallback;
}

std::uint32_t Element::index(std::size_t end) const {
  const std::uint64_t value = whole();
  if (value >= end) fail(fmt::format("is {}, but there are {}", value, end));
  return static_cast<std::uint32_t>(value);
}

bool Element::numbers(const char* key, double* out, std::size_t count) const {
  const auto member = find(key);
  if (!member) return false;
  if (member->size() != count) member->fail(fmt::format("must hold {} numbers", count));
  for (std::size_t i = 0; i < count; ++i) out[i] = (*member)[i].number();
  return true;
}

}  // namespace icbench::importing
