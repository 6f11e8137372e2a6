// Help with mistyped names: the one line for a name that is not known, with the nearest match offered.
#pragma once

#include <algorithm>
#include <numeric>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/setup_error.h"

namespace icbench {

/// Levenshtein distance: the fewest insertions, deletions and replacements of a byte that turn a into b.
inline std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

/// The name closest to `word`, the first of equals: one that begins with it, else one that shares half of its letters;
/// empty if there is none.
inline std::string_view nearest(std::string_view word, std::span<const std::string_view> names) {
  const auto goes_on = [&](std::string_view name) { return name.starts_with(word); };
  if (const auto at = std::find_if(names.begin(), names.end(), goes_on); at != names.end() && !word.empty())
    return *at;
  std::string_view best;
  std::size_t best_distance = 0;
  for (const std::string_view name : names) {
    const std::size_t distance = edit_distance(word, name);
    if (2 * distance > std::max(word.size(), name.size())) continue;
    if (best.empty() || distance < best_distance) {
      best = name;
      best_distance = distance;
    }
  }
  return best;
}

/// The line for a name that is not among `names`; `kind` is what it should have been, such as "metric".
inline std::string unknown_name(std::string_view kind, std::string_view word,
                                std::span<const std::string_view> names) {
  std::string line = "unknown " + std::string(kind) + " '" + std::string(word) + "'; ";
  if (const std::string_view guess = nearest(word, names); !guess.empty()) {
    line += "did you mean '" + std::string(guess) + "'? ";
  }
  line += "known:";
  for (const std::string_view name : names) {
    line += name == names.front() ? " " : ", ";
    line += name;
  }
  return line;
}

/// The entry of that name in a table of entries with a `name`. Fails at set-up with the line above if there is none.
template <class Table>
const auto& find_named(std::string_view kind, std::string_view name, const Table& table) {
  std::vector<std::string_view> known;
  for (const auto& entry : table) {
    if (entry.name == name) return entry;
    known.push_back(entry.name);
  }
  fail_setup(unknown_name(kind, name, known).c_str());
}

}  // namespace icbench
