// Option values that several subcommands share. All throw std::runtime_error with one line.
#pragma once

#include <fmt/format.h>

#include <charconv>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "harness/topology.h"

namespace icbench {

/// Items of a comma-separated list; none may be empty.
inline std::vector<std::string> split_list(std::string_view option, std::string_view text) {
  std::vector<std::string> out;
  for (std::size_t begin = 0;;) {
    const std::size_t end = text.find(',', begin);
    out.emplace_back(text.substr(begin, end - begin));
    if (out.back().empty()) throw std::runtime_error(fmt::format("{} '{}' has an empty item", option, text));
    if (end == text.npos) return out;
    begin = end + 1;
  }
}

/// A whole number from `low` to `high`.
inline unsigned parse_count(std::string_view option, std::string_view text, unsigned low, unsigned high) {
  long long value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < low || value > high) {
    throw std::runtime_error(
        fmt::format("{} '{}' is not a whole number from {} to {}", option, text, low, high));
  }
  return static_cast<unsigned>(value);
}

template <class T>
void require_distinct(std::string_view option, const std::vector<T>& items) {
  std::set<T> seen;
  for (const T& item : items) {
    if (!seen.insert(item).second) throw std::runtime_error(fmt::format("{} names {} twice", option, item));
  }
}

/// Thread counts, "1,2,4".
inline std::vector<unsigned> parse_threads(std::string_view text) {
  std::vector<unsigned> out;
  for (const std::string& item : split_list("--threads", text)) {
    out.push_back(parse_count("--threads", item, 1, kMaxThreads));
  }
  require_distinct("--threads", out);
  return out;
}

/// "WxH", pixels.
inline std::pair<int, int> parse_size(std::string_view text) {
  constexpr unsigned kMaxSide = 16384;
  const std::size_t x = text.find('x');
  if (x == text.npos)
    throw std::runtime_error(fmt::format("--size '{}' is not of the form WIDTHxHEIGHT", text));
  return {static_cast<int>(parse_count("--size", text.substr(0, x), 1, kMaxSide)),
          static_cast<int>(parse_count("--size", text.substr(x + 1), 1, kMaxSide))};
}

}  // namespace icbench
