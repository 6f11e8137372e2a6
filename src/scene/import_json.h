// A JSON document whose every misuse is an error with its place: "accessors[3].count is -1; ...".
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace icbench::importing {

/// Parses a document. Throws std::runtime_error with one line for text that is not JSON or nests deeper than
/// any scene needs.
nlohmann::json parse_json(std::string_view text);

/// A value and where it stands; refers to the document, which must outlive it. Errors are std::runtime_error.
class Element {
 public:
  Element(const nlohmann::json& value, std::string place) : value_(&value), place_(std::move(place)) {}

  [[noreturn]] void fail(const std::string& what) const;
  const std::string& place() const noexcept { return place_; }

  /// Members of an object; `at` requires it.
  std::optional<Element> find(const char* key) const;
  Element at(const char* key) const;
  bool has(const char* key) const { return find(key).has_value(); }

  /// Elements of an array. `items` of an absent member is 0.
  std::size_t size() const;
  Element operator[](std::size_t i) const;
  std::size_t items(const char* key) const;

  /// The value itself, checked.
  double number() const;        ///< finite
  std::uint64_t whole() const;  ///< in [0, 2^53]
  bool truth() const;           ///< true or false
  const std::string& text() const;

  /// Members by value; the fallback stands for an absent one.
  double number(const char* key, double fallback) const;
  std::uint64_t whole(const char* key, std::uint64_t fallback) const;
  std::string text(const char* key, const std::string& fallback) const;

  /// An index below `end`.
  std::uint32_t index(std::size_t end) const;

  /// `count` numbers of an array member; false if it is absent.
  bool numbers(const char* key, double* out, std::size_t count) const;

 private:
  const nlohmann::json* value_;
  std::string place_;
};

}  // namespace icbench::importing
