// The `icbench` program.
#include <fmt/format.h>

#include <cstdio>

#include "cli/command.h"
#include "core/names.h"

namespace icbench {
namespace {

std::vector<std::string> g_command_line;

/// One line for arguments nobody knows, with the nearest option or subcommand offered.
std::string unexpected(const CLI::App& app, const std::string& argument) {
  const CLI::App* at = app.get_subcommands().empty() ? &app : app.get_subcommands().front();
  std::vector<std::string> names;
  if (argument.starts_with('-')) {
    for (const CLI::Option* option : at->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
    const std::vector<std::string_view> views(names.begin(), names.end());
    return unknown_name("option", argument.substr(0, argument.find('=')), views);
  }
  if (at != &app)
    return fmt::format("unexpected argument '{}'; see icbench {} --help", argument, at->get_name());
  for (const CLI::App* subcommand : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(subcommand->get_name());
  }
  const std::vector<std::string_view> views(names.begin(), names.end());
  return unknown_name("command", argument, views);
}

int report(const std::string& line, int status) {
  fmt::print(stderr, "icbench: {}\n", line);
  return status;
}

}  // namespace

const std::vector<std::string>& command_line() { return g_command_line; }

int run(int argc, char** argv) {
  g_command_line.assign(argv, argv + argc);
  CLI::App app{"icbench: a research benchmark suite for shared irradiance caches", "icbench"};
  app.require_subcommand(0, 1);
  app.fallthrough(false);
  add_list(app);
  add_sweep(app);
  add_render(app);
  add_compare(app);
  for (CLI::App* subcommand : app.get_subcommands([](const CLI::App*) { return true; })) {
    subcommand->allow_extras();
  }
  app.allow_extras();
  // Extras are collected, not thrown, so that they can be reported with the nearest match; callbacks must not
  // run then.
  for (CLI::App* subcommand : app.get_subcommands([](const CLI::App*) { return true; })) {
    subcommand->parse_complete_callback([&app, subcommand] {
      const auto extras = subcommand->remaining();
      if (!extras.empty()) throw std::runtime_error(unexpected(app, extras.front()));
    });
  }
  try {
    app.parse(argc, argv);
    const auto extras = app.remaining();
    if (!extras.empty()) return report(unexpected(app, extras.front()), 2);
    if (app.get_subcommands().empty()) {
      fmt::print(stderr, "{}", app.help());
      return 2;
    }
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
      return report("cannot write to standard output", 2);
    return 0;
  } catch (const CLI::Success& e) {
    return app.exit(e);
  } catch (const CLI::ParseError& e) {
    return report(e.what(), 2);
  } catch (const CheckFailed& e) {
    return report(e.what(), 1);
  } catch (const std::bad_alloc&) {
    return report("out of memory; ask for a smaller size, fewer records or fewer threads", 2);
  } catch (const std::exception& e) {
    return report(e.what(), 2);
  }
}

}  // namespace icbench

int main(int argc, char** argv) { return icbench::run(argc, argv); }
