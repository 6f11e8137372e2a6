// The bytes of a file, to be changed and written back.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

namespace icbench {

using Bytes = std::vector<unsigned char>;

inline Bytes bytes_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void put(const std::filesystem::path& path, const Bytes& bytes) {
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace icbench
