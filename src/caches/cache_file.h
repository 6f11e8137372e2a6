// A cache's records in a file, and back: for a warm start, or to hand a filled cache to another machine.
//
//   if (const Failure failed = save_cache("room.cache", cache, {key, "room, frame 0"})) return tell(*failed);
//
//   CacheFile file;
//   if (const Failure failed = file.open("room.cache")) return tell(*failed);
//   CacheConfig config = file.config();  // as it was saved; may be changed, but for the bounds and a smaller capacity
//   WaitFree<> cache(config);
//   auto session = cache.open_session(0);
//   if (const Failure failed = load_records(file, session)) return tell(*failed);
//
// Guarantees. A file is either whole or refused, with one line that says what is wrong and where: one that is foreign,
// newer, cut off, too long, or damaged in any bit (a CRC finds every burst of up to 64 bits, and misses others with
// probability 2^-64). All of it is checked before the first record is handed out. What a file says of its size is held
// against the size it has, and nothing is allocated by it. A file is written under a temporary name beside its own and
// renamed when it is on the disk: at no time is there half a file under its name. No exceptions: functions return a
// Failure. Nothing is kept beside records: gradients and what else a renderer keeps by their ids is not in the file.
//
// Costs: saving reads the cache once, loading reads the file twice; 64-bit CRC a byte at a time. The layout is told in
// caches/cache_file_bytes.h.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

#include "caches/cache_file_bytes.h"
#include "core/cache.h"

namespace icbench {

/// What the records are of. The cache does not look at it; who loads it compares.
struct CacheContent {
  std::uint64_t key = 0;  ///< of all that the records depend on, such as a hash of the scene
  std::string text;       ///< the same for people; its first kMostContentText bytes are kept
};

/// Writes the records that `for_each(f)` calls f(const Record&) for, in that order. `config` says where they fit:
/// fails, and leaves what is there under that name, if some would not, so that the file could not be opened.
template <class ForEach>
[[nodiscard]] Failure save_records(const std::string& path, const CacheConfig& config,
                                   const CacheContent& content, ForEach&& for_each) {
  using namespace cache_file;
  const auto refused = [&path](const std::string& why) {
    return "cannot write the cache to '" + path + "': " + why;
  };
  if (const char* error = config_error(config)) return refused(error);
  Replacement file(path);
  if (Failure failed = file.open()) return failed;

  std::array<unsigned char, kAtOnce * kRecordBytes> bytes;
  std::size_t filled = 0;
  std::uint64_t written = 0, records = 0;
  std::optional<std::uint64_t> unusable;
  Crc64 crc;
  const auto flush = [&] {
    crc.add(bytes.data(), filled);
    file.write(bytes.data(), filled, kHeaderBytes + written);
    written += filled;
    filled = 0;
  };
  for_each([&](const Record& r) {
    if (!unusable && !is_storable(r, config.bounds)) unusable = records;
    write_record(bytes.data() + filled, r);
    filled += kRecordBytes;
    ++records;
    if (filled == bytes.size()) flush();
  });
  flush();
  if (unusable)
    return refused("record " + std::to_string(*unusable) + " is none that a cache of these bounds can hold");
  if (records > config.capacity) {
    return refused(std::to_string(records) + " records are more than the capacity of " +
                   std::to_string(config.capacity));
  }

  std::array<unsigned char, kHeaderBytes> header{};
  std::copy(kMagic.begin(), kMagic.end(), header.begin());
  Writer out(header.data() + kVersionAt);
  out.word(kCacheFileVersion);
  out.word(kHeaderBytes);
  out.word(kRecordBytes);
  write_config(out, config);
  out.word(0);
  out.number(records, 8);
  out.number(content.key, 8);
  std::copy_n(content.text.begin(), std::min(content.text.size(), kMostContentText),
              header.begin() + kTextAt);
  Writer(header.data() + kBodyCrcAt).number(crc.value(), 8);
  Writer(header.data() + kHeaderCrcAt).number(crc_of(header.data(), kHeaderCrcAt), 8);
  file.write(header.data(), header.size(), 0);
  return file.finish();
}

/// All records of a cache. Quiescent.
template <class Cache>
[[nodiscard]] Failure save_cache(const std::string& path, const Cache& cache,
                                 const CacheContent& content = {}) {
  return save_records(path, cache.config(), content, [&](auto&& f) { cache.for_each_record(f); });
}

/// A file of records, open for reading.
class CacheFile {
 public:
  /// Reads and checks all of the file. After a failure there is nothing to be read.
  [[nodiscard]] Failure open(const std::string& path) {
    path_ = path;
    records_ = 0;
    // Not blocking: a pipe without a writer would wait for one.
    file_.reset(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
    if (file_.get() < 0) return failure(std::string(std::strerror(errno)) + "; name a file that can be read");
    Failure failed = read_header();
    if (!failed) failed = for_each_record([](const Record&) {});
    if (failed) {
      file_.reset();
      records_ = 0;
    }
    return failed;
  }

  /// Of the cache that was saved, but for large_pages, which is a matter of the machine.
  const CacheConfig& config() const noexcept { return config_; }
  const CacheContent& content() const noexcept { return content_; }
  std::uint64_t records() const noexcept { return records_; }

  /// Calls f(const Record&) for all records, in the order they were saved in. Each is storable (is_storable) in the
  /// bounds. Fails if no file is open, and after some records if it has changed since it was opened.
  template <class F>
  [[nodiscard]] Failure for_each_record(F&& f) {
    using namespace cache_file;
    if (file_.get() < 0) return failure("it is not open");
    std::array<unsigned char, kAtOnce * kRecordBytes> bytes;
    Crc64 crc;
    std::optional<std::uint64_t> unusable;
    for (std::uint64_t i = 0; i < records_;) {
      const std::size_t some = static_cast<std::size_t>(std::min<std::uint64_t>(kAtOnce, records_ - i));
      const auto read = read_at(file_.get(), bytes.data(), some * kRecordBytes, offset_of(i));
      if (!read || *read != some * kRecordBytes) return failure_at(offset_of(i), "the records end here");
      crc.add(bytes.data(), *read);
      for (std::size_t k = 0; k < some; ++k, ++i) {
        const Record r = read_record(bytes.data() + k * kRecordBytes);
        if (is_storable(r, config_.bounds)) {
          f(r);
        } else if (!unusable) {
          unusable = i;
        }
      }
    }
    if (crc.value() != body_crc_)
      return failure_at(kHeaderBytes, "the records do not match their checksum; the file is damaged");
    if (unusable) {
      return failure_at(offset_of(*unusable), "record " + std::to_string(*unusable) +
                                                  " is none that a cache of these bounds can hold");
    }
    return {};
  }

 private:
  static constexpr std::uint64_t offset_of(std::uint64_t record) noexcept {
    return cache_file::kHeaderBytes + record * cache_file::kRecordBytes;
  }

  std::string failure(std::string_view why) const {
    return "cannot load the cache from '" + path_ + "': " + std::string(why);
  }
  std::string failure_at(std::uint64_t offset, std::string_view why) const {
    return failure("at byte " + std::to_string(offset) + ": " + std::string(why));
  }

  Failure read_header() {
    using namespace cache_file;
    struct stat there {};
    if (::fstat(file_.get(), &there) != 0) return failure(std::strerror(errno));
    if (!S_ISREG(there.st_mode)) return failure("this is no regular file; name another");
    const auto size = static_cast<std::uint64_t>(there.st_size);

    std::array<unsigned char, kHeaderBytes> header{};
    const auto read = read_at(file_.get(), header.data(), header.size(), 0);
    if (!read) return failure(std::strerror(errno));
    if (*read < kMagic.size() || !std::equal(kMagic.begin(), kMagic.end(), header.begin()))
      return failure_at(0, "this is no file of a cache");
    const auto version = static_cast<std::uint32_t>(Reader(header.data() + kVersionAt).number(4));
    if (*read >= kVersionAt + 4 && version != kCacheFileVersion) {
      return failure_at(kVersionAt, "version " + std::to_string(version) + " is not known, " +
                                        std::to_string(kCacheFileVersion) + " is; save the cache anew");
    }
    if (*read < kHeaderBytes) {
      return failure_at(*read, "the file ends within its header of " + std::to_string(kHeaderBytes) +
                                   " bytes; it was cut off");
    }
    if (Reader(header.data() + kHeaderCrcAt).number(8) != crc_of(header.data(), kHeaderCrcAt))
      return failure_at(kHeaderCrcAt, "the header does not match its checksum; the file is damaged");
    return take_header(header.data(), size);
  }

  /// Of a header that is as it was written, though not by this program, perhaps.
  Failure take_header(const unsigned char* header, std::uint64_t size) {
    using namespace cache_file;
    if (Reader(header + kHeaderBytesAt).word() != kHeaderBytes ||
        Reader(header + kRecordBytesAt).word() != kRecordBytes)
      return failure_at(kHeaderBytesAt, "header and records have not the sizes that version 1 gives them");
    Reader in(header + kConfigAt);
    config_ = read_config(in);
    if (const char* error = config_error(config_)) return failure_at(kConfigAt, error);
    const std::uint64_t records = Reader(header + kRecordsAt).number(8);
    if (records > config_.capacity) {
      return failure_at(kRecordsAt, std::to_string(records) + " records are more than the capacity of " +
                                        std::to_string(config_.capacity));
    }
    if (size != offset_of(records)) {
      return failure_at(std::min(size, offset_of(records)),
                        "the file has " + std::to_string(size) + " bytes where " + std::to_string(records) +
                            " records make " + std::to_string(offset_of(records)));
    }
    records_ = records;
    content_.key = Reader(header + kKeyAt).number(8);
    const auto* text = reinterpret_cast<const char*>(header + kTextAt);
    content_.text.assign(text, std::find(text, text + kMostContentText, '\0'));
    // For a line on a terminal.
    std::replace_if(
        content_.text.begin(), content_.text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
    body_crc_ = Reader(header + kBodyCrcAt).number(8);
    return {};
  }

  std::string path_;
  cache_file::Descriptor file_;
  CacheConfig config_;
  CacheContent content_;
  std::uint64_t records_ = 0;
  std::uint64_t body_crc_ = 0;
};

/// Inserts all records of `file` through a session. Fails, with those before it inserted, at the first that the cache
/// does not take.
template <class Session>
[[nodiscard]] Failure load_records(CacheFile& file, Session& session) {
  std::uint64_t inserted = 0, refused = 0;
  InsertResult why = InsertResult::inserted;
  Failure failed = file.for_each_record([&](const Record& r) {
    if (refused == 0) why = session.insert(r);
    ++(refused == 0 && why == InsertResult::inserted ? inserted : refused);
  });
  if (failed || refused == 0) return failed;
  return "the cache took " + std::to_string(inserted) + " of the " + std::to_string(file.records()) +
         " records of its file: " +
         (why == InsertResult::full ? "it is full; raise its capacity"
                                    : "the next lies outside its bounds; give it those of the file");
}

}  // namespace icbench
