// Traces: every cache operation of a render in a file, and back.
//
// A trace holds what threads asked a cache and what they gave it, tile by tile: each query's point, whether it was
// answered, and for each miss the record that was made, what the cache did with it, and how long it took to compute.
// The trace is cut as the render was:
//
//   frame      begins with the records of the last one, with none, or with records that it lists
//   segment    of a frame: one pass over the tiles, between a cache's begin_frame and end_frame
//   tile       of a segment, in the order in which tiles were begun: operations of one thread, in its order
//
// Guarantees. Points and records are kept bit for bit. A file is written under a temporary name beside its own and
// renamed when it is on the disk. It is whole or refused, with one line: foreign, newer, cut off, too long, damaged in
// any bit, or contradicting itself. Nothing is allocated by what a file says before its checksums agree and its numbers
// fit the size it has.
//
// Layout, version 1, in the bytes of caches/cache_file_bytes.h: a header of 400 bytes (trace_layout.h lists its
// fields), then the frames, each 25 bytes, the records it begins with, and its segments; a tile is its thread,
// operations, bytes (varints: 7 bits a byte, low ones first, the top bit says that more follow) and its operations:
//
//   1       bit 0: a miss; bit 1: another normal than the operation before; bits 2-3, 4-5, 6-7: bytes of x, y, z
//   0-12    x, y, z: differences of the bit patterns from the operation before (0 before the first), zigzag
//   1-13    another normal: one of the last 16 of the tile by its age, or 64 + bits as above and differences
//   miss    1: flags of TracedRecord; p and n if they are not the query's; R, E; varints: difference of the id from
//           the record before (zigzag), nanoseconds
//
// It is small because neighbours are alike: of a coordinate's 4 bytes 3 or fewer change from one operation of a tile
// to the next, and a flat surface has one normal. `icbench trace info` tells the bytes an operation takes, records and
// all.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "caches/cache_file_bytes.h"
#include "core/cache.h"
#include "core/types.h"

namespace icbench {

inline constexpr std::size_t kMostTraceText = 64;

/// What a trace was captured of, and with. Texts keep their last kMostTraceText bytes.
struct TraceContext {
  std::string scene, integrator, interpolation, cache;
  std::uint32_t width = 0, height = 0, spp = 1;
  std::uint32_t rays = 0;  ///< per record; 0 where records come from virtual lights
  std::uint32_t vpls = 0;  ///< virtual lights; 0 where there are none
  std::uint64_t seed = 0;
  CacheConfig config{};  ///< of the cache; max_sessions: the threads
};

/// A record that a miss made.
struct TracedRecord {
  /// Bits of `flags`: the cache had valid records, but the integrator took none; it looked at the neighbours before it
  /// inserted; the record does not lie where the query was.
  static constexpr std::uint8_t kRefusedAnswer = 1, kAskedNeighbours = 2, kElsewhere = 16;

  Record record;
  std::uint8_t flags = 0;
  InsertResult result = InsertResult::inserted;
  std::uint64_t cost_ns = 0;  ///< from the miss to the insert
};

/// What becomes of a cache's records as a frame begins.
enum class FrameStart : std::uint8_t { stay, clear, replace };

/// A sum over records that does not depend on their order: the same for the same records, bit for bit, and for others
/// the same with probability 2^-64.
class RecordsDigest {
 public:
  void add(const Record& r) noexcept;
  std::uint64_t value() const noexcept { return sum_; }

 private:
  std::uint64_t sum_ = 0;
};

/// A trace in memory.
struct Trace {
  static constexpr std::uint32_t kHit = ~std::uint32_t{0};

  struct Tile {
    std::uint32_t begin, end;  ///< operations
    std::uint32_t thread;
  };
  struct Range {
    std::uint32_t begin, end;
  };
  struct Frame {
    std::uint32_t number = 0;
    FrameStart start = FrameStart::stay;
    Range first{};  ///< of `records`: those it begins with, if they are to be replaced
    Range segments{};
    std::uint32_t stored = 0;  ///< records in the cache at its end
    std::uint64_t digest = 0;  ///< theirs
  };

  TraceContext context;
  std::uint64_t checksum = 0;         ///< of the file
  std::uint64_t bytes = 0;            ///< of the file
  std::vector<SurfacePoint> points;   ///< of the operations
  std::vector<std::uint32_t> made;    ///< by each operation: index of its record, or kHit
  std::vector<TracedRecord> records;  ///< those that frames begin with, and those made
  std::vector<Tile> tiles;
  std::vector<Range> segments;  ///< of tiles
  std::vector<Frame> frames;
};

/// Operations of one tile after the other as bytes, by one thread. Out of memory ends the program.
class TraceEncoder {
 public:
  static constexpr std::size_t kNormals = 16;  ///< of a tile that are remembered

  /// Memory for about so many operations is touched.
  explicit TraceEncoder(std::uint64_t operations);

  void begin_tile() noexcept;
  void query(const SurfacePoint& x, bool is_hit) noexcept;
  /// After a query that missed.
  void record(const TracedRecord& r) noexcept;

  std::size_t size() const noexcept { return size_; }
  const unsigned char* data() const noexcept { return bytes_.data(); }
  void clear() noexcept { size_ = 0; }

 private:
  /// What operations of a tile are told apart from.
  struct State {
    SurfacePoint last{};
    std::uint32_t id = 0;
    std::array<glm::vec3, kNormals> normals{};  // latest first
    std::size_t known = 0;                      // of them

    void meet(std::size_t place, const glm::vec3& n) noexcept;
  };

  void put(std::uint64_t value, int bytes) noexcept;
  void put_varint(std::uint64_t value) noexcept;
  unsigned char put_vector(const glm::vec3& v, const glm::vec3& last) noexcept;

  std::vector<unsigned char> bytes_;
  std::size_t size_ = 0;
  State state_;
};

/// A frame as it was captured. Quiescent; valid until the next is begun.
struct CapturedFrame {
  struct Tile {
    std::uint32_t segment, order, thread, operations, records;
    std::span<const unsigned char> bytes;
  };

  std::uint32_t number = 0;
  FrameStart start = FrameStart::stay;
  std::vector<Record> first{};
  std::uint32_t segments = 0;
  std::vector<Tile> tiles{};  ///< in any order
  std::uint32_t stored = 0;
  std::uint64_t digest = 0;
};

/// Writes a trace, frame by frame. Nothing stands under the file's name before `finish`. Throws std::runtime_error with
/// one line.
class TraceWriter {
 public:
  TraceWriter(const std::string& path, const TraceContext& context);

  void add(CapturedFrame frame);
  void finish();

  std::uint64_t operations() const noexcept { return operations_; }
  std::uint64_t records() const noexcept { return records_; }
  std::uint64_t bytes() const noexcept;

 private:
  void write(const unsigned char* bytes, std::size_t n);

  cache_file::Replacement file_;
  TraceContext context_;
  cache_file::Crc64 crc_;
  std::uint64_t body_ = 0, operations_ = 0, records_ = 0, first_ = 0;
  std::uint32_t frames_ = 0, segments_ = 0, tiles_ = 0;
};

/// Reads and checks a whole trace. Throws std::runtime_error with one line.
Trace read_trace(const std::string& path);

/// Context and checksum of a trace, no operations, after its checksums were tried. Throws as above.
Trace read_trace_header(const std::string& path);

}  // namespace icbench
