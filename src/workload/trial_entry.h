// Rows of results from what trials gave: the fields that several commands write.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "harness/results.h"
#include "workload/dispatch.h"
#include "workload/ray_traced_plan.h"
#include "workload/spec.h"
#include "workload/trace_plan.h"

namespace icbench {

/// A trial that broke the cache's contract: the cache is at fault, not the user.
struct InvalidTrial : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// An entry with the name and the times of a trial, and nothing else yet.
Entry entry_of(std::string name, unsigned repetitions, unsigned repetition, unsigned threads,
               const TrialOutcome& o);

/// What was measured: the cache, null where there is none, and the workload.
void add_subject(nlohmann::ordered_json& out, const CacheEntry* cache, const WorkloadSpec& spec);

/// What was asked of the cache, and what its structure and its locks did.
void add_counts(nlohmann::ordered_json& out, const TrialOutcome& o, unsigned threads);

/// Percentiles of a histogram of ticks as fields "latency_OPERATION_pNN_ns", ..., "latency_OPERATION_max_ns"; none of
/// an empty one.
void add_latency(nlohmann::ordered_json& out, std::string_view operation, const Histogram& h,
                 const TickRate& rate);

/// Where all time of a trial went, as shares of wall time x threads, and what the hardware counted.
void add_breakdown(nlohmann::ordered_json& out, const TimeBreakdown& time, double redundant_records,
                   std::span<const ThreadAccount> accounts);

// What is told of workloads of one kind.
void add_synthetic(nlohmann::ordered_json& out, const WorkloadSpec& spec);
void add_ray_traced(nlohmann::ordered_json& out, const WorkloadSpec& spec, const Reference& reference,
                    const TrialOutcome& o);
void add_trace(nlohmann::ordered_json& out, const WorkloadSpec& spec, const Trace& trace,
               const TrialOutcome& o);

}  // namespace icbench
