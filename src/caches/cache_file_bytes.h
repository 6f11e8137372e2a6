// The bytes of a cache's file (caches/cache_file.h): layout, checksum, and a file that gets its name when it is whole.
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
#include <sys/vfs.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <bit>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

#include "core/cache.h"
#include "core/types.h"

namespace icbench {

/// One line that says what went wrong, where, and how to mend it; nothing if all went well.
using Failure = std::optional<std::string>;

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

/// 40 bytes.
inline void write_config(Writer& out, const CacheConfig& config) noexcept {
  out.word(config.capacity);
  out.word(config.max_sessions);
  out.real(config.a_max);
  out.real(config.a);
  out.vector(config.bounds.lower);
  out.vector(config.bounds.upper);
}

/// As it stands there: config_error() judges it.
inline CacheConfig read_config(Reader& in) noexcept {
  CacheConfig config;
  config.capacity = in.word();
  config.max_sessions = in.word();
  config.a_max = in.real();
  config.a = in.real();
  config.bounds.lower = in.vector();
  config.bounds.upper = in.vector();
  return config;
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

/// A file that gets its name when it is whole. A symbolic link that leads to a file is followed, and permissions stay.
/// As replace_file of files/output_file.h, but for programs without exceptions, and without the C++ file system library.
class Replacement {
 public:
  /// `what` the file holds, for messages.
  explicit Replacement(const std::string& path, std::string_view what = "the cache")
      : path_(path), what_(what), target_(path) {}
  Replacement(const Replacement&) = delete;
  Replacement& operator=(const Replacement&) = delete;
  ~Replacement() {
    if (file_.get() >= 0 && !temporary_.empty()) ::unlink(temporary_.c_str());
  }

  Failure open() {
    struct stat there {};
    const bool is_there = ::stat(path_.c_str(), &there) == 0;
    if ((is_there && !S_ISREG(there.st_mode)) || names_a_descriptor())
      return failure("this is no regular file; name another");
    if (char* const resolved = ::realpath(path_.c_str(), nullptr)) {
      target_ = resolved;
      std::free(resolved);
    }
    // Without a name until it is whole, so that a process that is killed leaves nothing; where that cannot be had, with
    // one.
    if (::access("/proc/self/fd", X_OK) == 0)
      file_.reset(::open(folder().c_str(), O_WRONLY | O_TMPFILE | O_CLOEXEC, 0666));
    const auto create = [&](const char* name) {
      file_.reset(::open(name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
      return file_.get() >= 0;
    };
    if (file_.get() < 0 && !with_a_name(create)) return failure_of(errno);
    if (is_there) (void)::fchmod(file_.get(), there.st_mode & 0777);  // some file systems have none
    return {};
  }

  /// Keeps the first error for `finish`.
  void write(const unsigned char* from, std::size_t n, std::uint64_t offset) {
    if (error_ == 0 && !write_at(file_.get(), from, n, offset)) error_ = errno != 0 ? errno : EIO;
  }

  Failure finish() {
    if (error_ == 0 && ::fsync(file_.get()) != 0 && errno != EINVAL && errno != ENOTSUP) error_ = errno;
    if (error_ == 0 && temporary_.empty()) {
      const std::string self = "/proc/self/fd/" + std::to_string(file_.get());
      const auto link = [&](const char* name) {
        return ::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, name, AT_SYMLINK_FOLLOW) == 0;
      };
      if (!with_a_name(link)) error_ = errno;
    }
    if (error_ == 0 && ::rename(temporary_.c_str(), target_.c_str()) != 0) error_ = errno;
    if (error_ != 0) return failure_of(error_);
    file_.reset();
    file_.reset(::open(folder().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (file_.get() >= 0) ::fsync(file_.get());  // some file systems refuse this; the rename stays atomic
    file_.reset();
    return {};
  }

 private:
  std::string folder() const {
    const std::size_t slash = target_.rfind('/');
    return slash == target_.npos ? "." : target_.substr(0, slash + 1);
  }

  // Another name of an open file, which has one of its own or none: somewhere on the way there is a link in /proc,
  // whatever the path is called.
  bool names_a_descriptor() const {
    constexpr int kMostLinks = 40;  // that the system follows
    constexpr int kProc = 0x9fa0;   // the number of that file system
    std::string at = path_;
    if (at == "-") return true;
    for (int i = 0; i < kMostLinks; ++i) {
      Descriptor link;
      link.reset(::open(at.c_str(), O_PATH | O_NOFOLLOW | O_CLOEXEC));
      struct statfs there {};
      if (link.get() < 0 || ::fstatfs(link.get(), &there) != 0) return false;
      if (there.f_type == kProc) return true;
      std::array<char, 4096> to;
      const ssize_t length = ::readlinkat(link.get(), "", to.data(), to.size());
      if (length <= 0) return false;  // the end of the way
      at.erase(to[0] == '/' ? 0 : at.rfind('/') + 1);
      at.append(to.data(), static_cast<std::size_t>(length));
    }
    return false;
  }

  // Whether `make` made something of a name of its own, whoever else is writing a file of that path: in another thread,
  // or in another process, which may have the same number on another machine. Then temporary_ is that name.
  template <class F>
  bool with_a_name(F&& make) {
    static std::atomic<unsigned> next{0};
    constexpr int kTries = 100;
    for (int i = 0; i < kTries; ++i) {
      // Relaxed: numbers only have to be distinct.
      std::string name = target_ + ".tmp" + std::to_string(::getpid()) + "." +
                         std::to_string(next.fetch_add(1, std::memory_order_relaxed));
      if (make(name.c_str())) {
        temporary_ = std::move(name);
        return true;
      }
      if (errno != EEXIST) return false;
    }
    return false;
  }

  std::string failure(std::string_view why) const {
    return "cannot write " + what_ + " to '" + path_ + "': " + std::string(why);
  }
  std::string failure_of(int code) const {
    return failure(std::string(std::strerror(code)) + "; choose another place");
  }

  std::string path_, what_, target_, temporary_;
  Descriptor file_;
  int error_ = 0;
};

/// Records are read and written this many at a time.
inline constexpr std::size_t kAtOnce = 256;

}  // namespace cache_file

}  // namespace icbench
