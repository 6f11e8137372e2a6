// Where things are in a trace (workload/trace_file.h): what its writer and its reader agree on.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "workload/trace_file.h"

namespace icbench::trace_layout {

inline constexpr std::array<unsigned char, 8> kMagic = {0x89, 'I', 'C', 'T', '\r', '\n', 0x1a, '\n'};
inline constexpr std::uint32_t kVersion = 1;

// The header.
//
//     0   8  magic
//     8   4  version
//    12   4  bytes of this header
//    16   8  bytes that follow it
//    24   8  operations
//    32   8  records that misses made
//    40   8  records that frames begin with
//    48  12  frames, segments, tiles
//    60  40  capacity, max_sessions, a_max, a, bounds: as in caches/cache_file_bytes.h
//   100  20  width, height, spp, rays, vpls
//   120   8  seed
//   128 256  scene, integrator, interpolation, cache: each 64 bytes, zeros after the text
//   384   8  CRC of what follows the header
//   392   8  CRC of the 392 bytes above
inline constexpr std::size_t kHeaderBytes = 400, kFrameBytes = 25, kLeastTileBytes = 3;
inline constexpr std::size_t kBodyAt = 16, kConfigAt = 60, kPictureAt = 100, kTextsAt = 128, kBodyCrcAt = 384,
                             kHeaderCrcAt = 392;
static_assert(kTextsAt + 4 * kMostTraceText == kBodyCrcAt && kHeaderCrcAt + 8 == kHeaderBytes);

// Flags, R, E, id, cost.
inline constexpr std::size_t kLeastRecordBytes = 1 + 16 + 1 + 1;
inline constexpr std::size_t kMostOperationBytes = 1 + 12 + 13 + 1 + 24 + 16 + 5 + 10;
// So that places of operations and records fit in 32 bits, with some to spare.
inline constexpr std::uint64_t kMostOperations = 1u << 30;
// No record takes a quarter of an hour; replaying one that says so would look like a hang.
inline constexpr std::uint64_t kMostCost = 1'000'000'000'000;

// Bytes of a difference, by its two bits.
inline constexpr std::array<int, 4> kLengths = {0, 2, 3, 4};

constexpr unsigned length_code(std::uint32_t difference) noexcept {
  return difference == 0 ? 0 : difference < (1u << 16) ? 1 : difference < (1u << 24) ? 2 : 3;
}

// Small for a small difference of either sign.
constexpr std::uint32_t zigzag(std::uint32_t difference) noexcept {
  return (difference << 1) ^ (0u - (difference >> 31));
}
constexpr std::uint32_t unzigzag(std::uint32_t z) noexcept { return (z >> 1) ^ (0u - (z & 1)); }

// The byte of a record: these bits, its result, and TracedRecord::kElsewhere.
inline constexpr std::uint8_t kFlags = TracedRecord::kRefusedAnswer | TracedRecord::kAskedNeighbours;
inline constexpr unsigned kResultShift = 2;

}  // namespace icbench::trace_layout
