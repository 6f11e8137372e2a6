#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <limits>
#include <thread>

#include "harness/environment.h"
#include "harness/results.h"
#include "harness_results_fixture.h"

namespace icbench::testing {
namespace {

/// One line that names `what`.
void expect_error(const std::string& text, const std::string& what) {
  EXPECT_NE(text.find(what), text.npos) << "error: '" << text << "'";
  EXPECT_EQ(text.find('\n'), text.npos) << text;
}

void write_run(const fs::path& path, unsigned n, bool finish, OnExisting on_existing = OnExisting::replace) {
  ResultsWriter out(path, context(), configuration(), on_existing);
  for (unsigned i = 0; i < n; ++i)
    if (!out.is_completed(entry(i).name, entry(i).repetition_index)) out.add(entry(i));
  if (finish) out.finish();
}

TEST(Results, AFinishedFileHoldsContextAndEntriesAndNothingLiesBeside) {
  const TemporaryDirectory dir;
  write_run(dir / "r.json", 50, true);
  const Json r = load(dir / "r.json");
  EXPECT_EQ(r.begin().key(), "context");
  EXPECT_EQ(r["context"]["complete"], true);
  EXPECT_EQ(r["context"]["host_name"], "here");
  EXPECT_EQ(r["context"]["configuration"], configuration());
  EXPECT_EQ(serials(r), first(50));
  EXPECT_EQ(r["benchmarks"][4]["real_time"], 5.5);
  EXPECT_EQ(r["benchmarks"][4]["iterations"], 1);
  EXPECT_EQ(dir.entries(), 1u);
}

TEST(Results, TheFileExistsAndSaysIncompleteFromTheStart) {
  const TemporaryDirectory dir;
  ResultsWriter out(dir / "r.json", context(), configuration());
  EXPECT_EQ(load(dir / "r.json")["context"]["complete"], false);
  EXPECT_EQ(load(dir / "r.json")["context"]["host_name"], "here");
}

TEST(Results, AnEntryIsOnDiskWhenAddReturns) {
  const TemporaryDirectory dir;
  ResultsWriter out(dir / "r.json", context(), configuration());
  for (unsigned i = 0; i < 40; ++i) {
    out.add(entry(i));
    std::map<unsigned, int> found = serials(load(dir / "r.json"));
    const std::string journal = text_of(journal_of(dir / "r.json"));
    EXPECT_TRUE(found.contains(i) || journal.find(fmt::format("\"serial\":{}}}", i)) != journal.npos) << i;
  }
}

TEST(Results, AnUnfinishedRunKeepsItsEntriesMarkedIncomplete) {
  const TemporaryDirectory dir;
  write_run(dir / "r.json", 5, false);
  EXPECT_EQ(load(dir / "r.json")["context"]["complete"], false);
  EXPECT_EQ(serials(load(dir / "r.json")), first(5));
}

TEST(Results, ResumingTakesUpWhereItStopped) {
  const TemporaryDirectory dir;
  write_run(dir / "r.json", 20, false);
  {
    ResultsWriter out(dir / "r.json", context(), configuration(), OnExisting::resume);
    EXPECT_EQ(out.completed().size(), 20u);
  }
  write_run(dir / "r.json", 45, true, OnExisting::resume);
  const Json r = load(dir / "r.json");
  EXPECT_EQ(serials(r), first(45));
  EXPECT_EQ(r["context"]["complete"], true);
  EXPECT_EQ(r["context"]["resumed"].size(), 2u);
  EXPECT_EQ(r["context"]["resumed"][0]["entries"], 20);
  EXPECT_EQ(dir.entries(), 1u);
  const ResultsWriter again(dir / "r.json", context(), configuration(), OnExisting::resume);
  EXPECT_EQ(Json(again.rows()), r["benchmarks"]) << "those that the runs before this one have added";
}

TEST(Results, ResumingNeedsOnlyTheFileOrOnlyTheJournal) {
  const TemporaryDirectory dir;
  for (const bool keep_file : {true, false}) {
    write_run(dir / "r.json", 20, false);
    fs::remove(keep_file ? journal_of(dir / "r.json") : dir / "r.json");
    write_run(dir / "r.json", 25, true, OnExisting::resume);
    EXPECT_EQ(serials(load(dir / "r.json")), first(25)) << keep_file;
    EXPECT_EQ(load(dir / "r.json")["context"]["host_name"], "here");
  }
}

TEST(Results, ResumingAFinishedFileAddsNothing) {
  const TemporaryDirectory dir;
  write_run(dir / "r.json", 9, true);
  write_run(dir / "r.json", 9, true, OnExisting::resume);
  EXPECT_EQ(serials(load(dir / "r.json")), first(9));
}

TEST(Results, ResumingNothingOrAnEmptyFileIsANewRun) {
  const TemporaryDirectory dir;
  write_text(dir / "empty.json", "");
  for (const char* name : {"none.json", "empty.json"}) {
    write_run(dir / name, 4, true, OnExisting::resume);
    EXPECT_EQ(serials(load(dir / name)), first(4));
    EXPECT_FALSE(load(dir / name)["context"].contains("resumed"));
  }
}

TEST(Results, ReplacingForgetsAnEarlierRunAndItsJournal) {
  const TemporaryDirectory dir;
  write_run(dir / "r.json", 30, false);
  write_run(dir / "r.json", 2, true);
  EXPECT_EQ(serials(load(dir / "r.json")), first(2));
  EXPECT_EQ(dir.entries(), 1u);
}

TEST(Results, AJournalTornAnywhereInItsLastLineLosesOnlyThat) {
  const TemporaryDirectory dir;
  write_run(dir / "r.json", 6, false);
  const std::string whole = text_of(journal_of(dir / "r.json"));
  const std::size_t last_line = whole.rfind('\n', whole.size() - 2) + 1;
  for (std::size_t cut = last_line; cut < whole.size(); ++cut) {
    fs::remove(dir / "r.json");
    write_text(journal_of(dir / "r.json"), whole.substr(0, cut));
    ResultsWriter out(dir / "r.json", context(), configuration(), OnExisting::resume);
    ASSERT_EQ(out.completed().size(), 5u) << cut;
    out.add(entry(5));
    // What was torn is gone from the journal: the next line did not join it.
    const std::string mended = text_of(journal_of(dir / "r.json"));
    ASSERT_EQ(mended.substr(0, last_line), whole.substr(0, last_line)) << cut;
    ASSERT_TRUE(Json::accept(mended.substr(last_line))) << cut;
    out.finish();
    ASSERT_EQ(serials(load(dir / "r.json")), first(6)) << cut;
  }
}

TEST(Results, AJournalTornInItsHeaderIsAsGoodAsNone) {
  const TemporaryDirectory dir;
  write_run(dir / "r.json", 3, false);
  write_text(journal_of(dir / "r.json"), text_of(journal_of(dir / "r.json")).substr(0, 20));
  write_run(dir / "r.json", 8, true, OnExisting::resume);
  EXPECT_EQ(serials(load(dir / "r.json")), first(8));
}

TEST(Results, AJournalDamagedInTheMiddleIsRefusedWithPathAndByte) {
  const TemporaryDirectory dir;
  write_run(dir / "r.json", 6, false);
  std::string journal = text_of(journal_of(dir / "r.json"));
  const std::size_t second_line = journal.find('\n') + 1;
  journal[second_line] = '#';
  write_text(journal_of(dir / "r.json"), journal);
  const std::string error =
      error_of([&] { ResultsWriter(dir / "r.json", context(), configuration(), OnExisting::resume); });
  expect_error(error, journal_of(dir / "r.json").string());
  expect_error(error, fmt::format("byte {}", second_line + 1));
  EXPECT_EQ(text_of(journal_of(dir / "r.json")), journal);
}

TEST(Results, DamagedFilesAreRefusedAndLeftAlone) {
  const TemporaryDirectory dir;
  write_run(dir / "good.json", 3, true);
  const std::string whole = text_of(dir / "good.json");
  const std::vector<std::pair<std::string, std::string>> cases{
      {whole.substr(0, whole.size() / 2), "byte"},
      {"{\"context\": #}", "byte 13"},
      {"{\"context\": {\"seed\": 9e999}, \"benchmarks\": []}", "too large"},
      {"[]", "no results file"},
      {"{\"context\": {}}", "no results file"},
      {"{\"context\": {}, \"benchmarks\": []}", "no configuration"},
      {"{\"context\": {\"configuration\": 3}, \"benchmarks\": []}", "no configuration"}};
  for (const auto& [text, what] : cases) {
    write_text(dir / "r.json", text);
    const std::string error =
        error_of([&] { ResultsWriter(dir / "r.json", context(), configuration(), OnExisting::resume); });
    expect_error(error, what);
    expect_error(error, (dir / "r.json").string());
    EXPECT_EQ(text_of(dir / "r.json"), text);
    EXPECT_FALSE(fs::exists(journal_of(dir / "r.json")));
  }
}

TEST(Results, AnEntryWithoutKeyIsRefused) {
  const TemporaryDirectory dir;
  write_run(dir / "r.json", 2, true);
  Json r = load(dir / "r.json");
  r["benchmarks"][1].erase("repetition_index");
  write_text(dir / "r.json", r.dump());
  expect_error(
      error_of([&] { ResultsWriter(dir / "r.json", context(), configuration(), OnExisting::resume); }),
      "repetition_index");
}

TEST(Results, EntriesWithoutATimeOrWithAnIndexBeyondAllAreRefused) {
  const TemporaryDirectory dir;
  write_run(dir / "r.json", 2, true);
  const Json whole = load(dir / "r.json");
  Json untimed = whole, far = whole;
  untimed["benchmarks"][1].erase("real_time");
  far["benchmarks"][1]["repetition_index"] = std::uint64_t{1} << 32;
  for (const Json& damaged : {untimed, far}) {
    write_text(dir / "r.json", damaged.dump());
    expect_error(
        error_of([&] { ResultsWriter(dir / "r.json", context(), configuration(), OnExisting::resume); }),
        "real_time");
  }
}

TEST(Results, AnotherConfigurationIsRefusedByItsFirstDifferingKey) {
  const TemporaryDirectory dir;
  write_run(dir / "r.json", 3, false);
  Json other = configuration();
  other["workload"]["records"] = 200;
  other["zeta"] = 1;
  const std::string error =
      error_of([&] { ResultsWriter(dir / "r.json", context(), other, OnExisting::resume); });
  expect_error(error, "workload.records is 100 there and 200 now");
  EXPECT_EQ(serials(load(dir / "r.json")), first(3));

  other = configuration();
  other.erase("threads");
  expect_error(error_of([&] { ResultsWriter(dir / "r.json", context(), other, OnExisting::resume); }),
               "threads is [1,2] there and nothing now");

  // Where lists are long, what differs may stand far behind.
  other = configuration();
  other["threads"] = {1, 2, std::string(60, 'a'), 3};
  expect_error(error_of([&] { ResultsWriter(dir / "r.json", context(), other, OnExisting::resume); }),
               "threads[2] is nothing there and \"aaa");
}

TEST(Results, OrderOfKeysAndNotationOfNumbersDoNotMakeAnotherConfiguration) {
  const TemporaryDirectory dir;
  Json a{{"x", 1}, {"y", std::nan("")}, {"z", 0.1f}}, b{{"z", 0.1f}, {"y", std::nan("")}, {"x", 1u}};
  ResultsWriter(dir / "r.json", context(), a).finish();
  EXPECT_EQ(error_of([&] { ResultsWriter(dir / "r.json", context(), b, OnExisting::resume); }), "");
}

TEST(Results, UnusableEntriesAreErrorsAndLeaveNoTrace) {
  const TemporaryDirectory dir;
  ResultsWriter out(dir / "r.json", context(), configuration());
  const auto add = [&](auto&& change) {
    Entry e = entry(0);
    change(e);
    return error_of([&] { out.add(e); });
  };
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  expect_error(add([](Entry& e) { e.name.clear(); }), "name");
  expect_error(add([](Entry& e) { e.real_time = kNaN; }), "finite");
  expect_error(add([](Entry& e) { e.cpu_time = std::numeric_limits<double>::infinity(); }), "finite");
  expect_error(add([](Entry& e) { e.real_time = -1.0; }), "negative");
  expect_error(add([](Entry& e) { e.time_unit = "h"; }), "unit");
  expect_error(add([](Entry& e) { e.counters["threads"] = 4; }), "threads");
  EXPECT_EQ(add([](Entry&) {}), "");
  expect_error(add([](Entry&) {}), "there already");
  out.finish();
  EXPECT_EQ(serials(load(dir / "r.json")), first(1));
}

TEST(Results, CountersOfAnyKindAreWritten) {
  const TemporaryDirectory dir;
  ResultsWriter out(dir / "r.json", context(), configuration());
  Entry e = entry(0);
  e.items_per_second = 1e9;
  e.counters["cache"] = "bad utf-8 \xff";
  e.counters["oversubscribed"] = true;
  e.counters["undefined"] = std::nan("");
  e.counters["large"] = std::numeric_limits<std::uint64_t>::max();
  out.add(e);
  out.finish();
  const Json r = load(dir / "r.json")["benchmarks"][0];
  EXPECT_EQ(r["items_per_second"], 1e9);
  EXPECT_EQ(r["oversubscribed"], true);
  EXPECT_TRUE(r["undefined"].is_null());
  EXPECT_EQ(r["large"], std::numeric_limits<std::uint64_t>::max());
}

TEST(Results, TwoWritersOfOneFileAreRefused) {
  const TemporaryDirectory dir;
  ResultsWriter one(dir / "r.json", context(), configuration());
  one.add(entry(0));
  for (const OnExisting mode : {OnExisting::replace, OnExisting::resume})
    expect_error(error_of([&] { ResultsWriter(dir / "r.json", context(), configuration(), mode); }),
                 "another process");
  one.finish();
  EXPECT_EQ(serials(load(dir / "r.json")), first(1));
}

TEST(Results, UnusableTargetsAreRefusedAtTheStart) {
  const TemporaryDirectory dir;
  const auto open = [&](const fs::path& path) {
    return error_of([&] { ResultsWriter(path, context(), configuration()); });
  };
  expect_error(open(dir / "missing" / "r.json"), "create the directory");
  expect_error(open(dir / "."), "directory");
  expect_error(open(""), "--out");
  write_text(dir / "file", "x");
  expect_error(open(dir / "file" / "r.json"), "cannot write");
  EXPECT_EQ(dir.entries(), 1u);
}

TEST(Results, AFullDeviceIsRefusedAtTheStart) {
  expect_error(error_of([] { ResultsWriter("/dev/full", context(), configuration()); }), "No space left");
}

TEST(Results, ADeviceCannotBeResumed) {
  expect_error(error_of([] { ResultsWriter("/dev/null", context(), configuration(), OnExisting::resume); }),
               "regular file");
}

TEST(Results, ASymbolicLinkIsFollowedAndKept) {
  const TemporaryDirectory dir;
  write_text(dir / "target.json", "");
  fs::create_symlink("target.json", dir / "link.json");
  write_run(dir / "link.json", 3, true);
  EXPECT_TRUE(fs::is_symlink(dir / "link.json"));
  EXPECT_EQ(serials(load(dir / "target.json")), first(3));
}

TEST(Results, APipeGetsTheWholeFileAndIsValidOnlyWhenFinished) {
  const TemporaryDirectory dir;
  for (const bool finish : {true, false}) {
    const fs::path fifo = dir / (finish ? "a" : "b");
    ASSERT_EQ(mkfifo(fifo.c_str(), 0600), 0);
    std::string text;
    std::thread reader([&] { text = text_of(fifo); });
    write_run(fifo, 7, finish);
    reader.join();
    EXPECT_EQ(Json::accept(text), finish);
    if (finish) {
      EXPECT_EQ(serials(Json::parse(text)), first(7));
    }
  }
  EXPECT_EQ(dir.entries(), 2u);
}

TEST(Results, ANamedDescriptorContinuesAtItsPosition) {
  const TemporaryDirectory dir;
  const int fd = open((dir / "out").c_str(), O_WRONLY | O_CREAT, 0600);
  ASSERT_EQ(write(fd, "before\n", 7), 7);
  write_run(fmt::format("/dev/fd/{}", fd), 2, true);
  close(fd);
  const std::string text = text_of(dir / "out");
  ASSERT_TRUE(text.starts_with("before\n"));
  EXPECT_EQ(serials(Json::parse(text.substr(7))), first(2));
}

TEST(Results, WhenSpaceRunsOutWhatWasAddedIsStillThere) {
  const TemporaryDirectory dir;
  const fs::path path = dir / "r.json";
  const pid_t child = fork();
  if (child == 0) {
    // A limit on the size of files stands in for a full disk: writes become short, then fail.
    signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{6000, 6000};
    setrlimit(RLIMIT_FSIZE, &limit);
    unsigned added = 0;
    try {
      ResultsWriter out(path, context(), configuration());
      for (; added < 200; ++added) out.add(entry(added));
    } catch (const std::runtime_error&) {
      _exit(static_cast<int>(added));
    }
    _exit(255);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFEXITED(status));
  const auto added = static_cast<unsigned>(WEXITSTATUS(status));
  ASSERT_GT(added, 0u);
  ASSERT_LT(added, 200u) << "the limit was never reached";
  EXPECT_EQ(load(path)["context"]["complete"], false);
  ResultsWriter out(path, context(), configuration(), OnExisting::resume);
  // The entry whose add failed may be safe all the same (its line was written, folding it failed).
  EXPECT_GE(out.completed().size(), added);
  EXPECT_LE(out.completed().size(), added + 1);
  for (unsigned i = 0; i < added; ++i)
    EXPECT_TRUE(out.is_completed(entry(i).name, entry(i).repetition_index)) << i;
}

TEST(Results, ManyEntriesAreFoldedALogarithmicNumberOfTimes) {
  // Each fold replaces the file, so its inode changes; entries written in all folds together stay below 3 n.
  const TemporaryDirectory dir;
  ResultsWriter out(dir / "r.json", context(), configuration());
  ino_t inode = 0;
  int folds = 0;
  for (unsigned i = 0; i < 1000; ++i) {
    out.add(entry(i));
    struct stat status {};
    ASSERT_EQ(stat((dir / "r.json").c_str(), &status), 0);
    folds += status.st_ino != inode ? 1 : 0;
    inode = status.st_ino;
  }
  EXPECT_LE(folds, 10);
  out.finish();
  EXPECT_EQ(serials(load(dir / "r.json")), first(1000));
}

TEST(Results, GoogleBenchmarksReadersFindWhatTheyNeed) {
  const TemporaryDirectory dir;
  const Topology topology = Topology::of_this_process();
  ResultsWriter out(dir / "r.json", environment(topology, {{"icbench"}, 1, Placement::compact, {1, 2, 64}}),
                    configuration());
  for (unsigned i = 0; i < 6; ++i) out.add(entry(i));
  out.finish();
  const std::string command = fmt::format("python3 {} {}", ICBENCH_FORMAT_CHECK, (dir / "r.json").string());
  EXPECT_EQ(std::system(command.c_str()), 0);
}

}  // namespace
}  // namespace icbench::testing
