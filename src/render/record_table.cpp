#include "render/record_table.h"

#include <algorithm>
#include <utility>

namespace icbench {

void RecordTable::widen(std::size_t words) {
  const std::size_t before = std::exchange(words_, words);
  if (words == before) return;
  for (std::uint32_t b = 0; b < blocks_used(); ++b) {
    auto wider = std::make_unique<std::uint64_t[]>(kBlock * words);
    for (std::uint32_t i = 0; i < kBlock; ++i)
      std::copy_n(blocks_[b]->bits.get() + i * before, before, wider.get() + i * words);
    blocks_[b]->bits = std::move(wider);
  }
}

}  // namespace icbench
