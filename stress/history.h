// Histories: what threads asked of a cache, what they were told, and when.
//
// A history is a sequence of epochs; an epoch lies between two quiescent points. Its operations overlap in
// time only with each other. At the quiescent point that ends it, the cache's contents are noted, records may
// be dropped by an update, and all may be cleared.
//
// Which records are valid where is part of the history: a record is of a kind (a place and a size), a query
// asks at a place, and ValidityTable says which kinds are valid at which places.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/types.h"

namespace icbench::stress {

/// Stamp of the stress clock. Operation a precedes b in real time exactly if a.ret < b.call; equal stamps
/// count as overlapping, so a coarse clock loses strength but is never unjust.
using Stamp = std::uint64_t;

/// Return stamp of an operation that never returned.
inline constexpr Stamp kPending = ~Stamp{0};

/// Set in an id under which a record was shown whose content is not what was inserted under that id.
inline constexpr std::uint32_t kTorn = 1u << 31;

struct Operation {
  enum class Type : std::uint8_t { insert, query };

  Stamp call;
  Stamp ret;
  std::uint32_t thread;
  std::uint32_t where;  ///< query: place; insert: kind of the record
  std::uint32_t first;  ///< query: first of its ids in History::seen; insert: the record's id
  std::uint32_t count;  ///< query: number of ids seen; insert: 0
  Type type;
  InsertResult result;  ///< insert that returned

  bool is_query() const noexcept { return type == Type::query; }
  bool is_pending() const noexcept { return ret == kPending; }
  /// An insert that was refused changes nothing; any other may.
  bool is_refused() const noexcept {
    return type == Type::insert && !is_pending() && result != InsertResult::inserted;
  }
};

/// Operations [first, end) of History::operations: thread after thread, each in program order.
struct Epoch {
  std::uint32_t first = 0;
  std::uint32_t end = 0;
  bool has_contents = false;            ///< `contents` was taken at the end
  std::vector<std::uint32_t> contents;  ///< ids the cache held, with kTorn
  std::vector<std::uint32_t> dropped;   ///< ids dropped at the end
  bool clears = false;                  ///< the cache was cleared at the end
};

/// Which kinds of records are valid at which places. Kind = place * sizes + size.
class ValidityTable {
 public:
  ValidityTable(std::uint32_t places, std::uint32_t sizes)
      : places_(places),
        sizes_(sizes),
        valid_(std::size_t{places} * places * sizes),
        places_of_(std::size_t{places} * sizes) {}

  void set_valid(std::uint32_t place, std::uint32_t kind) {
    valid_[index(place, kind)] = 1;
    places_of_[kind].push_back(place);
  }

  bool is_valid(std::uint32_t place, std::uint32_t kind) const noexcept {
    return valid_[index(place, kind)] != 0;
  }
  std::span<const std::uint32_t> places_of(std::uint32_t kind) const noexcept { return places_of_[kind]; }

  std::uint32_t places() const noexcept { return places_; }
  std::uint32_t sizes() const noexcept { return sizes_; }
  std::uint32_t kinds() const noexcept { return places_ * sizes_; }

 private:
  std::size_t index(std::uint32_t place, std::uint32_t kind) const noexcept {
    return std::size_t{place} * places_ * sizes_ + kind;
  }

  std::uint32_t places_;
  std::uint32_t sizes_;
  std::vector<std::uint8_t> valid_;
  std::vector<std::vector<std::uint32_t>> places_of_;
};

/// Invariants: every id is offered by at most one insert and lies in [0, ids); a thread's stamps rise, but for the
/// queries of a batch, which all have the call and the return of the whole; only the last epoch has operations that are
/// pending.
struct History {
  const ValidityTable* validity = nullptr;
  std::uint32_t ids = 0;  ///< ids lie in [0, ids), < kTorn
  std::vector<Operation> operations;
  std::vector<std::uint32_t> seen;
  std::vector<Epoch> epochs;

  std::span<const std::uint32_t> seen_by(const Operation& query) const noexcept {
    return std::span(seen).subspan(query.first, query.count);
  }
};

}  // namespace icbench::stress
