// A cached picture that no schedule decides: the same records and the same pixels, bit for bit, for any number of
// threads, any schedule and any cache that keeps what it is given.
//
// Left to itself a cached pass is a race by design: which pixel finds which record depends on who came first. Here the
// image is worked on in waves, from a coarse lattice of pixels to all of them. In a wave
//
//   ask       every pixel queries the cache in parallel; nobody inserts meanwhile, so that all find the same records,
//             and pixels may ask in batches (core/cache.h, BatchSession)
//
//   make      those that found none are taken block by block of the image. One thread goes through the misses of a
//             block in an order that a hash of the pixel gives, makes a record where those it has just made for the
//             block do not answer, and inserts it; while it does, nobody asks. A round takes every other block, as the
//             black squares of a chessboard or the white ones, so that neighbours do not make the same record twice
//
//   publish   the cache's frame ends and begins, so that every session sees every record; what was not made a record for
//             asks again, and so on until all have found one
//
// Later samples of a pixel find nearly all records made, and take one wave of all pixels.
//
// Where records overlap, the hits of those pixels ask once more in the end at which records count that their tile got
// later, as in a free-running pass (render/irradiance_cache.h), but for those that a record was made at. After an
// overture, which asks all again, nothing is left to do.
//
// A block at a time, since rays from neighbours take the same ways: shadow rays of records that lie all over the image
// take a tenth more time. Blocks are small, for there to be hundreds at once whatever the number of threads.
//
// What records bring to a point is summed in an order decided by that and by where they lie: a cache may find them in
// any. Ids may index a table, from which threads draw as they come; nothing here depends on them.
//
// Scope: one program on one machine (compilers and processors may round differently); a cache that has room; the same
// frames before. Records are the same but for their ids.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/steps.h"
#include "core/sync.h"
#include "core/types.h"
#include "render/crew.h"
#include "render/indirect_pass.h"
#include "render/irradiance_cache.h"
#include "render/needed_record.h"
#include "render/primary.h"
#include "render/record_source.h"
#include "render/tiles.h"

namespace icbench {

/// What a query gave.
struct Reply {
  std::optional<Irradiance> E;  ///< W/m^2; none where no record was valid
  float most_R = 0.0f;          ///< metres: R that the records nearby allow a new one (clamped_to_neighbours)
};

/// What records bring to each query of a batch, summed in an order that does not depend on how the cache finds them.
class Answers {
 public:
  /// Queries of a batch, at most.
  static constexpr std::size_t kAtOnce = 16;

  explicit Answers(RecordSource& source)
      : source_(source),
        shapes_(source.shapes()),
        clamps_(shapes_ != nullptr && shapes_->clamps_to_neighbours()),
        guarded_(shapes_ != nullptr && shapes_->details.are_guarded()) {}

  /// Who traces the rays of the guard against leaks from now on, and counts them.
  void guard_by(Tracer& tracer, LeakTests& tests) noexcept {
    tracer_ = &tracer;
    tests_ = &tests;
  }

  /// The points of the batch to come, in place until they are settled.
  void ask_at(std::span<const SurfacePoint> points) noexcept;

  /// Takes the records of query `i`, as the cache's session visits them. Out of memory ends the program.
  auto operator[](std::size_t i) noexcept {
    return [this, i](const Record& r, float weight) noexcept { take(i, r, weight); };
  }

  /// What those of query `i` come to; forgets them.
  Reply settle(std::size_t i) noexcept;

 private:
  static constexpr std::uint32_t kTrusted = ~0u;  // no ray has to tell whether it counts

  // Single floats: a Contribution would be written in pieces and copied whole, for which the processor waits.
  struct Answer {
    std::uint64_t order;  // hash of where its record lies
    float red, green, blue, w;
    bool covers;
    std::uint32_t ray;  // in Query::rays, or kTrusted

    Contribution brings() const noexcept { return {{red, green, blue}, w, covers}; }
  };
  struct Query {
    std::optional<Extrapolator> extrapolator;  // where records are extrapolated
    std::vector<Answer> answers;
    std::vector<Ray> rays;
    NeededRecord needed;
    float most_R = std::numeric_limits<float>::infinity();
  };

  void take(std::size_t i, const Record& r, float weight) noexcept;

  RecordSource& source_;
  const RecordShapes* shapes_;
  bool clamps_, guarded_;
  UseToTell tells_ = UseToTell::nothing;
  Tracer* tracer_ = nullptr;
  LeakTests* tests_ = nullptr;
  std::span<const SurfacePoint> points_;
  std::array<Query, kAtOnce> queries_;
};

/// A cache as waves use it.
class WaveCache {
 public:
  virtual ~WaveCache() = default;
  /// Queries at all points, which are some dozens, in batches: `answers` is this thread's. Many threads at once, none
  /// inserting.
  virtual void ask(unsigned thread, std::span<const SurfacePoint> points, Answers& answers,
                   std::span<Reply> replies) noexcept = 0;
  /// Many threads at once, none asking.
  virtual InsertResult insert(unsigned thread, const Record& record) noexcept = 0;
  /// Quiescent: from now on every query sees every record.
  virtual void publish() = 0;
  /// Of its queries, as split_sphere_weight takes it.
  virtual float accuracy() const noexcept = 0;
};

class Waves {
 public:
  /// By the threads of a crew. `did` is told by any of them what share of a sample's work was done, 1 in all.
  Waves(const RayTracer& rays, RecordSource& source, Crew& crew, std::function<void(double)> did = {});

  /// Indirect radiance at all stored hits, as irradiance_cache_tile; pixels that reflect nothing are 0. `overture`:
  /// asks all again when every record is made, so that no pixel depends on how early it came.
  void render(WaveCache& cache, const PrimaryHits& primary, const SampleKey& key, bool overture, Image& out);

  /// Forgets what was counted.
  void reset_use() noexcept;
  CacheUse use() const noexcept;

 private:
  struct Asked {
    std::uint32_t pixel, layer;
  };
  // A record made for this sample, and the hit it was made at.
  struct Made {
    std::uint32_t pixel, layer;
    std::uint32_t stage;  // hits that were asked for at this stage or before it did not find it
    bool is_stored;
    Record record;
  };
  struct Miss {
    std::uint32_t block;  // of the image; neighbours in order are neighbours there
    std::uint32_t rank;   // at random
    std::uint32_t pixel, layer;
    float most_R;
    bool is_made;  // a record of its own
    bool is_told;  // to who follows the work
  };
  // The misses of a block, in order of rank.
  struct Run {
    std::size_t begin, end;  // in misses_
  };
  struct alignas(kNoSharing) Worker {
    explicit Worker(RecordSource& source) : answers(source) {}
    Answers answers;
    std::vector<SurfacePoint> points;
    std::vector<Reply> replies;
    std::vector<Asked> asked;
    std::vector<Miss> missed;
    std::vector<Record> own;             // made for this run
    std::vector<Made> made;              // in this sample
    std::vector<const Made*> made_here;  // of these, in one tile
    CacheUse use;
  };

  // Which pixels ask.
  enum class Which : std::uint8_t {
    added,  // those that a spacing adds to those of twice the spacing
    all,
    outdated  // those at which records count that their tile got later
  };

  // What is rendered, and where.
  struct Frame {
    WaveCache& cache;
    const PrimaryHits& primary;
    const SampleKey& key;
    Image& out;
    bool asks_again;  // hits do, where they are outdated
  };
  // A thread of the crew within a frame: all go through the same steps.
  struct Thread {
    const Frame& frame;
    Steps& steps;
    unsigned index;
    Tracer& tracer;
  };

  void ask(const Thread& t, unsigned spacing, Which which);
  /// `work`: its share of that of the sample.
  void answer_misses(const Thread& t, double work);
  void tell(double work) const;
  void make(const Thread& t, const Run& run);
  void ask_again(const Thread& t);

  // What one thread does alone between steps.
  void gather_misses();
  void gather_made();
  void choose_runs();
  void keep_unanswered(const Frame& frame);

  // Of a tile, in order of pixel and layer; and which of them was made at a hit, if one was.
  void find_made_in(const Tile& tile, std::vector<const Made*>& made_here) const;
  static const Made* made_at(std::uint32_t pixel, std::uint32_t layer,
                             std::span<const Made* const> made_here) noexcept;
  bool is_outdated(const Frame& frame, std::uint32_t pixel,
                   std::span<const Made* const> made_here) const noexcept;
  void show(const Frame& frame, std::uint32_t pixel, std::uint32_t layer, const Irradiance& E) const noexcept;

  const RayTracer& rays_;
  RecordSource& source_;
  Crew& crew_;
  std::function<void(double)> did_;
  double work_of_a_miss_ = 0.0;  // of those of a wave, in the sample's
  std::vector<Tile> tiles_;      // of images of this size:
  int width_ = 0, height_ = 0;
  std::vector<Worker> workers_;
  std::vector<Miss> misses_;          // in order of block and rank
  std::vector<Reply> replies_;        // for each
  std::vector<Run> runs_;             // of this round
  std::uint32_t colour_ = 0;          // of blocks in the next round
  std::uint32_t stage_ = 0;           // how often records were published in this sample
  std::vector<std::uint32_t> asked_;  // the stage at which a pixel was asked for last, or an earlier one
  std::vector<Made> made_;            // in this sample, where hits ask again, in order of pixel and layer
};

}  // namespace icbench
