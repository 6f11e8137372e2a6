// Option values that several subcommands and programs share. All throw std::runtime_error with one line.
#pragma once

#include <fmt/format.h>
#include <limits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/names.h"
#include "files/output_file.h"
#include "files/standard_streams.h"
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

/// A hash as results hold it: a file may change under its name, and what was measured of it before is then of another.
inline std::string key_text(std::uint64_t key) { return fmt::format("{:016x}", key); }

/// The number that all of `text` is; none if it is none.
template <class T>
std::optional<T> number_of(std::string_view text) {
  T value = 0;
  const char* const last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, value);
  return error == std::errc{} && end == last ? std::optional<T>(value) : std::nullopt;
}

/// A whole number from `low` to `high`, decimal digits only.
template <class T>
T parse_whole(std::string_view option, std::string_view text, T low, T high) {
  const std::optional<T> value = number_of<T>(text);
  if (value && *value >= low && *value <= high) return *value;
  throw std::runtime_error(
      fmt::format("{} '{}' is not a whole number from {} to {}", option, text, low, high));
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
    out.push_back(parse_whole("--threads", item, 1u, kMaxThreads));
  }
  require_distinct("--threads", out);
  return out;
}

/// "WxH", pixels.
inline std::pair<int, int> parse_size(std::string_view text) {
  constexpr int kMaxSide = 16384;
  const std::size_t x = text.find('x');
  if (x == text.npos) {
    throw std::runtime_error(fmt::format("--size '{}' is not of the form WIDTHxHEIGHT", text));
  }
  const std::string option = fmt::format("--size '{}':", text);
  return {parse_whole(option, text.substr(0, x), 1, kMaxSide),
          parse_whole(option, text.substr(x + 1), 1, kMaxSide)};
}

/// An option for a whole number from `low` to `high`; `value`, a T or std::optional<T>, is the default and must outlive
/// the parsing.
template <class Value, class T>
CLI::Option* add_whole(CLI::App* app, const std::string& name, Value& value, T low, T high,
                       const std::string& help) {
  static_assert(std::is_same_v<Value, T> || std::is_same_v<Value, std::optional<T>>);
  const auto set = [&value, name, low, high](const std::string& text) {
    value = parse_whole(name, text, low, high);
  };
  CLI::Option* const option = app->add_option_function<std::string>(name, set, help)->type_name("N");
  if constexpr (std::is_same_v<Value, T>) option->default_str(fmt::to_string(value));
  return option;
}

/// An option for a number in (0, high], or [low, high]; `value` is the default and must outlive the parsing.
inline CLI::Option* add_positive(CLI::App* app, const std::string& name, float& value, float high,
                                 const std::string& help, float low = 0.0f) {
  const auto set = [&value, name, low, high](const std::string& text) {
    const std::optional<float> number = number_of<float>(text);
    if (!number || !(*number > 0.0f && *number >= low && *number <= high)) {
      throw std::runtime_error(
          fmt::format("{} '{}' is not a number in {}{}, {}]", name, text, low > 0.0f ? "[" : "(", low, high));
    }
    value = *number;
  };
  return app->add_option_function<std::string>(name, set, help)
      ->type_name("X")
      ->default_str(fmt::to_string(value));
}

/// Refuses an empty name, as a variable that a script has not set gives it: what was asked for would be left out.
inline const CLI::Validator is_named(
    [](const std::string& name) { return name.empty() ? std::string("needs a name") : std::string(); }, "");

/// An option for a file that is left out unless it is given; `path` must outlive the parsing.
inline CLI::Option* add_file(CLI::App* app, const std::string& name, std::string& path,
                             const std::string& help) {
  return app->add_option(name, path, help)->check(is_named)->type_name("FILE");
}

/// What to say of an error. CLI11 counts values where one is missing or an option is repeated: "1 required N missing".
inline std::string line_of(const std::exception& e) {
  const std::string text = e.what();
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&e) == nullptr) return text;
  const std::string option = text.substr(0, text.find(": "));
  if (text.ends_with(" missing")) return fmt::format("{} needs a value", option);
  return text.find("At Most") == text.npos ? text : fmt::format("{} is given more than once", option);
}

/// Names an option on standard error that was given and has no effect `where`; bad usage is to be told before, in one
/// line.
inline void tell_without_effect(std::string_view program, std::string_view option, std::string_view where) {
  tell("{}: {} has no effect {}\n", program, option, where);
}

/// Whether a command tells its figures in words: not where standard output may be the file of its results.
inline bool tells_figures(const std::filesystem::path& results) {
  return results.empty() || !is_written_in_place(results);
}

/// Where a program prints its tables that tells them in any case: beside its results on standard output they would be
/// no part of the file.
inline std::FILE* tables_stream(const std::filesystem::path& results) {
  return tells_figures(results) ? stdout : stderr;
}

/// A file by the option or argument that names it; none if the path is empty.
struct GivenFile {
  std::string_view name;
  std::filesystem::path path;
};

/// Whether both paths lead to one file, or would if it were there. What is no file, as a device, is nobody's own.
inline bool is_same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  namespace fs = std::filesystem;
  std::error_code none;
  const auto may_be_file = [&](const fs::path& p) {
    return !p.empty() && (!fs::exists(p, none) || fs::is_regular_file(p, none));
  };
  if (!may_be_file(a) || !may_be_file(b)) return false;
  const auto resolved = [](const fs::path& p) {
    std::error_code gone;  // the working directory
    const fs::path whole = fs::absolute(p, gone);
    return gone ? p : fs::weakly_canonical(whole, gone);
  };
  return fs::equivalent(a, b, none) || resolved(a) == resolved(b);
}

/// Throws if a file that is to be written is another of them, or one that is read: it would be lost.
inline void require_apart(const std::vector<GivenFile>& written, const std::vector<GivenFile>& read) {
  for (std::size_t i = 0; i < written.size(); ++i) {
    const GivenFile& file = written[i];
    for (std::size_t j = 0; j < i; ++j) {
      if (is_same_file(file.path, written[j].path)) {
        throw std::runtime_error(fmt::format("{} '{}' is the file of {} too; name another", file.name,
                                             file.path.string(), written[j].name));
      }
    }
    for (const GivenFile& other : read) {
      if (is_same_file(file.path, other.path)) {
        throw std::runtime_error(fmt::format("{} '{}' would overwrite what is read, {}; name another file",
                                             file.name, file.path.string(), other.name));
      }
    }
  }
}

}  // namespace icbench
