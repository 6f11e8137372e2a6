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
// Costs: saving reads the cache once, loading reads the file twice; 64-bit CRC a byte at a time.
//
// Layout, version 1: all numbers little-endian, floats IEEE 754 binary32, whatever the machine
//
//     0   8  magic: 89 'I' 'C' 'B' 0d 0a 1a 0a (text mode, 7 bits and "type" damage it visibly, as PNG's)
//     8   4  version
//    12   4  bytes of this header
//    16   4  bytes of a record
//    20   4  capacity        CacheConfig, as all to 60
//    24   4  max_sessions
//    28   4  a_max
//    32   4  a
//    36  24  bounds: lower x, y, z, upper x, y, z
//    60   4  zero
//    64   8  records
//    72   8  content key     CacheContent
//    80  64  content text, then zeros
//   144   8  CRC of the records' bytes
//   152   8  CRC of the 152 bytes above
//   160  44  record 0: p x, y, z, n x, y, z, R, E r, g, b, id; and so on
//
// CRCs are CRC-64/XZ: polynomial 0x42f0e1eba9ea3693 (ECMA-182), reflected, all ones at the beginning and inverted at
// the end.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "core/cache.h"

namespace icbench {

/// One line that says what went wrong, where, and how to mend it; nothing if all went well.
using Failure = std::optional<std::string>;

/// What the records are of. The cache does not look at it; who loads it compares.
struct CacheContent {
  std::uint64_t key = 0;  ///< of all that the records depend on, such as a hash of the scene
  std::string text;       ///< the same for people; its first kMostContentText bytes are kept
};

inline constexpr std::size_t kMostContentText = 64;
inline constexpr std::uint32_t kCacheFileVersion = 1;

namespace cache_file {

inline constexpr std::array<unsigned char, 8> kMagic = {0x89, 'I', 'C', 'B', '\r', '\n', 0x1a, '\n'};
inline constexpr std::size_t kHeaderBytes = 160, kRecordBytes = 44;
inline constexpr std::size_t kVersionAt = 8, kHeaderBytesAt = 12, kRecordBytesAt = 16, kConfigAt = 20,
                             kRecordsAt = 64, kKeyAt = 72, kTextAt = 80, kBodyCrcAt = 144, kHeaderCrcAt = 152;
static_assert(kTextAt + kMostContentText == kBodyCrcAt && kHeaderCrcAt + 8 == kHeaderBytes);

class Crc64 {
 public:
  void add(const unsigned char* bytes, std::size_t n) noexcept {
    for (std::size_t i = 0; i < n; ++i) state_ = kTable[(state_ ^ bytes[i]) & 0xff] ^ (state_ >> 8);
  }
  std::uint64_t value() const noexcept { return ~state_; }

 private:
  static constexpr std::array<std::uint64_t, 256> kTable = [] {
    std::array<std::uint64_t, 256> table{};
    for (std::uint64_t i = 0; i < 256; ++i) {
      table[i] = i;
      for (int bit = 0; bit < 8; ++bit)
        table[i] = (table[i] >> 1) ^ ((table[i] & 1) != 0 ? 0xc96c5795d7870f42u : 0);
    }
    return table;
  }();

  std::uint64_t state_ = ~std::uint64_t{0};
};

inline std::uint64_t crc_of(const unsigned char* bytes, std::size_t n) noexcept {
  Crc64 crc;
  crc.add(bytes, n);
  return crc.value();
}

/// Numbers one after the other, byte by byte: the same on every machine.
class Writer {
 public:
  explicit Writer(unsigned char* at) noexcept : at_(at) {}
  void number(std::uint64_t value, int bytes) noexcept {
    for (; bytes > 0; --bytes, value >>= 8) *at_++ = static_cast<unsigned char>(value & 0xff);
  }
  void word(std::uint32_t value) noexcept { number(value, 4); }
  void real(float value) noexcept { word(std::bit_cast<std::uint32_t>(value)); }
  void vector(const glm::vec3& v) noexcept {
    for (int axis = 0; axis < 3; ++axis) real(v[axis]);
  }

 private:
  unsigned char* at_;
};

class Reader {
 public:
  explicit Reader(const unsigned char* at) noexcept : at_(at) {}
  std::uint64_t number(int bytes) noexcept {
    std::uint64_t value = 0;
    for (int i = 0; i < bytes; ++i) value |= std::uint64_t{*at_++} << (8 * i);
    return value;
  }
  std::uint32_t word() noexcept { return static_cast<std::uint32_t>(number(4)); }
  float real() noexcept { return std::bit_cast<float>(word()); }
  glm::vec3 vector() noexcept {
    glm::vec3 v;
    for (int axis = 0; axis < 3; ++axis) v[axis] = real();
    return v;
  }

 private:
  const unsigned char* at_;
};

inline void write_record(unsigned char* at, const Record& r) noexcept {
  Writer out(at);
  out.vector(r.p);
  out.vector(r.n);
  out.real(r.R);
  out.vector(r.E);
  out.word(r.id);
}

inline Record read_record(const unsigned char* at) noexcept {
  Reader in(at);
  Record r;
  r.p = in.vector();
  r.n = in.vector();
  r.R = in.real();
  r.E = in.vector();
  r.id = in.word();
  return r;
}

/// Owns a file descriptor.
class Descriptor {
 public:
  Descriptor() = default;
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() { reset(); }
  void reset(int fd = -1) noexcept {
    if (fd_ >= 0) ::close(fd_);
    fd_ = fd;
  }
  int get() const noexcept { return fd_; }

 private:
  int fd_ = -1;
};

/// As many as `n` bytes from `offset` on, fewer at the file's end; none if it cannot be read.
inline std::optional<std::size_t> read_at(int fd, unsigned char* to, std::size_t n, std::uint64_t offset) {
  std::size_t done = 0;
  while (done < n) {
    const ssize_t some = ::pread(fd, to + done, n - done, static_cast<off_t>(offset + done));
    if (some < 0 && errno == EINTR) continue;
    if (some < 0) return std::nullopt;
    if (some == 0) break;
    done += static_cast<std::size_t>(some);
  }
  return done;
}

/// False, with errno, if not all could be written.
inline bool write_at(int fd, const unsigned char* from, std::size_t n, std::uint64_t offset) {
  while (n > 0) {
    const ssize_t some = ::pwrite(fd, from, n, static_cast<off_t>(offset));
    if (some < 0 && errno == EINTR) continue;
    if (some <= 0) return false;
    from += some;
    n -= static_cast<std::size_t>(some);
    offset += static_cast<std::size_t>(some);
  }
  return true;
}

/// A file that gets its name when it is whole.
class Replacement {
 public:
  explicit Replacement(const std::string& path)
      : path_(path), temporary_(path + ".tmp" + std::to_string(::getpid())) {}
  Replacement(const Replacement&) = delete;
  Replacement& operator=(const Replacement&) = delete;
  ~Replacement() {
    if (file_.get() >= 0) ::unlink(temporary_.c_str());
  }

  Failure open() {
    struct stat there {};
    if (::stat(path_.c_str(), &there) == 0 && !S_ISREG(there.st_mode))
      return failure("this is no regular file; name another");
    file_.reset(::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
    return file_.get() < 0 ? failure_of(errno) : Failure{};
  }

  /// Keeps the first error for `finish`.
  void write(const unsigned char* from, std::size_t n, std::uint64_t offset) {
    if (error_ == 0 && !write_at(file_.get(), from, n, offset)) error_ = errno != 0 ? errno : EIO;
  }

  Failure finish() {
    if (error_ == 0 && ::fsync(file_.get()) != 0 && errno != EINVAL && errno != ENOTSUP) error_ = errno;
    if (error_ == 0 && ::rename(temporary_.c_str(), path_.c_str()) != 0) error_ = errno;
    if (error_ != 0) return failure_of(error_);
    file_.reset();
    const std::size_t slash = path_.rfind('/');
    const std::string folder = slash == path_.npos ? "." : path_.substr(0, slash + 1);
    file_.reset(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (file_.get() >= 0) ::fsync(file_.get());  // some file systems refuse this; the rename stays atomic
    file_.reset();
    return {};
  }

 private:
  std::string failure(std::string_view why) const {
    return "cannot write the cache to '" + path_ + "': " + std::string(why);
  }
  std::string failure_of(int code) const {
    return failure(std::string(std::strerror(code)) + "; choose another place");
  }

  std::string path_, temporary_;
  Descriptor file_;
  int error_ = 0;
};

/// Records are read and written this many at a time.
inline constexpr std::size_t kAtOnce = 256;

}  // namespace cache_file

/// Writes the records that `for_each(f)` calls f(const Record&) for, in that order. `config` says where they fit.
template <class ForEach>
[[nodiscard]] Failure save_records(const std::string& path, const CacheConfig& config,
                                   const CacheContent& content, ForEach&& for_each) {
  using namespace cache_file;
  Replacement file(path);
  if (Failure failed = file.open()) return failed;

  std::array<unsigned char, kAtOnce * kRecordBytes> bytes;
  std::size_t filled = 0;
  std::uint64_t written = 0, records = 0;
  Crc64 crc;
  const auto flush = [&] {
    crc.add(bytes.data(), filled);
    file.write(bytes.data(), filled, kHeaderBytes + written);
    written += filled;
    filled = 0;
  };
  for_each([&](const Record& r) {
    write_record(bytes.data() + filled, r);
    filled += kRecordBytes;
    ++records;
    if (filled == bytes.size()) flush();
  });
  flush();

  std::array<unsigned char, kHeaderBytes> header{};
  std::copy(kMagic.begin(), kMagic.end(), header.begin());
  Writer out(header.data() + kVersionAt);
  out.word(kCacheFileVersion);
  out.word(kHeaderBytes);
  out.word(kRecordBytes);
  out.word(config.capacity);
  out.word(config.max_sessions);
  out.real(config.a_max);
  out.real(config.a);
  out.vector(config.bounds.lower);
  out.vector(config.bounds.upper);
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

  /// Of the cache that was saved.
  const CacheConfig& config() const noexcept { return config_; }
  const CacheContent& content() const noexcept { return content_; }
  std::uint64_t records() const noexcept { return records_; }

  /// Calls f(const Record&) for all records, in the order they were saved in. Each is storable (is_storable) in the
  /// bounds. Fails, after some records, only if the file has changed since it was opened.
  template <class F>
  [[nodiscard]] Failure for_each_record(F&& f) {
    using namespace cache_file;
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
    config_.capacity = in.word();
    config_.max_sessions = in.word();
    config_.a_max = in.real();
    config_.a = in.real();
    config_.bounds.lower = in.vector();
    config_.bounds.upper = in.vector();
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
