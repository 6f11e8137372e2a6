#include "stress/explore/memory.h"

#include <utility>

#include "core/random.h"

namespace icbench::stress::explore {

namespace {

bool acquires(std::memory_order o) noexcept {
  return o == std::memory_order_acquire || o == std::memory_order_acq_rel || o == std::memory_order_seq_cst ||
         o == std::memory_order_consume;
}
bool releases(std::memory_order o) noexcept {
  return o == std::memory_order_release || o == std::memory_order_acq_rel || o == std::memory_order_seq_cst;
}

/// What the step makes of `value`, if it writes.
std::optional<std::uint64_t> written_over(const Access& a, std::uint64_t value) noexcept {
  switch (a.kind) {
    case Access::Kind::load:
      return std::nullopt;
    case Access::Kind::store:
    case Access::Kind::exchange:
      return a.operand;
    case Access::Kind::add:
      return (value + a.operand) & a.mask;
    case Access::Kind::compare_exchange:
      return value == a.expected ? std::optional(a.operand) : std::nullopt;
    case Access::Kind::lock:
      return Access::kExclusive;
    case Access::Kind::unlock:
      return 0;
    case Access::Kind::lock_shared:
      return value + 1;
    case Access::Kind::unlock_shared:
      return value - 1;
  }
  return std::nullopt;
}

}  // namespace

Memory::Memory() : locations_(kMaxLocations), buckets_(kBuckets) {}

void Memory::reset(unsigned threads) noexcept {
  for (unsigned t = 0; t < threads; ++t) {
    threads_[t] = {};
    threads_[t].known.at[t] = 1;  // what a thread does before its first step is not known to the others
  }
  used_ = 0;
  ++execution_;
  touches_.clear();
  total_past_ = {};
  total_view_ = {};
  exhausted_ = false;
}

Memory::Store& Memory::add_store(Word& w) {
  if (w.count == w.stores.size()) w.stores.emplace_back();
  if (w.count == Choices::kMost) exhausted_ = true;
  return w.stores[w.count++];
}

Location Memory::locate(const Access& a) {
  const auto key = static_cast<std::uint64_t>(reinterpret_cast<std::uintptr_t>(a.address));
  for (std::uint64_t i = mix64(key);; ++i) {
    Bucket& b = buckets_[i % kBuckets];
    if (b.execution == execution_ && b.address == a.address) return b.location;
    if (b.execution == execution_) continue;
    if (used_ == kMaxLocations) {
      exhausted_ = true;
      return 0;
    }
    b = {a.address, execution_, used_};
    Word& w = locations_[used_];
    w.address = a.address;
    w.count = 0;
    Store& initial = add_store(w);
    initial.value = a.in_place;
    initial.released = initial.past = {};
    initial.view = {};
    return used_++;
  }
}

Choices Memory::choices(unsigned thread, const Access& a, Location l) const noexcept {
  Choices out;
  const Word& w = locations_[l];
  const unsigned latest = w.count - 1;
  const std::uint64_t value = w.stores[latest].value;
  const auto latest_if = [&](bool possible) {
    if (possible) out.index[out.count++] = static_cast<std::uint16_t>(latest);
    return out;
  };
  if (a.kind == Access::Kind::lock) return latest_if(value == 0);
  if (a.kind == Access::Kind::lock_shared) return latest_if(value < Access::kExclusive);
  if (a.kind != Access::Kind::load && a.kind != Access::Kind::compare_exchange) return latest_if(true);

  const Thread& t = threads_[thread];
  unsigned oldest = t.view.oldest[l];
  if (a.is_seq_cst()) oldest = std::max<unsigned>(oldest, total_view_.oldest[l]);
  if (t.is_waiting && t.last == l) oldest = std::max(oldest, t.last_index + 1);
  for (unsigned i = w.count; i > oldest && out.count < Choices::kMost;) {
    --i;
    // A strong compare-exchange does not fail by the value that it expects.
    if (a.kind == Access::Kind::compare_exchange && i != latest && w.stores[i].value == a.expected) continue;
    out.index[out.count++] = static_cast<std::uint16_t>(i);
  }
  return out;
}

Effect Memory::perform(unsigned thread, const Access& a, Location l, unsigned index) {
  Thread& t = threads_[thread];
  Word& w = locations_[l];
  Effect effect;
  effect.index = index;
  effect.read = w.stores[index].value;
  effect.is_stale = index + 1 != w.count;
  const std::optional<std::uint64_t> written = written_over(a, effect.read);
  effect.wrote = written.has_value();
  const std::memory_order order =
      a.kind == Access::Kind::compare_exchange && !effect.wrote ? a.failure : a.order;
  const bool in_total_order = a.is_seq_cst();
  if (in_total_order) t.past.join(total_past_);
  ++t.past.at[thread];
  if (!a.is_blind()) {
    const Store& from = w.stores[index];
    t.view.oldest[l] = std::max(t.view.oldest[l], static_cast<std::uint16_t>(index));
    if (acquires(order)) {
      t.known.join(from.released);
      t.view.join(from.view);
    }
    t.past.join(from.past);
    t.last = l;
    t.last_index = index;
    t.has_read = true;
    t.is_waiting = false;
  }
  if (effect.wrote) {
    effect.written = *written;
    t.has_changed |= a.is_blind() || effect.written != effect.read;
    Store& s = add_store(w);
    const Store& before = w.stores[w.count - 2];
    t.past.join(before.past);
    t.view.oldest[l] = static_cast<std::uint16_t>(w.count - 1);
    s.value = effect.written;
    s.past = t.past;
    if (releases(order)) {
      s.released = t.known;
      s.view = t.view;
    } else {
      s.released = {};
      s.view = {};
    }
    if (!a.is_blind()) {  // a read-modify-write goes on with the release sequence
      s.released.join(before.released);
      s.view.join(before.view);
    }
  }
  if (in_total_order) {
    total_view_.oldest[l] = t.view.oldest[l];
    total_past_.join(t.past);
  }
  ++t.known.at[thread];  // what comes now is not part of what was released
  return effect;
}

void Memory::await_newer(unsigned thread) noexcept {
  Thread& t = threads_[thread];
  t.is_waiting = t.has_read;
  t.may_go_on = std::exchange(t.has_changed, false) && !std::exchange(t.went_on, true);
}

std::optional<Race> Memory::touch(unsigned thread, const void* begin, std::size_t bytes, bool writes) {
  return touch(thread, begin, bytes, writes, false);
}

std::optional<Race> Memory::zero(unsigned thread, const void* begin, std::size_t bytes) {
  const auto* first = static_cast<const std::byte*>(begin);
  for (Location l = 0; l < used_; ++l) {
    const auto* word = static_cast<const std::byte*>(locations_[l].address);
    if (word >= first && word < first + bytes) return Race{begin, bytes, thread, thread, true, true, true};
  }
  return touch(thread, begin, bytes, true, true);
}

std::optional<Race> Memory::race_with_zeroing(unsigned thread, const Access& a) const noexcept {
  const auto* word = static_cast<const std::byte*>(a.address);
  for (const Touch& zeroing : touches_) {
    if (!zeroing.zeroes || zeroing.thread == thread) continue;
    if (word < zeroing.begin || word >= zeroing.begin + zeroing.bytes) continue;
    if (zeroing.time > threads_[thread].known.at[zeroing.thread])
      return Race{a.address, zeroing.bytes, zeroing.thread, thread, true, a.may_write(), true};
  }
  return std::nullopt;
}

std::optional<Race> Memory::touch(unsigned thread, const void* begin, std::size_t bytes, bool writes,
                                  bool zeroes) {
  const auto* first = static_cast<const std::byte*>(begin);
  const VectorClock& known = threads_[thread].known;
  Touch* same = nullptr;
  for (Touch& other : touches_) {
    if (other.begin >= first + bytes || first >= other.begin + other.bytes) continue;
    if (other.thread == thread) {
      if (other.begin == first && other.bytes == bytes && other.writes == writes && other.zeroes == zeroes)
        same = &other;
      continue;
    }
    if ((writes || other.writes) && other.time > known.at[other.thread])
      return Race{begin, bytes, other.thread, thread, other.writes, writes};
  }
  if (same != nullptr) {
    same->time = known.at[thread];
  } else {
    touches_.push_back({first, bytes, known.at[thread], static_cast<std::uint8_t>(thread), writes, zeroes});
  }
  return std::nullopt;
}

const char* name_of(Access::Kind kind) noexcept {
  constexpr const char* kNames[] = {"load", "store",       "add",    "exchange",     "compare-exchange",
                                    "lock", "lock shared", "unlock", "unlock shared"};
  return kNames[static_cast<std::size_t>(kind)];
}

const char* name_of(std::memory_order order) noexcept {
  switch (order) {
    case std::memory_order_relaxed:
      return "relaxed";
    case std::memory_order_acquire:
    case std::memory_order_consume:
      return "acquire";
    case std::memory_order_release:
      return "release";
    case std::memory_order_acq_rel:
      return "acq_rel";
    default:
      return "seq_cst";
  }
}

}  // namespace icbench::stress::explore
