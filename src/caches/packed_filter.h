// How lanes are tested: one by one, or many at once by the widest vectors of the machine that the program runs on.
//
// The vectors are Highway's, compiled once for every kind of machine and chosen when the program starts
// (packed_filter.cpp). All widths and the scalar code keep the same lanes (caches/packed_lanes.h).
//
// Lanes outside the mask are never loaded: another thread may be writing them. Where the machine has loads under a
// mask, which do not touch what is masked out, partly filled chunks are loaded by these; elsewhere, and under
// ThreadSanitizer, which does not see such loads, their lanes are copied one by one first.
#pragma once

#include <string_view>
#include <vector>

#include "caches/packed_lanes.h"

namespace icbench {

/// One lane after the other: the reference.
struct ScalarLanes {
  static LaneKernels best() noexcept {
    return {filter_lanes_scalar, weigh_records_scalar, add_records_scalar};
  }
};

/// Many at once.
struct SimdLanes {
  static LaneKernels best() noexcept;
};

/// A width of vectors that this machine has.
struct NamedLaneKernels {
  std::string_view name;  ///< Highway's
  LaneKernels kernels;
};

/// All of them; the scalar code is not among them.
std::vector<NamedLaneKernels> lane_kernels();

}  // namespace icbench
