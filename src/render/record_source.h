// Where the records of a cache come from: the part of a cached integrator that knows light but no cache.
//
// The other part, a pass over stored primary hits, is templated on the cache and asks for a record at a miss: one
// virtual call for some hundred rays. Between frames the source says what becomes of the records it made.
#pragma once

#include <cstdint>
#include <span>

#include "core/types.h"
#include "render/crew.h"
#include "render/extrapolation.h"
#include "render/primary.h"
#include "render/ray_tracer.h"
#include "render/sampling.h"

namespace icbench {

/// What threads did to a cache.
struct CacheUse {
  std::uint64_t queries = 0;   ///< a hit of a pixel that asks again counts once more
  std::uint64_t hits = 0;      ///< queries answered by the cache; each of the others made a record
  std::uint64_t inserts = 0;   ///< accepted
  std::uint64_t full = 0;      ///< refused: out of capacity
  std::uint64_t rejected = 0;  ///< refused: not storable
  LeakTests leaks;             ///< of the guard, where there is one

  void count(InsertResult result) noexcept;
  CacheUse& operator+=(const CacheUse& o) noexcept;
};

/// What a pass did in one frame, apart from rays.
struct PassFigures {
  CacheUse use;
  std::uint64_t records = 0;  ///< in the cache at the end
  // By sources that judge each record alone; 0 by the others, whose records all stay or all go.
  std::uint64_t records_kept = 0;     ///< of those there were at the beginning, left as they were
  std::uint64_t records_updated = 0;  ///< of those, given a new irradiance or radius
  std::uint64_t records_dropped = 0;  ///< of those, removed
  std::uint64_t light_paths = 0;      ///< that the virtual lights come from
  std::uint64_t light_paths_retraced = 0;
  std::uint64_t vpls_in_use = 0;         ///< virtual lights there are: about as many as were asked for
  std::uint64_t lock_wait_ns = 0;        ///< nanoseconds that threads waited for the cache's locks
  std::uint64_t bytes_beside_cache = 0;  ///< kept for records beside what the cache keeps
  std::uint64_t bytes_of_details = 0;    ///< of these, what interpolation reads: gradients, marks of leaks
};

/// What becomes of the records in the cache as a frame begins.
enum class RecordsThen : std::uint8_t {
  stay,    ///< all are as a new one would be
  update,  ///< RecordSource::update tells for each
  go       ///< the cache is to be cleared
};

/// Which records queries tell about.
enum class UseToTell : std::uint8_t {
  nothing,
  answering,  ///< all that answer
  needed  ///< one that covers the point, the same for as many queries as can be (NeededRecord); never where leaks
          ///< are guarded against, since the guard may leave out any of them
};

class RecordSource {
 public:
  virtual ~RecordSource() = default;

  /// Quiescent, once before each frame's samples; `change` is what RayTracer::go_to altered since the last call.
  virtual RecordsThen begin_frame(const SceneChange& change, Crew& crew) = 0;

  /// Quiescent, before begin_frame: more than a few of the last frame's records found no room in the cache. Who keeps
  /// records whatever happens has to make room, or it is full for ever.
  virtual void found_no_room() noexcept;

  /// The record at a hit that reflects. Called by many threads at once.
  virtual Record evaluate(unsigned thread, Tracer& tracer, const Visible& x,
                          const SampleKey& key) noexcept = 0;

  /// What the cache did with the record that this thread evaluated last.
  virtual void settle(unsigned thread, const Record& record, InsertResult result) noexcept;

  /// After RecordsThen::update: makes the record what a new one would be, or drops it. Called for every copy of a
  /// record, in parallel, and answers the same for each.
  virtual UpdateResult update(Record& record) noexcept;

  /// Quiescent: update() was called for all of them.
  virtual void updated() noexcept;

  /// Records to be inserted after an update: those that update() dropped because their radius grew.
  virtual std::span<const Record> to_insert() const noexcept { return {}; }
  /// The cache did not take one of them. Quiescent.
  virtual void refused(const Record& record);

  /// Whether a record says all there is to it, so that one that was made before, elsewhere, is as good as a new one.
  virtual bool makes_plain_records() noexcept { return shapes() == nullptr; }

  /// What the records carry beside the cache, if queries are to extrapolate by it; else null. Always the same.
  virtual RecordShapes* shapes() noexcept { return nullptr; }

  /// What a query has to tell, by `used`, in this frame.
  virtual UseToTell tells() const noexcept { return UseToTell::nothing; }
  virtual void used(const Record& record) noexcept;

  /// Fills in what it did in this frame.
  virtual void report(PassFigures& figures) const noexcept;
};

}  // namespace icbench
