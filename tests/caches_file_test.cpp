// A cache in a file: what is saved comes back from every cache, and a file that is not whole is never taken.
#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <thread>

#include "cache_contract.h"
#include "caches/cache_file.h"
#include "file_bytes.h"
#include "largest_request.h"
#include "temporary_folder.h"

namespace icbench {
namespace {

/// What is said of a file; empty if it is taken.
std::string refusal(const std::filesystem::path& path) {
  CacheFile file;
  const Failure failed = file.open(path);
  if (failed) {
    EXPECT_EQ(file.records(), 0u);
  }
  return failed.value_or("");
}

/// Sets a number of a file's header, and the header's checksum to what it then is: a file made by somebody else.
Bytes with_number(Bytes bytes, std::size_t at, std::uint64_t value, int size) {
  cache_file::Writer(bytes.data() + at).number(value, size);
  cache_file::Writer(bytes.data() + cache_file::kHeaderCrcAt)
      .number(cache_file::crc_of(bytes.data(), cache_file::kHeaderCrcAt), 8);
  return bytes;
}

class Files : public Contract {
 protected:
  TemporaryFolder folder_;
};
INSTANTIATE_TEST_SUITE_P(AllCaches, Files, ::testing::ValuesIn(registered_caches()), cache_name);

TEST_P(Files, RecordsComeBackBitForBit) {
  AnyCache saved(GetParam(), config());
  auto session = saved.open_session(0);
  for (const Record& r : random_records(1000, 1)) session.insert(r);
  saved.end_frame();
  ASSERT_EQ(save_cache(folder_ / "a", saved, {7, "a room"}), std::nullopt);

  CacheFile file;
  ASSERT_EQ(file.open(folder_ / "a"), std::nullopt);
  EXPECT_EQ(file.content().key, 7u);
  EXPECT_EQ(file.content().text, "a room");
  EXPECT_EQ(file.config().a_max, config().a_max);
  EXPECT_EQ(file.config().a, config().a);
  EXPECT_EQ(file.config().capacity, config().capacity);
  EXPECT_EQ(file.config().max_sessions, config().max_sessions);
  EXPECT_EQ(file.config().bounds.lower, config().bounds.lower);
  EXPECT_EQ(file.config().bounds.upper, config().bounds.upper);
  AnyCache loaded(GetParam(), file.config());
  auto other = loaded.open_session(0);
  const Failure failed = load_records(file, other);
  if (!keeps()) {
    EXPECT_EQ(file.records(), 0u);
    return;
  }
  ASSERT_EQ(failed, std::nullopt);
  loaded.end_frame();
  EXPECT_EQ(file.records(), 1000u);
  EXPECT_EQ(stored(loaded), stored(saved));
  loaded.for_each_record([&](const Record& r) {
    const Record made = random_records(1000, 1)[r.id];
    EXPECT_EQ(std::memcmp(&made, &r, sizeof r), 0) << r.id;
  });
}

/// A file of few records.
class SmallFile : public ::testing::Test {
 protected:
  static constexpr std::uint32_t kRecords = 5;

  SmallFile() {
    EXPECT_EQ(save(random_records(kRecords, 2)), std::nullopt);
    bytes_ = bytes_of(path_);
  }

  Failure save(const std::vector<Record>& records, const CacheContent& content = {1, "small"}) const {
    return save_records(path_, config_, content, [&](const auto& f) {
      for (const Record& r : records) f(r);
    });
  }

  /// The file with other records of the same number, of which nobody knows whether they can be stored.
  Bytes with_records(const std::vector<Record>& records) const {
    Bytes out = bytes_;
    for (std::size_t i = 0; i < records.size(); ++i)
      cache_file::write_record(&out[cache_file::kHeaderBytes + i * cache_file::kRecordBytes], records[i]);
    const std::uint64_t crc =
        cache_file::crc_of(&out[cache_file::kHeaderBytes], out.size() - cache_file::kHeaderBytes);
    return with_number(std::move(out), cache_file::kBodyCrcAt, crc, 8);
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "small";
  CacheConfig config_{.capacity = 100, .max_sessions = 2};
  Bytes bytes_;
};

TEST_F(SmallFile, LayoutIsWhatIsWritten) {
  ASSERT_EQ(bytes_.size(), 160u + 44 * kRecords);
  const Bytes begin = {0x89, 'I', 'C', 'B',  '\r', '\n', 0x1a, '\n', 1, 0, 0, 0, 160, 0,
                       0,    0,   44,  0,    0,    0,    100,  0,    0, 0, 2, 0, 0,   0,
                       0,    0,   0,   0x3f, 0,    0,    0,    0x3f, 0, 0, 0, 0};
  EXPECT_EQ(Bytes(bytes_.begin(), bytes_.begin() + 40), begin);
  EXPECT_EQ(Bytes(bytes_.begin() + 64, bytes_.begin() + 86),
            (Bytes{kRecords, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 's', 'm', 'a', 'l', 'l', 0}));
  // The check value of CRC-64/XZ.
  const std::string_view digits = "123456789";
  EXPECT_EQ(cache_file::crc_of(reinterpret_cast<const unsigned char*>(digits.data()), digits.size()),
            0x995dc9bbdf1939fau);
  EXPECT_EQ(refusal(path_), "");
}

TEST_F(SmallFile, IsRefusedWithAnyBitFlipped) {
  std::fstream file(path_, std::ios::binary | std::ios::in | std::ios::out);
  const auto put_byte = [&](std::size_t i, unsigned byte) {
    file.seekp(static_cast<std::streamoff>(i)).put(static_cast<char>(byte)).flush();
  };
  for (std::size_t i = 0; i < bytes_.size(); ++i) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      put_byte(i, bytes_[i] ^ (1u << bit));
      const std::string said = refusal(path_);
      ASSERT_TRUE(is_one_line_with(said, path_.string() + "': at byte ")) << "byte " << i << ", bit " << bit;
    }
    put_byte(i, bytes_[i]);
  }
  EXPECT_EQ(refusal(path_), "");
}

TEST_F(SmallFile, IsRefusedIfItIsCutOffOrTooLong) {
  for (std::size_t size = bytes_.size(); size-- > 0;) {
    std::filesystem::resize_file(path_, size);
    ASSERT_TRUE(is_one_line_with(refusal(path_), "at byte ")) << size;
  }
  Bytes more = bytes_;
  more.resize(more.size() + 44);
  put(path_, more);
  EXPECT_TRUE(is_one_line_with(refusal(path_), "5 records"));
}

TEST_F(SmallFile, IsRefusedIfItsNumbersMakeNoSense) {
  struct Case {
    std::size_t at;
    std::uint64_t value;
    int size;
    const char* says;
  };
  const std::uint64_t nan = 0x7fc00000;
  for (const Case& c :
       {Case{8, 2, 4, "version 2"}, Case{8, 0, 4, "version 0"}, Case{12, 128, 4, "sizes"},
        Case{16, 48, 4, "sizes"}, Case{20, 0, 4, "capacity"}, Case{20, 4, 4, "capacity"},
        Case{24, 1u << 20, 4, "max_sessions"}, Case{28, nan, 4, "accuracy"}, Case{32, nan, 4, "accuracy"},
        Case{36, nan, 4, "bounds"}, Case{36, 0x40000000, 4, "bounds"}, Case{64, 4, 8, "4 records"},
        Case{64, 6, 8, "6 records"}, Case{64, 1'000'000'000'000'000'000, 8, "capacity"},
        Case{64, ~std::uint64_t{0}, 8, "capacity"}, Case{144, 0, 8, "checksum"}}) {
    put(path_, with_number(bytes_, c.at, c.value, c.size));
    largest_request = 0;
    EXPECT_TRUE(is_one_line_with(refusal(path_), c.says)) << c.at;
    EXPECT_LT(largest_request, 100'000u) << c.at;
  }
}

TEST_F(SmallFile, IsRefusedIfARecordCannotBeStored) {
  for (const float R : {0.0f, -1.0f, std::numeric_limits<float>::quiet_NaN()}) {
    std::vector<Record> records = random_records(kRecords, 3);
    records[3].R = R;
    put(path_, with_records(records));
    EXPECT_TRUE(is_one_line_with(refusal(path_), "at byte 292: record 3"));
  }
  std::vector<Record> records = random_records(kRecords, 3);
  records[0].p.x = 1.5f;
  put(path_, with_records(records));
  EXPECT_TRUE(is_one_line_with(refusal(path_), "at byte 160: record 0"));
}

TEST_F(SmallFile, WhatCouldNotBeReadIsNotWritten) {
  std::vector<Record> records = random_records(kRecords, 3);
  records[3].R = 0.0f;
  EXPECT_TRUE(is_one_line_with(save(records).value_or(""), "record 3"));
  EXPECT_TRUE(is_one_line_with(save(random_records(101, 3)).value_or(""), "101 records"));
  config_.a = 2.0f * config_.a_max;
  EXPECT_TRUE(is_one_line_with(save(random_records(kRecords, 3)).value_or(""), "accuracy"));
  EXPECT_EQ(bytes_of(path_), bytes_);
  EXPECT_EQ(folder_.entries(), 1);
}

TEST_F(SmallFile, ForeignFilesAreRefused) {
  put(path_, Bytes(1000, 'x'));
  EXPECT_TRUE(is_one_line_with(refusal(path_), "this is no file of a cache"));
  EXPECT_TRUE(is_one_line_with(refusal(folder_ / "missing"), "No such file"));
  EXPECT_TRUE(is_one_line_with(refusal(folder_ / "."), "no regular file"));
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_TRUE(is_one_line_with(refusal(folder_ / "pipe"), "no regular file"));
  EXPECT_TRUE(is_one_line_with(refusal("/dev/zero"), "no regular file"));
}

TEST_F(SmallFile, ChangesWhileItIsReadAreFound) {
  CacheFile file;
  ASSERT_EQ(file.open(path_), std::nullopt);
  bytes_.back() ^= 1;
  put(path_, bytes_);
  EXPECT_TRUE(is_one_line_with(file.for_each_record([](const Record&) {}).value_or(""), "checksum"));
  bytes_.resize(200);
  put(path_, bytes_);
  EXPECT_TRUE(is_one_line_with(file.for_each_record([](const Record&) {}).value_or(""), "end here"));
}

TEST_F(SmallFile, WhatIsNotOpenIsNotRead) {
  CacheFile file;
  const auto refused = [&file] { return file.for_each_record([](const Record&) {}).value_or(""); };
  EXPECT_TRUE(is_one_line_with(refused(), "not open"));
  ASSERT_EQ(file.open(path_), std::nullopt);
  ASSERT_NE(file.open(folder_ / "another"), std::nullopt);
  EXPECT_TRUE(is_one_line_with(refused(), "not open"));
}

TEST_F(SmallFile, WritingThatFailsLeavesTheOldFileAndNothingElse) {
  // Past this size writing fails, as on a full disk.
  rlimit before{}, little{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  little = before;
  little.rlim_cur = 30'000;
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &little), 0);
  config_.capacity = 5000;
  const Failure failed = save(random_records(5000, 4));
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  EXPECT_TRUE(is_one_line_with(failed.value_or(""), path_.string()));
  EXPECT_EQ(bytes_of(path_), bytes_);
  EXPECT_EQ(folder_.entries(), 1);

  for (const std::filesystem::path& path : {folder_ / "none/here", folder_ / "."}) {
    const Failure refused = save_records(path, config_, {}, [](const auto&) {});
    EXPECT_TRUE(is_one_line_with(refused.value_or(""), "cannot write the cache")) << path;
  }
  EXPECT_EQ(folder_.entries(), 1);
}

TEST_F(SmallFile, LinksAreFollowedAndPermissionsStay) {
  const std::filesystem::path link = folder_ / "link";
  std::filesystem::create_symlink("small", link);
  const auto mode = std::filesystem::perms::owner_all | std::filesystem::perms::group_read;
  std::filesystem::permissions(path_, mode);
  ASSERT_EQ(save_records(link, config_, {}, [](const auto&) {}), std::nullopt);
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_LT(bytes_of(path_).size(), bytes_.size());
  EXPECT_EQ(std::filesystem::status(path_).permissions(), mode);
  EXPECT_EQ(folder_.entries(), 2);
}

TEST_F(SmallFile, NamesOfOpenFilesAreRefused) {
  // What is behind the names is a file, which would be replaced.
  const int there = ::open(path_.c_str(), O_RDONLY);
  const std::string fd = "fd/" + std::to_string(there), link = folder_ / "link";
  std::filesystem::create_symlink("/dev/" + fd, link);
  for (const std::string& name : {std::string("/dev/stdout"), std::string("/dev/stderr"), "/dev/" + fd,
                                  "//dev/./" + fd, "/proc/self/" + fd, "/proc/thread-self/" + fd,
                                  "/proc/" + std::to_string(getpid()) + "/" + fd, link}) {
    const Failure refused = save_records(name, config_, {}, [](const auto&) {});
    EXPECT_TRUE(is_one_line_with(refused.value_or(""), "no regular file")) << name;
  }
  ::close(there);
}

TEST_F(SmallFile, SavesToOneNameAtOnceLeaveOneOfThem) {
  const std::vector<Record> one = random_records(2000, 5), other = random_records(3000, 6);
  config_.capacity = 3000;
  for (int round = 0; round < 20; ++round) {
    Failure first, second;
    std::thread beside([&] { second = save(other); });
    first = save(one);
    beside.join();
    ASSERT_EQ(first, std::nullopt);
    ASSERT_EQ(second, std::nullopt);
    CacheFile file;
    ASSERT_EQ(file.open(path_), std::nullopt);
    ASSERT_EQ(file.for_each_record([](const Record&) {}), std::nullopt);
  }
  EXPECT_EQ(folder_.entries(), 1);
}

TEST_F(SmallFile, ACacheThatIsTooSmallSaysSo) {
  CacheFile file;
  ASSERT_EQ(file.open(path_), std::nullopt);
  CacheConfig config = file.config();
  config.capacity = 3;
  config.max_sessions = 1;
  AnyCache cache(registered_caches()[1], config);  // brute_force
  auto session = cache.open_session(0);
  EXPECT_TRUE(is_one_line_with(load_records(file, session).value_or(""), "took 3 of the 5 records"));
}

TEST_F(SmallFile, TextForPeopleIsPrintable) {
  ASSERT_EQ(save({}, {0, "bell\a" + std::string(100, 'x')}), std::nullopt);
  CacheFile file;
  ASSERT_EQ(file.open(path_), std::nullopt);
  EXPECT_EQ(file.content().text, "bell?" + std::string(59, 'x'));
  EXPECT_EQ(file.records(), 0u);
}

}  // namespace
}  // namespace icbench
