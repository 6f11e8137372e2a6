// Reading traces: nothing is believed before it has been checked.
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "files/memory.h"
#include "workload/trace_file.h"
#include "workload/trace_layout.h"

namespace icbench {
namespace {

using cache_file::Crc64;
using cache_file::Reader;
using namespace trace_layout;

class TraceReader {
 public:
  explicit TraceReader(const std::string& path) : path_(path) {}

  /// All but the operations.
  void read_header() {
    // Not blocking: a pipe without a writer would wait for one.
    file_.reset(::open(path_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
    struct stat there {};
    if (file_.get() < 0 || ::fstat(file_.get(), &there) != 0)
      fail(fmt::format("{}; name a file that can be read", std::strerror(errno)));
    if (!S_ISREG(there.st_mode)) fail("this is no regular file; name another");
    trace.bytes = static_cast<std::uint64_t>(there.st_size);
    std::array<unsigned char, kHeaderBytes> header{};
    const std::size_t read = read_some(header.data(), header.size(), 0);
    if (read < kMagic.size() || !std::equal(kMagic.begin(), kMagic.end(), header.begin()))
      fail_at(0, "this is no trace; icbench trace capture makes one");
    const std::uint32_t version = Reader(header.data() + kMagic.size()).word();
    if (read >= kMagic.size() + 4 && version != kVersion)
      fail_at(kMagic.size(), fmt::format("version {} is not known, {} is; capture anew", version, kVersion));
    if (read < kHeaderBytes)
      fail_at(read, fmt::format("the file ends within its header of {} bytes; it was cut off", kHeaderBytes));
    if (Reader(header.data() + kHeaderCrcAt).number(8) != cache_file::crc_of(header.data(), kHeaderCrcAt))
      fail_at(kHeaderCrcAt, "the header does not match its checksum; the file is damaged");
    take_header(header.data());
    require_checksum();
  }

  void read_body() {
    require_memory(fmt::format("the trace '{}'", path_),
                   body_ + operations_ * (sizeof(SurfacePoint) + sizeof(std::uint32_t)) +
                       (records_ + first_) * sizeof(TracedRecord));
    bytes_.resize(static_cast<std::size_t>(body_));
    if (read_some(bytes_.data(), bytes_.size(), kHeaderBytes) != bytes_.size())
      fail_at(kHeaderBytes, "the file has changed while it was read; try again");
    trace.points.reserve(static_cast<std::size_t>(operations_));
    trace.made.reserve(static_cast<std::size_t>(operations_));
    trace.records.reserve(static_cast<std::size_t>(records_ + first_));
    for (std::uint32_t i = 0; i < frames_; ++i) read_frame();
    if (at_ != bytes_.size() || trace.points.size() != operations_ ||
        trace.records.size() != records_ + first_ || trace.segments.size() != segments_ ||
        trace.tiles.size() != tiles_)
      refuse("the frames are not as many, or not as long, as the header says");
  }

  Trace trace;

 private:
  [[noreturn]] void fail(std::string_view why) const {
    throw std::runtime_error(fmt::format("cannot read the trace '{}': {}", path_, why));
  }
  [[noreturn]] void fail_at(std::uint64_t offset, std::string_view why) const {
    fail(fmt::format("at byte {}: {}", offset, why));
  }
  /// Of the body, which is as it was written, though not by this program, perhaps.
  [[noreturn]] void refuse(std::string_view why) const { fail_at(kHeaderBytes + at_, why); }

  std::size_t read_some(unsigned char* to, std::size_t n, std::uint64_t offset) const {
    const auto read = cache_file::read_at(file_.get(), to, n, offset);
    if (!read) fail(std::strerror(errno));
    return *read;
  }

  void take_header(const unsigned char* header) {
    if (Reader(header + kMagic.size() + 4).word() != kHeaderBytes)
      fail_at(kMagic.size() + 4, fmt::format("the header has not the {} bytes of version 1", kHeaderBytes));
    Reader in(header + kBodyAt);
    body_ = in.number(8);
    operations_ = in.number(8);
    records_ = in.number(8);
    first_ = in.number(8);
    frames_ = in.word();
    segments_ = in.word();
    tiles_ = in.word();
    // Each takes so many bytes at least: numbers that do not fit are refused before anything is allocated by them.
    if (trace.bytes - kHeaderBytes != body_)
      fail_at(kBodyAt,
              fmt::format("{} bytes follow the header, which tells of {}; the file was cut off or added to",
                          trace.bytes - kHeaderBytes, body_));
    const auto fits = [&](std::uint64_t n, std::uint64_t each) { return n <= body_ / each; };
    if (frames_ == 0) fail_at(kBodyAt, "it holds no frame");
    if (!fits(operations_, 1) || operations_ > kMostOperations || !fits(records_, kLeastRecordBytes) ||
        !fits(first_, cache_file::kRecordBytes) || records_ > operations_ || !fits(frames_, kFrameBytes) ||
        !fits(segments_, 4) || !fits(tiles_, kLeastTileBytes))
      fail_at(kBodyAt, "the numbers of operations, records and tiles do not fit the file's size");
    in = Reader(header + kConfigAt);
    trace.context.config = cache_file::read_config(in);
    if (const char* error = config_error(trace.context.config)) fail_at(kConfigAt, error);
    TraceContext& c = trace.context;
    in = Reader(header + kPictureAt);
    for (std::uint32_t* n : {&c.width, &c.height, &c.spp, &c.rays, &c.vpls}) *n = in.word();
    c.seed = in.number(8);
    const char* text = reinterpret_cast<const char*>(header + kTextsAt);
    for (std::string* to : {&c.scene, &c.integrator, &c.interpolation, &c.cache}) {
      to->assign(text, std::find(text, text + kMostTraceText, '\0'));
      // For a line on a terminal.
      std::replace_if(
          to->begin(), to->end(), [](char letter) { return letter < ' ' || letter > '~'; }, '?');
      text += kMostTraceText;
    }
    trace.checksum = Reader(header + kBodyCrcAt).number(8);
  }

  void require_checksum() const {
    std::array<unsigned char, 1 << 14> some;
    Crc64 crc;
    for (std::uint64_t done = 0; done < body_;) {
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(some.size(), body_ - done));
      const std::size_t read = read_some(some.data(), n, kHeaderBytes + done);
      if (read == 0) fail_at(kHeaderBytes + done, "the file has changed while it was read; try again");
      crc.add(some.data(), read);
      done += read;
    }
    if (crc.value() != trace.checksum)
      fail_at(kHeaderBytes, "the operations do not match their checksum; the file is damaged");
  }

  const unsigned char* take(std::size_t n) {
    if (bytes_.size() - at_ < n) refuse("the operations end within one");
    at_ += n;
    return bytes_.data() + at_ - n;
  }
  std::uint64_t number(int bytes) { return Reader(take(static_cast<std::size_t>(bytes))).number(bytes); }
  std::uint32_t word() { return static_cast<std::uint32_t>(number(4)); }
  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const std::uint64_t byte = number(1);
      value |= (byte & 0x7f) << shift;
      if (byte < 0x80) return value;
    }
    refuse("a number is too long");
  }
  glm::vec3 real_vector() { return Reader(take(12)).vector(); }
  glm::vec3 vector_near(unsigned codes, const glm::vec3& last) {
    glm::vec3 v;
    for (int axis = 0; axis < 3; ++axis) {
      const auto difference = static_cast<std::uint32_t>(number(kLengths[(codes >> (2 * axis)) & 3]));
      v[axis] = std::bit_cast<float>(std::bit_cast<std::uint32_t>(last[axis]) + unzigzag(difference));
    }
    return v;
  }

  void read_frame() {
    Trace::Frame frame;
    frame.number = word();
    const auto start = number(1);
    if (start > static_cast<unsigned>(FrameStart::replace)) refuse("a frame begins in an unknown way");
    frame.start = static_cast<FrameStart>(start);
    const std::uint32_t first = word(), segments = word();
    frame.stored = word();
    frame.digest = number(8);
    if (first != 0 && frame.start != FrameStart::replace)
      refuse("a frame lists records it does not begin with");
    frame.first.begin = static_cast<std::uint32_t>(trace.records.size());
    for (std::uint32_t i = 0; i < first; ++i) {
      TracedRecord r;
      r.record = cache_file::read_record(take(cache_file::kRecordBytes));
      require_storable(r);
      add(r);
    }
    frame.first.end = static_cast<std::uint32_t>(trace.records.size());
    frame.segments.begin = static_cast<std::uint32_t>(trace.segments.size());
    for (std::uint32_t i = 0; i < segments; ++i) {
      const std::uint32_t tiles = word();
      const auto begin = static_cast<std::uint32_t>(trace.tiles.size());
      for (std::uint32_t t = 0; t < tiles; ++t) read_tile();
      trace.segments.push_back({begin, begin + tiles});
    }
    frame.segments.end = static_cast<std::uint32_t>(trace.segments.size());
    trace.frames.push_back(frame);
  }

  void add(const TracedRecord& r) {
    if (trace.records.size() == records_ + first_) refuse("there are more records than the header says");
    trace.records.push_back(r);
  }

  void require_storable(const TracedRecord& r) const {
    if (is_storable(r.record, trace.context.config.bounds) != (r.result != InsertResult::rejected))
      refuse("a record is none that a cache of these bounds can hold, or was rejected although it is");
  }

  void read_tile() {
    Trace::Tile tile;
    const std::uint64_t thread = varint(), operations = varint(), bytes = varint();
    if (thread >= trace.context.config.max_sessions) refuse("a tile belongs to a thread that there is not");
    tile.thread = static_cast<std::uint32_t>(thread);
    if (bytes > bytes_.size() - at_) refuse("a tile is longer than the file");
    if (operations > operations_ - trace.points.size())
      refuse("there are more operations than the header says");
    const std::size_t end = at_ + static_cast<std::size_t>(bytes);
    tile.begin = static_cast<std::uint32_t>(trace.points.size());
    TraceDecoderState state;
    for (std::uint64_t i = 0; i < operations; ++i) read_operation(state);
    if (at_ != end) refuse("a tile's operations are longer or shorter than it says");
    tile.end = static_cast<std::uint32_t>(trace.points.size());
    trace.tiles.push_back(tile);
  }

  struct TraceDecoderState {
    SurfacePoint last{};
    std::uint32_t id = 0;
    std::vector<glm::vec3> normals;  // latest first
  };

  void read_operation(TraceDecoderState& s) {
    const auto control = static_cast<unsigned>(number(1));
    SurfacePoint x{vector_near(control >> 2, s.last.p), s.last.n};
    if ((control & 2u) != 0) {
      const auto token = static_cast<unsigned>(number(1));
      auto place = s.normals.end();
      if (token < 64) {
        if (token >= s.normals.size()) refuse("a normal is named that there was not");
        place = s.normals.begin() + token;
        x.n = *place;
        s.normals.erase(place);
      } else {
        if (token > 127) refuse("a normal has unknown bits");
        x.n = vector_near(token & 63u, s.last.n);
        if (s.normals.size() == TraceEncoder::kNormals) s.normals.pop_back();
      }
      s.normals.insert(s.normals.begin(), x.n);
    }
    s.last = x;
    trace.points.push_back(x);
    if ((control & 1u) == 0) {
      if (!is_askable(x, trace.context.config.bounds)) refuse("a query was answered where none can be");
      trace.made.push_back(Trace::kHit);
      return;
    }
    trace.made.push_back(static_cast<std::uint32_t>(trace.records.size()));
    read_record(s, x);
  }

  void read_record(TraceDecoderState& s, const SurfacePoint& x) {
    TracedRecord r;
    const auto bits = static_cast<unsigned>(number(1));
    const unsigned result = (bits >> kResultShift) & 3u;
    if (result > static_cast<unsigned>(InsertResult::rejected) || bits >= 2u * TracedRecord::kElsewhere)
      refuse("a record has unknown bits");
    r.flags = static_cast<std::uint8_t>(bits & (kFlags | TracedRecord::kElsewhere));
    r.result = static_cast<InsertResult>(result);
    const bool is_there = (bits & TracedRecord::kElsewhere) == 0;
    r.record.p = is_there ? x.p : real_vector();
    r.record.n = is_there ? x.n : real_vector();
    r.record.R = Reader(take(4)).real();
    r.record.E = real_vector();
    r.record.id = s.id + unzigzag(static_cast<std::uint32_t>(varint()));
    r.cost_ns = varint();
    if (r.cost_ns > kMostCost) refuse("a record took longer than any does");
    s.id = r.record.id;
    require_storable(r);
    add(r);
  }

  std::string path_;
  cache_file::Descriptor file_;
  std::uint64_t body_ = 0, operations_ = 0, records_ = 0, first_ = 0;
  std::uint32_t frames_ = 0, segments_ = 0, tiles_ = 0;
  std::vector<unsigned char> bytes_;
  std::size_t at_ = 0;
};

}  // namespace

Trace read_trace(const std::string& path) {
  TraceReader reader(path);
  reader.read_header();
  reader.read_body();
  return std::move(reader.trace);
}

Trace read_trace_header(const std::string& path) {
  TraceReader reader(path);
  reader.read_header();
  return std::move(reader.trace);
}

}  // namespace icbench
