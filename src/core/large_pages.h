// Large pages: a page table's entries for memory that is read at random then fit where the processor keeps them.
#pragma once

#include <cstddef>
#include <cstdint>

namespace icbench {

/// Bytes of a large page, as a rule.
inline constexpr std::size_t kLargePage = std::size_t{1} << 21;

/// Whether a cache asks the system for large pages, which it may refuse. They spare address translations, and cost the
/// clearing of a whole one, 2 MiB as a rule, where a little of it is used.
enum class LargePages : std::uint8_t { never, when_large, always };

}  // namespace icbench
