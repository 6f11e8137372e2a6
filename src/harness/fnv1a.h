// A hash that tells files and configurations apart; no guard against forgery.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace icbench {

/// FNV-1a of 64 bits (Fowler, Noll, Vo), of bytes that may come in pieces.
class Fnv1a {
 public:
  void add(std::string_view bytes) noexcept {
    for (const char c : bytes) value_ = (value_ ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  }
  /// Sixteen hexadecimal digits.
  std::string digits() const { return fmt::format("{:016x}", value_); }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325u;
};

}  // namespace icbench
