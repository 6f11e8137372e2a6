// The icstress program from outside: exit statuses, messages, JSON.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "temporary_folder.h"

namespace icbench {
namespace {

struct Outcome {
  int status;
  std::string errors;
};

/// Runs icstress; its standard output goes nowhere.
Outcome icstress(const std::string& arguments) {
  const std::string command = std::string(ICSTRESS) + " " + arguments + " 2>&1 >/dev/null";
  std::FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return {-1, "popen failed"};
  std::string errors;
  std::array<char, 4096> chunk;
  while (const std::size_t n = std::fread(chunk.data(), 1, chunk.size(), pipe))
    errors.append(chunk.data(), n);
  const int status = ::pclose(pipe);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, errors};
}

void expect_bad_usage(const std::string& arguments, const std::string& hint) {
  const Outcome outcome = icstress(arguments);
  EXPECT_EQ(outcome.status, 2) << arguments;
  EXPECT_EQ(std::count(outcome.errors.begin(), outcome.errors.end(), '\n'), 1) << outcome.errors;
  EXPECT_NE(outcome.errors.find(hint), std::string::npos) << outcome.errors;
}

TEST(StressProgram, BadUsageIsOneLineWithTheNearestMatch) {
  expect_bad_usage("--caches wait_fre", "did you mean 'wait_free'");
  expect_bad_usage("--caches wait_free,", "has an empty item");
  expect_bad_usage("--caches wait_free,wait_free", "--caches names wait_free twice");
  expect_bad_usage("--check linearizible", "did you mean 'linearizable'");
  expect_bad_usage("--thread 4", "did you mean '--threads'");
  expect_bad_usage("--threads 1", "--threads");
  expect_bad_usage("--threads", "--threads needs a value");
  expect_bad_usage("--threads 2 --threads 3", "--threads is given more than once");
  expect_bad_usage("--threads many", "--threads");
  expect_bad_usage("--threads 0x10", "--threads");
  expect_bad_usage("--operations 0", "--operations");
  expect_bad_usage("--seed -1", "--seed");
  expect_bad_usage("--json /nonexistent/x.json", "/nonexistent/x.json");
  expect_bad_usage("--json /", "folder");
  expect_bad_usage("--json ''", "names no file");
  expect_bad_usage("wait_free", "unexpected argument");
  expect_bad_usage("--explore much", "--explore");
  expect_bad_usage("--preemptions -1", "--preemptions");
  expect_bad_usage("--replay wait_fre:install:stamped:0", "did you mean 'wait_free'");
}

TEST(StressProgram, PreemptionsWithoutSchedulesAreNamed) {
  const std::string brief =
      "--caches wait_free --operations 20000 --threads 3 --seed 5 --explore off --progress off";
  const std::string line = "icstress: --preemptions has no effect with --explore off\n";
  for (const bool is_given : {true, false}) {
    const Outcome outcome = icstress(brief + (is_given ? " --preemptions 2" : ""));
    EXPECT_EQ(outcome.status, 0) << outcome.errors;
    EXPECT_EQ(outcome.errors.find(line) != std::string::npos, is_given) << outcome.errors;
  }
}

TEST(StressProgram, ReportsEveryCheckAndControl) {
  const TemporaryFolder folder;
  const std::string file = (folder / "verdicts.json").string();
  const Outcome outcome =
      icstress("--caches wait_free,global_mutex --operations 20000 --threads 3 --seed 5 --json " + file);
  ASSERT_EQ(outcome.status, 0) << outcome.errors;
  std::ifstream in(file);
  const nlohmann::json results = nlohmann::json::parse(in);
  std::map<std::pair<std::string, std::string>, nlohmann::json> rows;
  for (const auto& row : results.at("checks")) rows[{row.at("cache"), row.at("check")}] = row;
  EXPECT_EQ(rows.size(), 10u);
  for (const auto& [key, row] : rows) {
    EXPECT_GE(row.at("operations").get<std::uint64_t>(), 20'000u);
    EXPECT_GT(row.at("concurrent_pairs").get<std::uint64_t>(), 0u);
    EXPECT_EQ(row.at("seed"), 5);
    const bool violated = row.at("verdict") == "violated";
    EXPECT_EQ(violated, row.at("violations").get<std::uint64_t>() > 0);
    EXPECT_EQ(violated, !row.at("witness").get<std::string>().empty());
    EXPECT_FALSE(violated && row.at("promised").get<bool>());
  }
  EXPECT_TRUE((rows[{"global_mutex", "linearizable"}].at("promised").get<bool>()));
  EXPECT_FALSE((rows[{"wait_free", "linearizable"}].at("promised").get<bool>()));
  EXPECT_TRUE((rows[{"wait_free", "per_record_linearizable"}].at("promised").get<bool>()));
  EXPECT_GE(results.at("controls").size(), 13u);
  for (const auto& control : results.at("controls")) {
    if (!control.at("required").get<bool>()) continue;
    EXPECT_TRUE(control.at("seen").get<bool>()) << control.at("control");
    EXPECT_FALSE(control.at("witness").get<std::string>().empty());
  }
  EXPECT_EQ(results.at("progress").size(), 6u);  // insert, query and query_batch of two caches
  for (const auto& row : results.at("progress")) EXPECT_EQ(row.at("verdict"), "holds") << row.at("cache");
  EXPECT_GE(results.at("progress_controls").size(), 8u);
  for (const auto& control : results.at("progress_controls"))
    EXPECT_TRUE(control.at("seen").get<bool>()) << control.at("control");
}

TEST(StressProgram, ReportsExploredSchedules) {
  const TemporaryFolder folder;
  const std::string file = (folder / "verdicts.json").string();
  const Outcome outcome =
      icstress("--caches wait_free --check integrity --operations 100 --progress off --json " + file);
  ASSERT_EQ(outcome.status, 0) << outcome.errors;
  std::ifstream in(file);
  const nlohmann::json results = nlohmann::json::parse(in);
  EXPECT_GE(results.at("schedules").size(), 20u);
  for (const auto& row : results.at("schedules")) {
    EXPECT_EQ(row.at("cache"), "wait_free");
    EXPECT_EQ(row.at("check"), "per_record_linearizable");
    EXPECT_EQ(row.at("verdict"), "holds");
    EXPECT_TRUE(row.at("complete").get<bool>());
    EXPECT_TRUE(row.at("preemptions").is_null());
    EXPECT_GE(row.at("threads").get<unsigned>(), 2u);
  }
  EXPECT_GE(results.at("explored_controls").size(), 13u);
  for (const auto& row : results.at("explored_controls")) {
    EXPECT_TRUE(row.at("caught").get<bool>()) << row.at("control");
    EXPECT_EQ(icstress("--replay " + row.at("replay").get<std::string>()).status, 1) << row.at("replay");
  }
  EXPECT_EQ(icstress("--replay wait_free:install:stamped:0").status, 0);
}

TEST(StressProgram, ReportsTheChecksAskedFor) {
  const TemporaryFolder folder;
  const std::string file = (folder / "verdicts.json").string();
  ASSERT_EQ(
      icstress("--caches null --check regular --operations 100 --explore off --progress off --json " + file)
          .status,
      0);
  std::ifstream in(file);
  const nlohmann::json results = nlohmann::json::parse(in);
  ASSERT_EQ(results.at("checks").size(), 1u);
  EXPECT_EQ(results.at("checks")[0].at("check"), "regular");
  for (const char* part : {"schedules", "explored_controls", "progress", "progress_controls"})
    EXPECT_FALSE(results.contains(part)) << part;
  const std::string left_out = results.at("not_examined").dump();
  EXPECT_NE(left_out.find("Histories for integrity, per_record_linearizable, linearizable, frame."),
            std::string::npos)
      << left_out;
  EXPECT_NE(left_out.find(" other caches."), std::string::npos) << left_out;
  EXPECT_FALSE(std::filesystem::exists(file + ".partial"));
}

TEST(StressProgram, AReplayNamesWhatHasNoEffect) {
  const Outcome outcome = icstress(
      "--replay wait_free:install:stamped:0 --threads 8 --operations 5 --seed 3 --explore off --preemptions "
      "1 "
      "--progress off");
  EXPECT_EQ(outcome.status, 0);
  for (const char* option :
       {"--threads", "--operations", "--seed", "--explore", "--preemptions", "--progress"}) {
    EXPECT_NE(outcome.errors.find(std::string(option) + " has no effect with --replay"), std::string::npos)
        << option;
  }
}

// Killed when the first verdicts are there, long before the schedules of the long form are through.
TEST(StressProgram, AKilledRunLeavesWhatHadEnded) {
  const TemporaryFolder folder;
  const std::string file = (folder / "verdicts.json").string();
  const std::string command =
      std::string(ICSTRESS) + " --caches packed_wait_free --operations 100 --explore long --json " + file +
      " >/dev/null 2>&1 & run=$!; until [ -e " + file +
      ".partial ]; do kill -0 $run || exit 1; done; kill -9 $run; wait $run; test $? = 137";
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_FALSE(std::filesystem::exists(file));
  std::ifstream in(file + ".partial");
  const nlohmann::json results = nlohmann::json::parse(in);
  EXPECT_EQ(results.at("checks").size(), 5u);
  EXPECT_NE(results.at("not_examined").back().get<std::string>().find("had not ended"), std::string::npos);
}

}  // namespace
}  // namespace icbench
