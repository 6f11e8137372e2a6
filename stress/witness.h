// Counterexamples in words: the operations of a violation with their threads and times. Stamps count from the
// epoch's first call.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "stress/history.h"

namespace icbench::stress {

/// A line that says what is wrong, then one line per operation, such as
/// "thread 3 [1041, 1077] insert of record 12, place 0, size 2".
std::string witness_text(const History& history, const Epoch& epoch, std::string_view what,
                         std::span<const std::uint32_t> operations);

/// A cycle: each operation must precede the next, the last the first, and under each stands why.
std::string cycle_text(const History& history, const Epoch& epoch, std::span<const std::uint32_t> cycle);

}  // namespace icbench::stress
