#include "workload/trace_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <utility>

#include "core/random.h"
#include "files/memory.h"
#include "workload/trace_layout.h"

namespace icbench {
namespace {

using cache_file::Writer;
using namespace trace_layout;

bool same_bits(const glm::vec3& a, const glm::vec3& b) noexcept { return std::memcmp(&a, &b, sizeof a) == 0; }

}  // namespace

void RecordsDigest::add(const Record& r) noexcept {
  std::array<unsigned char, cache_file::kRecordBytes> bytes;
  cache_file::write_record(bytes.data(), r);
  sum_ += hash_keys(cache_file::crc_of(bytes.data(), bytes.size()));
}

// ---- operations to bytes

TraceEncoder::TraceEncoder(std::uint64_t operations)
    : bytes_(static_cast<std::size_t>(12 * operations + kMostOperationBytes)) {}

void TraceEncoder::begin_tile() noexcept { state_ = {}; }

void TraceEncoder::State::meet(std::size_t place, const glm::vec3& n) noexcept {
  std::copy_backward(normals.begin(), normals.begin() + static_cast<std::ptrdiff_t>(place),
                     normals.begin() + static_cast<std::ptrdiff_t>(place) + 1);
  normals[0] = n;
}

void TraceEncoder::put(std::uint64_t value, int bytes) noexcept {
  for (; bytes > 0; --bytes, value >>= 8) bytes_[size_++] = static_cast<unsigned char>(value & 0xff);
}

void TraceEncoder::put_varint(std::uint64_t value) noexcept {
  for (; value > 0x7f; value >>= 7) bytes_[size_++] = static_cast<unsigned char>(value | 0x80);
  bytes_[size_++] = static_cast<unsigned char>(value);
}

unsigned char TraceEncoder::put_vector(const glm::vec3& v, const glm::vec3& last) noexcept {
  unsigned codes = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::uint32_t difference =
        zigzag(std::bit_cast<std::uint32_t>(v[axis]) - std::bit_cast<std::uint32_t>(last[axis]));
    const unsigned code = length_code(difference);
    put(difference, kLengths[code]);
    codes |= code << (2 * axis);
  }
  return static_cast<unsigned char>(codes);
}

void TraceEncoder::query(const SurfacePoint& x, bool is_hit) noexcept {
  if (bytes_.size() - size_ < kMostOperationBytes) bytes_.resize(2 * bytes_.size());
  State& s = state_;
  const std::size_t control = size_++;
  unsigned bits = is_hit ? 0u : 1u;
  bits |= static_cast<unsigned>(put_vector(x.p, s.last.p)) << 2;
  if (!same_bits(x.n, s.last.n)) {
    bits |= 2u;
    const auto known = s.normals.begin() + static_cast<std::ptrdiff_t>(s.known);
    const auto at =
        std::find_if(s.normals.begin(), known, [&](const glm::vec3& n) { return same_bits(n, x.n); });
    if (at != known) {
      const auto place = static_cast<std::size_t>(at - s.normals.begin());
      put(place, 1);
      s.meet(place, x.n);
    } else {
      const std::size_t token = size_++;
      bytes_[token] = static_cast<unsigned char>(64u | put_vector(x.n, s.last.n));
      s.known = std::min(s.known + 1, kNormals);
      s.meet(s.known - 1, x.n);
    }
  }
  bytes_[control] = static_cast<unsigned char>(bits);
  s.last = x;
}

void TraceEncoder::record(const TracedRecord& r) noexcept {
  const Record& made = r.record;
  const bool is_there = same_bits(made.p, state_.last.p) && same_bits(made.n, state_.last.n);
  put((r.flags & kFlags) | (static_cast<unsigned>(r.result) << kResultShift) |
          (is_there ? 0u : TracedRecord::kElsewhere),
      1);
  const auto put_real = [&](float x) { put(std::bit_cast<std::uint32_t>(x), 4); };
  const auto put_all = [&](const glm::vec3& v) {
    for (int axis = 0; axis < 3; ++axis) put_real(v[axis]);
  };
  if (!is_there) {
    put_all(made.p);
    put_all(made.n);
  }
  put_real(made.R);
  put_all(made.E);
  put_varint(zigzag(made.id - state_.id));
  put_varint(std::min(r.cost_ns, kMostCost));
  state_.id = made.id;
}

// ---- writing

TraceWriter::TraceWriter(const std::string& path, const TraceContext& context)
    : file_(path, "the trace"), context_(context) {
  if (const Failure failed = file_.open()) throw std::runtime_error(*failed);
}

std::uint64_t TraceWriter::bytes() const noexcept { return kHeaderBytes + body_; }

void TraceWriter::write(const unsigned char* bytes, std::size_t n) {
  crc_.add(bytes, n);
  file_.write(bytes, n, kHeaderBytes + body_);
  body_ += n;
}

void TraceWriter::add(CapturedFrame frame) {
  std::array<unsigned char, kFrameBytes> head;
  Writer out(head.data());
  out.word(frame.number);
  out.number(static_cast<unsigned>(frame.start), 1);
  out.word(static_cast<std::uint32_t>(frame.first.size()));
  out.word(frame.segments);
  out.word(frame.stored);
  out.number(frame.digest, 8);
  write(head.data(), head.size());
  for (const Record& r : frame.first) {
    std::array<unsigned char, cache_file::kRecordBytes> bytes;
    cache_file::write_record(bytes.data(), r);
    write(bytes.data(), bytes.size());
  }
  std::sort(frame.tiles.begin(), frame.tiles.end(), [](const auto& a, const auto& b) {
    return std::pair(a.segment, a.order) < std::pair(b.segment, b.order);
  });
  auto tile = frame.tiles.begin();
  for (std::uint32_t segment = 0; segment < frame.segments; ++segment) {
    const auto end =
        std::find_if(tile, frame.tiles.end(), [&](const auto& t) { return t.segment != segment; });
    std::array<unsigned char, 4> count;
    Writer(count.data()).word(static_cast<std::uint32_t>(end - tile));
    write(count.data(), count.size());
    for (; tile != end; ++tile) {
      std::array<unsigned char, 30> numbers;
      std::size_t n = 0;
      for (std::uint64_t value : {std::uint64_t{tile->thread}, std::uint64_t{tile->operations},
                                  std::uint64_t{tile->bytes.size()}}) {
        for (; value > 0x7f; value >>= 7) numbers[n++] = static_cast<unsigned char>(value | 0x80);
        numbers[n++] = static_cast<unsigned char>(value);
      }
      write(numbers.data(), n);
      write(tile->bytes.data(), tile->bytes.size());
      operations_ += tile->operations;
      records_ += tile->records;
    }
  }
  ++frames_;
  segments_ += frame.segments;
  tiles_ += static_cast<std::uint32_t>(frame.tiles.size());
  first_ += frame.first.size();
  if (operations_ > kMostOperations || records_ + first_ > kMostOperations) {
    throw std::runtime_error(fmt::format(
        "a trace holds {} operations at most; capture fewer frames, samples or pixels", kMostOperations));
  }
}

void TraceWriter::finish() {
  std::array<unsigned char, kHeaderBytes> header{};
  std::copy(kMagic.begin(), kMagic.end(), header.begin());
  Writer out(header.data() + kMagic.size());
  out.word(kVersion);
  out.word(kHeaderBytes);
  for (const std::uint64_t n : {body_, operations_, records_, first_}) out.number(n, 8);
  for (const std::uint32_t n : {frames_, segments_, tiles_}) out.word(n);
  cache_file::write_config(out, context_.config);
  for (const std::uint32_t n : {context_.width, context_.height, context_.spp, context_.rays, context_.vpls})
    out.word(n);
  out.number(context_.seed, 8);
  unsigned char* to = header.data() + kTextsAt;
  for (const std::string* text :
       {&context_.scene, &context_.integrator, &context_.interpolation, &context_.cache}) {
    const std::size_t n = std::min(text->size(), kMostTraceText);
    std::copy(text->end() - static_cast<std::ptrdiff_t>(n), text->end(), to);
    to += kMostTraceText;
  }
  Writer(header.data() + kBodyCrcAt).number(crc_.value(), 8);
  Writer(header.data() + kHeaderCrcAt).number(cache_file::crc_of(header.data(), kHeaderCrcAt), 8);
  file_.write(header.data(), header.size(), 0);
  if (const Failure failed = file_.finish()) throw std::runtime_error(*failed);
}

}  // namespace icbench
