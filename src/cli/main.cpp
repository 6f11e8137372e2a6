// The `icbench` program.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdio>

#include "cli/command.h"
#include "cli/compare.h"
#include "cli/options.h"
#include "core/names.h"
#include "files/output_file.h"
#include "files/standard_streams.h"
#include "harness/build_info.h"

namespace icbench {
namespace {

std::vector<std::string> g_command_line;

/// One line for an argument that `at`, the program or one of its subcommands, does not know, with the nearest
/// option or subcommand offered.
std::string unexpected(const CLI::App& at, const std::string& argument) {
  std::vector<std::string> names;
  if (argument.starts_with('-')) {
    for (const CLI::Option* option : at.get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back(fmt::format("--{}", name));
    }
    const std::vector<std::string_view> views(names.begin(), names.end());
    return unknown_name("option", argument.substr(0, argument.find('=')), views);
  }
  const auto commands = at.get_subcommands([](const CLI::App*) { return true; });
  if (commands.empty()) {
    std::string command;
    for (const CLI::App* app = &at; app != nullptr; app = app->get_parent())
      command = fmt::format("{} {}", app->get_name(), command);
    return fmt::format("unexpected argument '{}'; see {}--help", argument, command);
  }
  for (const CLI::App* subcommand : commands) names.push_back(subcommand->get_name());
  const std::vector<std::string_view> views(names.begin(), names.end());
  return unknown_name("command", argument, views);
}

/// Calls f(command, commands above it and itself) for every command below `at`.
template <class F>
void for_each_command(CLI::App& at, std::vector<CLI::App*> above, F&& f) {
  above.push_back(&at);
  for (CLI::App* command : at.get_subcommands([](const CLI::App*) { return true; })) {
    for_each_command(*command, above, f);
    std::vector<CLI::App*> line = above;
    line.push_back(command);
    f(*command, line);
  }
}

/// Prints the one line that a failed run ends with, whatever the arguments that it quotes contain.
int report(std::string line, int status) {
  std::replace_if(
      line.begin(), line.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
  tell("icbench: {}\n", line);
  return status;
}

std::string version() {
  const BuildInfo build = build_info();
  return fmt::format("icbench {}, commit {}{}, {}, {} build", ICBENCH_VERSION, build.commit.substr(0, 12),
                     build.dirty ? " with changes" : "", build.compiler, build.build_type);
}

}  // namespace

const std::vector<std::string>& command_line() { return g_command_line; }

int run(int argc, char** argv) {
  g_command_line.assign(argv, argv + argc);
  CLI::App app{"icbench: a research benchmark suite for shared irradiance caches", "icbench"};
  app.set_version_flag("--version", version, "Print version, commit and compiler and exit");
  app.set_help_flag("-h,--help", "Print help and exit");
  app.require_subcommand(0, 1);
  app.fallthrough(false);
  add_list(app);
  add_sweep(app);
  add_simulate(app);
  add_render(app);
  add_animate(app);
  add_compare(app);
  add_pareto(app);
  add_preempt(app);
  add_repeatability(app);
  add_trace(app);
  app.footer(
      "Exit status: 0 done, 1 a check failed, 2 bad usage or input (one line on standard error).\n"
      "An option that has no effect on what is asked for is named there, too, and the status stays 0.\n"
      "icbench COMMAND --help lists a command's options, all of which have defaults.");
  app.allow_extras();
  // Extras are collected, not thrown, so that they can be reported with the nearest match; callbacks must not
  // run then.
  for_each_command(app, {}, [](CLI::App& command, const std::vector<CLI::App*>& line) {
    command.allow_extras();
    command.parse_complete_callback([line] {
      for (const CLI::App* at : line) {
        const auto extras = at->remaining();
        if (!extras.empty()) throw std::runtime_error(unexpected(*at, extras.front()));
      }
    });
  });
  try {
    app.parse(argc, argv);
    const auto extras = app.remaining();
    if (!extras.empty()) return report(unexpected(app, extras.front()), 2);
    if (app.get_subcommands().empty()) {
      std::fputs(app.help().c_str(), stderr);
      return 2;
    }
    return status_of_output("icbench", 0);
  } catch (const CLI::Success& e) {
    return status_of_output("icbench", app.exit(e));
  } catch (const CLI::ParseError& e) {
    std::string commands;
    for (auto at = app.get_subcommands(); !at.empty(); at = at[0]->get_subcommands())
      commands += at[0]->get_name() + " ";
    return report(fmt::format("{}; see icbench {}--help", line_of(e), commands), 2);
  } catch (const CheckFailed& e) {
    return report(e.what(), 1);
  } catch (const std::bad_alloc&) {
    return report("out of memory; ask for a smaller size, fewer records or fewer threads", 2);
  } catch (const std::exception& e) {
    return report(e.what(), 2);
  }
}

}  // namespace icbench

int main(int argc, char** argv) {
  icbench::occupy_standard_streams();
  icbench::survive_file_size_limits();
  return icbench::run(argc, argv);
}
