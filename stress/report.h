// What a run of icstress has found: as JSON, as tables for people, and as the answer whether all is well.
//
// Every section is one array of the JSON and one table. A new one is an `add`, an array and a `print_...` that returns
// how many of its rows are failures.
#pragma once

#include <cstdio>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "stress/campaign.h"
#include "stress/controls.h"
#include "stress/explore/explore.h"
#include "stress/progress/controls.h"

namespace icbench::stress {

class Report {
 public:
  explicit Report(std::uint64_t seed) : seed_(seed) {}

  /// The checks named in `checks`, one row each.
  void add(const Subject& subject, const Totals& totals, std::span<const std::string> checks);
  void add(const Control& control, const ControlOutcome& outcome);
  void add(const explore::Exploration& exploration);
  void add(const explore::ExploredControl& control);
  /// Names of caches that were to be explored but cannot be.
  void exempt(std::vector<std::string> caches) { exempt_ = std::move(caches); }
  void add(const ProgressResult& result);
  void add(const ProgressControl& control, const ProgressControlOutcome& outcome);
  /// What this run left out, in a sentence.
  void not_examined(std::string what) { not_examined_.push_back(std::move(what)); }

  /// Prints all that there is to `out`; whether every promise held and every control was caught.
  bool print(std::FILE* out) const;

  nlohmann::ordered_json to_json() const;

 private:
  using Rows = nlohmann::ordered_json;

  unsigned print_checks(std::FILE* out) const;
  unsigned print_controls(std::FILE* out) const;
  unsigned print_schedules(std::FILE* out) const;
  unsigned print_explored_controls(std::FILE* out) const;
  unsigned print_progress(std::FILE* out) const;
  unsigned print_progress_controls(std::FILE* out) const;

  std::uint64_t seed_;
  Rows checks_ = Rows::array();
  Rows controls_ = Rows::array();
  Rows schedules_ = Rows::array();
  Rows explored_controls_ = Rows::array();
  std::vector<std::string> exempt_;
  Rows progress_ = Rows::array();
  Rows progress_controls_ = Rows::array();
  std::vector<std::string> not_examined_;
};

}  // namespace icbench::stress
