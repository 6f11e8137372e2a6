// icbench compare, also without the rest of the program.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace icbench {

/// Registers the subcommand; its callback throws std::runtime_error with one line.
void add_compare(CLI::App& app);

/// Runs it with the arguments that follow its name. Throws std::runtime_error with one line.
void run_compare(std::vector<std::string> arguments);

}  // namespace icbench
