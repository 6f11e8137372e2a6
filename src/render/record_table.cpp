#include "render/record_table.h"

#include <utility>

namespace icbench {

// Relaxed throughout: counters only have to give distinct places; the lists behind them change when quiescent, and a
// block is used by the thread that took it until the next quiescent point.

void RecordTable::widen(std::size_t words) {
  const std::size_t before = std::exchange(words_, words);
  if (words == before) return;
  for (std::uint32_t b = 0; b < blocks_used(); ++b) {
    std::unique_ptr<std::uint64_t[]>& bits = blocks_[b]->bits;
    if (bits == nullptr) continue;
    auto wider = std::make_unique<std::uint64_t[]>(kBlock * words);
    for (std::uint32_t i = 0; i < kBlock; ++i)
      std::copy_n(bits.get() + i * before, before, wider.get() + i * words);
    bits = std::move(wider);
  }
}

void RecordTable::release(std::span<const std::uint32_t> ids) {
  for (Released& r : released_) {
    r.ids.erase(r.ids.begin(), r.ids.begin() + static_cast<std::ptrdiff_t>(r.gone()));
    r.taken.store(0, std::memory_order_relaxed);
  }
  for (const std::uint32_t id : ids) {
    (*this)[id].state = KeptRecord::free;
    released_[static_cast<std::size_t>(bits_of(id))].ids.push_back(id);
  }
  if (blocks_used() < blocks_.size()) return;
  // No block is left: what is free has to do for records of both kinds.
  auto& [without, with] = released_;
  for (const std::uint32_t id : without.ids) {
    if (bits_of(id) == LightBits::no) block(id)->bits = std::make_unique<std::uint64_t[]>(kBlock * words_);
    with.ids.push_back(id);
  }
  without.ids.clear();
}

void RecordTable::clear() noexcept {
  for (Purse& purse : purses_)
    for (auto& ids : purse.ids) ids.clear();
  for (Released& r : released_) {
    r.ids.clear();
    r.taken.store(0, std::memory_order_relaxed);
  }
  for (auto& block : blocks_) block.reset();
  next_block_.store(0, std::memory_order_relaxed);
}

std::size_t RecordTable::bytes() const noexcept {
  std::size_t bytes = 0;
  for (std::uint32_t b = 0; b < blocks_used(); ++b) {
    bytes += sizeof(blocks_[b]) + sizeof(Block);
    if (blocks_[b]->bits != nullptr) bytes += kBlock * words_ * sizeof(std::uint64_t);
  }
  return bytes;
}

void RecordTable::take_released(Released& released, std::vector<std::uint32_t>& purse) {
  if (released.gone() >= released.ids.size()) return;
  const std::size_t first = released.taken.fetch_add(kBlock, std::memory_order_relaxed);
  for (std::size_t i = first; i < std::min<std::size_t>(first + kBlock, released.ids.size()); ++i)
    purse.push_back(released.ids[i]);
}

void RecordTable::refill(std::vector<std::uint32_t>& purse, LightBits bits) {
  take_released(released_[static_cast<std::size_t>(bits)], purse);
  if (!purse.empty()) return;
  const std::uint32_t b = next_block_.load(std::memory_order_relaxed) < blocks_.size()
                              ? next_block_.fetch_add(1, std::memory_order_relaxed)
                              : static_cast<std::uint32_t>(blocks_.size());
  if (b >= blocks_.size()) {
    if (bits == LightBits::no) take_released(released_[static_cast<std::size_t>(LightBits::yes)], purse);
    return;
  }
  auto block = std::make_unique<Block>();
  if (bits == LightBits::yes) block->bits = std::make_unique<std::uint64_t[]>(kBlock * words_);
  blocks_[b] = std::move(block);
  for (std::uint32_t i = kBlock; i > 0; --i) purse.push_back(b * kBlock + i - 1);
}

}  // namespace icbench
