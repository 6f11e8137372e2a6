#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "harness/progress.h"

namespace icbench {
namespace {

double fake_time = 0.0;
double fake_now() { return fake_time; }

/// Captures what is printed.
class Capture {
 public:
  Capture() : file_(open_memstream(&text_, &size_)) {}
  ~Capture() {
    std::fclose(file_);
    std::free(text_);
  }
  std::FILE* file() { return file_; }
  std::string text() {
    std::fflush(file_);
    return {text_, size_};
  }

 private:
  char* text_ = nullptr;
  std::size_t size_ = 0;
  std::FILE* file_;
};

Progress::Options to(Capture& out, bool terminal) {
  fake_time = 0.0;
  return {out.file(), terminal, fake_now};
}

long lines(const std::string& text) { return std::count(text.begin(), text.end(), '\n'); }

TEST(Progress, EstimatesTheTimeLeftFromTheShareDone) {
  Capture out;
  Progress progress("sweep", 8, to(out, true));
  fake_time = 30.0;
  progress.advance(2, "wait_free");
  EXPECT_EQ(out.text(), "\r\033[Ksweep: 2/8 (25 %), 1:30 left, wait_free");
}

TEST(Progress, SkippedWorkDoesNotSpeedUpTheEstimate) {
  Capture out;
  Progress progress("sweep", 10, to(out, true));
  progress.skip(5);
  fake_time = 20.0;
  progress.advance(1);
  EXPECT_NE(out.text().find("6/10 (60 %), 1:20 left"), std::string::npos) << out.text();
}

TEST(Progress, WithoutATotalItTellsTheTimeTaken) {
  Capture out;
  Progress progress("load", 0, to(out, true));
  fake_time = 65.0;
  progress.advance(3);
  EXPECT_NE(out.text().find("load: 3 in 1:05"), std::string::npos) << out.text();
}

TEST(Progress, OverwritesOneLineOnATerminalAndEndsIt) {
  Capture out;
  Progress progress("render", 100, to(out, true));
  for (int i = 0; i < 100; ++i) {
    fake_time += 1.0;
    progress.advance(1);
  }
  EXPECT_EQ(lines(out.text()), 0);
  progress.finish();
  EXPECT_EQ(lines(out.text()), 1);
  EXPECT_TRUE(out.text().ends_with("\r\033[Krender: 100 done in 1:40\n")) << out.text();
}

TEST(Progress, PlainLinesGetRarerAndCarryNoControlCharacters) {
  Capture out;
  Progress progress("render", 3600, to(out, false));
  for (int i = 0; i < 3600; ++i) {
    fake_time += 1.0;
    progress.advance(1);
  }
  progress.finish();
  const std::string text = out.text();
  EXPECT_EQ(text.find('\r'), text.npos);
  EXPECT_EQ(text.find('\033'), text.npos);
  EXPECT_GE(lines(text), 3600 / 60);
  EXPECT_LE(lines(text), 3600 / 60 + 10);
}

TEST(Progress, ShortPlainWorkPrintsItsEndOnly) {
  Capture out;
  Progress progress("quick", 3, to(out, false));
  for (int i = 0; i < 3; ++i) progress.advance(1);
  progress.finish();
  EXPECT_EQ(out.text(), "quick: 3 done in 0:00\n");
}

TEST(Progress, FinishesOnlyOnce) {
  Capture out;
  Progress progress("x", 1, to(out, false));
  progress.finish();
  progress.finish();
  EXPECT_EQ(lines(out.text()), 1);
}

TEST(Progress, AnUnfinishedTerminalLineIsWiped) {
  Capture out;
  {
    Progress progress("x", 2, to(out, true));
    fake_time = 1.0;
    progress.advance(1);
  }
  EXPECT_TRUE(out.text().ends_with("\r\033[K")) << out.text();
}

TEST(Progress, NothingFollowsTheLineThatItEndsWith) {
  Capture out;
  {
    Progress progress("x", 2, to(out, true));
    fake_time = 1.0;
    progress.advance(1);
    progress.finish();
  }
  EXPECT_TRUE(out.text().ends_with(" done in 0:01\n")) << out.text();
}

TEST(Progress, LongNotesAreCutToTheLineBetweenCharacters) {
  Capture out;
  Progress progress("x", 2, to(out, true));
  fake_time = 1.0;
  std::string note;
  for (int i = 0; i < 100; ++i) note += "é";
  progress.advance(1, note);
  const std::string line = out.text().substr(4);  // after the wipe
  EXPECT_LE(line.size(), 79u);
  EXPECT_EQ(line.compare(line.size() - 2, 2, "é"), 0) << line;
}

TEST(Progress, CountsFromSeveralThreads) {
  Capture out;
  Progress progress("render", 4000, to(out, false));
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&] {
      for (int i = 0; i < 1000; ++i) progress.advance(1);
    });
  for (std::thread& t : threads) t.join();
  progress.finish();
  EXPECT_EQ(out.text(), "render: 4000 done in 0:00\n");
}

TEST(FormatDuration, IsReadableAtEveryScale) {
  EXPECT_EQ(format_duration(0.0), "0:00");
  EXPECT_EQ(format_duration(7.4), "0:07");
  EXPECT_EQ(format_duration(59.7), "1:00");
  EXPECT_EQ(format_duration(723), "12:03");
  EXPECT_EQ(format_duration(3599.6), "1:00:00");
  EXPECT_EQ(format_duration(11045), "3:04:05");
  EXPECT_EQ(format_duration(-1.0), "?");
  EXPECT_EQ(format_duration(std::nan("")), "?");
  EXPECT_EQ(format_duration(1e20), "?");
}

}  // namespace
}  // namespace icbench
