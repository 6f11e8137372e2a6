#include "simulate/costs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace icbench {

double SizeCost::at(std::uint64_t records) const noexcept {
  const double place = std::log2(static_cast<double>(records) + 1.0) - 0.5;
  const double last = static_cast<double>(ns_.size() - 1);
  const double low = std::clamp(std::floor(place), 0.0, last);
  const double high = std::min(low + 1.0, last);
  const double part = std::clamp(place - low, 0.0, 1.0);
  return ns_[static_cast<std::size_t>(low)] * (1.0 - part) + ns_[static_cast<std::size_t>(high)] * part;
}

Spread Spread::of(std::vector<double> ratios) {
  constexpr std::size_t kFactors = 64;
  std::sort(ratios.begin(), ratios.end());
  const double sum = std::accumulate(ratios.begin(), ratios.end(), 0.0);
  if (ratios.size() < kFactors || !(sum > 0.0)) return Spread();
  const double mean = sum / static_cast<double>(ratios.size());
  std::vector<double> out;
  for (std::size_t k = 0; k < kFactors; ++k) {
    const auto first = ratios.begin() + static_cast<std::ptrdiff_t>(k * ratios.size() / kFactors);
    const auto last = ratios.begin() + static_cast<std::ptrdiff_t>((k + 1) * ratios.size() / kFactors);
    out.push_back(std::accumulate(first, last, 0.0) / static_cast<double>(last - first) / mean);
  }
  return Spread(std::move(out));
}

void CacheCosts::scale(double by) {
  operations.query.scale(by);
  operations.insert.scale(by);
  operations.valid_ns *= by;
  outside_query_ns *= by;
  outside_insert_ns *= by;
  trial_ns *= by;
  query_ns *= by;
  insert_ns *= by;
}

CacheCosts CacheCosts::by_themselves(double least_ns) const {
  CacheCosts out = *this;
  const auto alone = [&](double measured) { return measured > 0.0 ? std::max(measured, least_ns) : 0.0; };
  if (const double ns = alone(query_alone_ns); ns > 0.0 && ns < query_ns) {
    out.operations.query.scale(ns / query_ns);
    out.operations.valid_ns *= ns / query_ns;
    out.outside_query_ns += query_ns - ns;
    out.query_ns = ns;
  }
  if (const double ns = alone(insert_alone_ns); ns > 0.0 && ns < insert_ns) {
    out.operations.insert.scale(ns / insert_ns);
    out.outside_insert_ns += insert_ns - ns;
    out.insert_ns = ns;
  }
  return out;
}

nlohmann::ordered_json CacheCosts::to_json() const {
  return {{"query_ns", operations.query.ns()},
          {"insert_ns", operations.insert.ns()},
          {"query_spread", operations.query_spread.factors()},
          {"insert_spread", operations.insert_spread.factors()},
          {"valid_ns", operations.valid_ns},
          {"fresh_ns", operations.fresh_ns},
          {"outside_query_ns", outside_query_ns},
          {"outside_insert_ns", outside_insert_ns},
          {"merge_record_ns", merge_record_ns},
          {"trial_ns", trial_ns},
          {"query_mean_ns", query_ns},
          {"insert_mean_ns", insert_ns},
          {"query_alone_ns", query_alone_ns},
          {"insert_alone_ns", insert_alone_ns}};
}

CacheCosts CacheCosts::from_json(const nlohmann::ordered_json& all) {
  using Value = nlohmann::ordered_json;
  const auto field = [](const Value& j, const char* name) -> const Value& {
    if (!j.is_object() || !j.contains(name)) throw std::runtime_error(fmt::format("there is no '{}'", name));
    return j[name];
  };
  const auto number = [](const Value& value) {
    if (!value.is_number() || !(value.get<double>() >= 0.0))
      throw std::runtime_error("a cost is no number >= 0");
    return value.get<double>();
  };
  const auto numbers = [&](const char* name) {
    std::vector<double> out;
    for (const auto& value : field(all, name)) out.push_back(number(value));
    if (out.empty()) throw std::runtime_error(fmt::format("'{}' is empty", name));
    return out;
  };
  CacheCosts out;
  out.operations = {SizeCost(numbers("query_ns")),   SizeCost(numbers("insert_ns")),
                    Spread(numbers("query_spread")), Spread(numbers("insert_spread")),
                    number(field(all, "valid_ns")),  number(field(all, "fresh_ns"))};
  out.outside_query_ns = number(field(all, "outside_query_ns"));
  out.outside_insert_ns = number(field(all, "outside_insert_ns"));
  out.merge_record_ns = number(field(all, "merge_record_ns"));
  out.trial_ns = number(field(all, "trial_ns"));
  out.query_ns = number(field(all, "query_mean_ns"));
  out.insert_ns = number(field(all, "insert_mean_ns"));
  out.query_alone_ns = number(field(all, "query_alone_ns"));
  out.insert_alone_ns = number(field(all, "insert_alone_ns"));
  return out;
}

}  // namespace icbench
