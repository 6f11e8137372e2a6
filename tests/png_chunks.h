// Chunks of PNG images (PNG specification, section 5), to be put where tests want them.
#pragma once

#include <zlib.h>

#include <cstddef>
#include <string>
#include <string_view>

namespace icbench {

inline std::string big_endian(std::size_t value) {
  std::string bytes;
  for (const int shift : {24, 16, 8, 0}) bytes += static_cast<char>(value >> shift);
  return bytes;
}

inline std::string png_chunk(std::string_view type, const std::string& data) {
  const std::string body = std::string(type) + data;
  return big_endian(data.size()) + body +
         big_endian(crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size())));
}

/// Where chunks may stand that come before the samples: behind the signature and the header.
inline constexpr std::size_t kBehindPngHeader = 33;

}  // namespace icbench
