// The subcommands of the icbench program: one file each, one entry each in main.cpp.
//
// add_NAME registers the subcommand; its callback does the work. A callback reports bad usage or input by
// throwing std::runtime_error with one line (exit status 2), a failed check by CheckFailed (exit status 1).
#pragma once

#include <CLI/CLI.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace icbench {

/// A check that failed although the usage was right: a cache that broke its promise.
struct CheckFailed : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The program's arguments, for the results' environment record.
const std::vector<std::string>& command_line();

void add_animate(CLI::App& app);
void add_list(CLI::App& app);
void add_pareto(CLI::App& app);
void add_preempt(CLI::App& app);
void add_render(CLI::App& app);
void add_repeatability(CLI::App& app);
void add_simulate(CLI::App& app);
void add_sweep(CLI::App& app);
void add_trace(CLI::App& app);

}  // namespace icbench
