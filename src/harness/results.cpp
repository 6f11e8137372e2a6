#include "harness/results.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "files/input_file.h"
#include "harness/environment.h"
#include "harness/fnv1a.h"
#include "harness/journal.h"

namespace icbench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kFirstFold = 16;

/// Text that is not UTF-8 (a file name, say) is mended rather than refused.
std::string dump(const Json& j, int indent = -1) {
  return j.dump(indent, ' ', false, Json::error_handler_t::replace);
}

/// Keys sorted and numbers as they come back from a file, so that equal configurations compare equal.
nlohmann::json normalised(const Json& j) { return nlohmann::json::parse(dump(j)); }

std::string hash_of(const nlohmann::json& j) {
  Fnv1a hash;
  hash.add(j.dump());
  return hash.digits();
}

/// Characters of a value that a line has room for.
constexpr std::size_t kToldInLine = 60;

std::string dump(const nlohmann::json* value) { return value ? value->dump() : "nothing"; }

std::string shortened(std::string text) {
  return text.size() <= kToldInLine ? text : text.substr(0, kToldInLine - 3) + "...";
}

/// "WHERE is ... there and ... now" of the first difference in the order of keys, and of indices in long lists; empty if
/// there is none.
std::string first_difference(const nlohmann::json* there, const nlohmann::json* here,
                             const std::string& where = {}) {
  if (there && here && *there == *here) return {};
  if (there && here && there->is_object() && here->is_object()) {
    std::set<std::string> keys;
    for (const nlohmann::json* side : {there, here})
      for (const auto& item : side->items()) keys.insert(item.key());
    for (const std::string& key : keys) {
      const auto in = [&](const nlohmann::json* side) {
        return side->contains(key) ? &(*side)[key] : nullptr;
      };
      std::string found = first_difference(in(there), in(here), where + (where.empty() ? "" : ".") + key);
      if (!found.empty()) return found;
    }
  }
  const std::string a = dump(there), b = dump(here);
  if (there && here && there->is_array() && here->is_array() && std::max(a.size(), b.size()) > kToldInLine) {
    for (std::size_t i = 0;; ++i) {
      const auto in = [&](const nlohmann::json* side) { return i < side->size() ? &(*side)[i] : nullptr; };
      std::string found = first_difference(in(there), in(here), fmt::format("{}[{}]", where, i));
      if (!found.empty()) return found;
    }
  }
  return fmt::format("{} is {} there and {} now", where, shortened(a), shortened(b));
}

[[noreturn]] void refuse(const fs::path& path, std::string_view why) {
  throw std::runtime_error(
      fmt::format("cannot resume {}: {}; drop --resume or choose another --out", path.string(), why));
}

Json to_json(const Entry& e) {
  static constexpr std::array<std::string_view, 4> kUnits{"ns", "us", "ms", "s"};
  const auto unusable = [&](std::string_view why) {
    throw std::runtime_error(fmt::format("unusable entry '{}': {}", e.name, why));
  };
  if (e.name.empty()) unusable("it has no name");
  for (const double t : {e.real_time, e.cpu_time})
    if (!std::isfinite(t) || t < 0.0) unusable("a time must be finite and not negative");
  if (std::find(kUnits.begin(), kUnits.end(), e.time_unit) == kUnits.end())
    unusable("the time unit must be ns, us, ms or s");
  Json j{{"name", e.name},
         {"run_name", e.name},
         {"run_type", "iteration"},
         {"repetitions", e.repetitions},
         {"repetition_index", e.repetition_index},
         {"threads", e.threads},
         {"iterations", 1},
         {"real_time", e.real_time},
         {"cpu_time", e.cpu_time},
         {"time_unit", e.time_unit}};
  if (e.items_per_second) j["items_per_second"] = *e.items_per_second;
  for (const auto& [key, value] : e.counters.items()) {
    if (j.contains(key)) unusable(fmt::format("its counter '{}' has the name of a field", key));
    j[key] = value;
  }
  return j;
}

}  // namespace

ResultsWriter::ResultsWriter(const fs::path& path, Json context, Json configuration, OnExisting on_existing)
    : path_(path), context_(std::move(context)) {
  if (path.empty()) throw std::runtime_error("no file name for the results; give one with --out");
  std::error_code none;
  if (fs::is_directory(path, none)) throw_output_error(path, EISDIR);
  const nlohmann::json sorted = normalised(configuration);
  context_["configuration_hash"] = hash_of(sorted);
  context_["configuration"] = std::move(configuration);
  if (is_written_in_place(path)) {
    if (on_existing == OnExisting::resume) refuse(path, "only a regular file can be resumed");
    start_in_place();
    return;
  }
  if (const fs::path resolved = fs::weakly_canonical(path, none); !none) path_ = resolved;
  // Renaming over a file needs no right to write it; honour its protection all the same.
  if (access(path_.c_str(), W_OK) != 0 && errno != ENOENT) throw_output_error(path, errno);
  start_journal(on_existing, Json(sorted));
}

ResultsWriter::~ResultsWriter() {
  if (finished_ || !journal_) return;
  try {
    fold(false);
  } catch (const std::exception&) {
    // The journal has everything; there is nobody left to tell.
  }
}

void ResultsWriter::start_in_place() {
  in_place_ = open_in_place(path_);
  context_["complete"] = true;  // for readers only: without finish the text is no JSON
  write_all(in_place_, fmt::format("{{\n  \"context\": {},\n  \"benchmarks\": [", dump(context_)), path_);
}

void ResultsWriter::start_journal(OnExisting on_existing, const Json& configuration) {
  journal_ = std::make_unique<Journal>(path_);
  bool has_header = false;
  if (on_existing == OnExisting::resume) {
    std::error_code none;
    Json earlier;  // the context the run began with
    // An empty file is what mktemp leaves, never what we do.
    if (const auto size = fs::file_size(path_, none); !none && size > 0) {
      Json file = parse_json(load_file(path_), path_);
      if (!file.is_object() || !file.contains("context") || !file.contains("benchmarks") ||
          !file["benchmarks"].is_array())
        refuse(path_, "it is no results file");
      take(file["context"], file["benchmarks"].get<std::vector<Json>>(), path_, configuration);
      earlier = std::move(file["context"]);
    }
    folded_ = rows_.size();
    const Journal::Contents journal = journal_->read();
    if (journal.header) take(*journal.header, journal.rows, journal_->path(), configuration);
    has_header = journal.header.has_value();
    if (earlier.is_null() && has_header) earlier = *journal.header;
    if (!earlier.is_null()) {
      context_ = std::move(earlier);
      context_["resumed"].push_back(
          {{"date", date_now()}, {"load_avg", load_averages()}, {"entries", rows_.size()}});
    }
  } else {
    // Before the file changes, so that a stale journal is never taken for the new file's.
    journal_->clear();
  }
  fold(false);
  if (!has_header) journal_->append(dump(context_));
}

void ResultsWriter::take(const Json& context_of_file, const std::vector<Json>& rows, const fs::path& from,
                         const Json& configuration) {
  if (!context_of_file.is_object() || !context_of_file.contains("configuration") ||
      !context_of_file["configuration"].is_object())
    refuse(from, "its context has no configuration");
  if (context_of_file.contains("resumed") && !context_of_file["resumed"].is_array())
    refuse(from, "its context is damaged at 'resumed'");
  const nlohmann::json there = normalised(context_of_file["configuration"]), here = normalised(configuration);
  const std::string difference = first_difference(&there, &here);
  if (!difference.empty()) refuse(from, fmt::format("it has another configuration: {}", difference));
  const auto is_entry = [](const Json& row) {
    return row.is_object() && row.contains("name") && row["name"].is_string() &&
           row.contains("repetition_index") && row["repetition_index"].is_number_unsigned() &&
           row["repetition_index"].get<std::uint64_t>() <= std::numeric_limits<unsigned>::max() &&
           row.contains("real_time") && row["real_time"].is_number();
  };
  for (const Json& row : rows) {
    if (!is_entry(row)) refuse(from, "it has an entry without name, repetition_index or real_time");
    if (completed_.emplace(row["name"].get<std::string>(), row["repetition_index"].get<unsigned>()).second)
      rows_.push_back(dump(row));
  }
}

std::vector<nlohmann::ordered_json> ResultsWriter::rows() const {
  std::vector<Json> out;
  for (const std::string& row : rows_) out.push_back(Json::parse(row));
  return out;
}

void ResultsWriter::add(const Entry& entry) {
  const Json json = to_json(entry);
  const Key key{entry.name, entry.repetition_index};
  if (completed_.contains(key))
    throw std::runtime_error(fmt::format("unusable entry '{}': repetition {} is there already", entry.name,
                                         entry.repetition_index));
  std::string row = dump(json);
  if (!journal_) {
    write_all(in_place_, fmt::format("{}\n    {}", completed_.empty() ? "" : ",", row), path_);
    sync_file(in_place_, path_);
    completed_.insert(key);
    return;
  }
  journal_->append(row);
  completed_.insert(key);
  rows_.push_back(std::move(row));
  if (rows_.size() >= std::max(kFirstFold, 2 * folded_)) fold(false);
}

void ResultsWriter::finish() {
  if (journal_) {
    fold(true);
    journal_->remove();
  } else {
    write_all(in_place_, "\n  ]\n}\n", path_);
    sync_file(in_place_, path_);
    if (!in_place_.close()) throw_output_error(path_, errno);
  }
  finished_ = true;
}

void ResultsWriter::fold(bool complete) {
  context_["complete"] = complete;
  replace_file(path_, [&](const Descriptor& out) {
    std::string text = fmt::format("{{\n  \"context\": {},\n  \"benchmarks\": [", dump(context_, 2));
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      text += fmt::format("{}\n    {}", i == 0 ? "" : ",", rows_[i]);
      if (text.size() < (1u << 20)) continue;
      write_all(out, text, path_);
      text.clear();
    }
    write_all(out, text + "\n  ]\n}\n", path_);
  });
  folded_ = rows_.size();
}

}  // namespace icbench
