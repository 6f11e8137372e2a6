// Temporal instant caching (Dubla 2012, 6.3): instant caching whose virtual point lights (VPLs) and records live on
// from frame to frame; after a change only what it may have touched is computed again.
//
// As a frame begins, in parallel over the crew:
//
//   light paths   those with a segment that meets a moved mesh's box, before or after, are retraced with the random
//                 numbers they had; all are when lights or materials changed
//
//   records       on a mesh that moved are dropped. Of the others, visibilities are retraced of the VPLs that moved and
//                 of those whose segment meets a box; then irradiance is summed anew, over all VPLs in fixed order, if a
//                 bit or a VPL changed at all. Compensation is computed again where there was any or a box is near;
//                 its paths may go anywhere. Distance rays that meet a box are retraced, and with them the radius.
//
// Boxes are conservative (render/moved_boxes.h), every ray goes through the same kernel as when a record is made, and
// nothing is ever corrected by a difference. So after begin_frame each record equals, bit for bit, the one that would be
// made at its place in this frame: nothing drifts, however many frames.
//
// A cache may not let a radius grow in place: a record that gets a larger one is dropped and inserted again, as it would
// be now (to_insert). A cache that holds a record in several copies is told the same of each: what update() answers was
// worked out before, and is looked up by id.
//
// Records that no pixel uses any more: when the number of records has doubled since this was last done (and grown by
// kSpare at least), or when there is no room for a new one, the queries of one frame tell which records they use, and the others are dropped as the next frame
// begins. So their number stays below twice the number in use, and a frame's new ones, for ever; between such frames
// queries tell nothing and nothing is paid for.
//
// Memory beside the cache's: 64 bytes and a bit a VPL for each record (render/record_table.h), and for the VPLs.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "core/sync.h"
#include "render/instant_caching.h"
#include "render/moved_boxes.h"
#include "render/record_table.h"

namespace icbench {

class TemporalSource final : public RecordSource {
 public:
  explicit TemporalSource(const PassSetup& setup);

  RecordsThen begin_frame(const SceneChange& change, Crew& crew) override;
  UpdateResult update(Record& record) noexcept override;
  std::span<const Record> to_insert() const noexcept override { return to_insert_; }
  void refused(const Record& record) override;

  Record evaluate(unsigned thread, Tracer& tracer, const Visible& x, const SampleKey& key) noexcept override;
  void settle(unsigned thread, const Record& record, InsertResult result) noexcept override;
  bool wants_use() const noexcept override { return sweeping_; }
  void used(const Record& record) noexcept override;
  void report(PassFigures& figures) const noexcept override;

  /// The VPLs of this frame.
  const VplSet& vpls() const noexcept { return vpls_; }

 private:
  enum class Verdict : std::uint8_t { keep, update, drop, insert };

  // What a thread needs for a record, and what it did.
  struct alignas(kNoSharing) Worker {
    std::vector<std::uint64_t> suspect;  // VPLs whose visibility is to be traced anew
    std::vector<std::uint64_t> before;   // visibilities as they were
    std::vector<std::uint32_t> dropped;
    std::vector<Record> regrown;
    std::uint64_t kept = 0, updated = 0;
    std::uint64_t made = 0;      // records that this thread inserted
    std::uint64_t homeless = 0;  // of those, without an id
    KeptRecord homeless_record;
    bool out_of_room = false;  // here or in the cache
  };

  // What a frame's change means for records.
  struct Change {
    MovedBoxes boxes;
    SegmentEnds ends;                        // the VPLs, for segments to them
    std::vector<std::uint8_t> moved_meshes;  // by KeptRecord::mesh
    std::vector<std::uint64_t> moved_vpls;   // a bit for each
    bool light_changed = false;              // any VPL, or what may reach compensation rays
    bool surfaces_changed = false;           // what any surface reflects
    bool unused_goes = false;
  };

  void count_new_records() noexcept;
  void begin_sweep_if_due() noexcept;
  Verdict reconsider(Tracer& tracer, Worker& w, const Change& change, std::uint32_t id) noexcept;
  bool see_anew(Tracer& tracer, Worker& w, const Change& change, const Hit& point, std::uint32_t id) noexcept;
  std::uint32_t cut_distances(const Change& change, const Hit& point,
                              const DistanceCodes& distances) const noexcept;
  VplChange update_lights(const SceneChange& change, const MovedBoxes& boxes, Crew& crew);

  const RayTracer& rays_;
  VplSet vpls_;
  RadiusRays radius_;
  float clamp_;
  RecordTable table_;
  std::vector<Worker> workers_;
  std::vector<Verdict> verdicts_;  // by id; of the last update
  std::vector<Record> to_insert_;
  bool sweeping_ = false;
  bool started_ = false;
  bool out_of_room_ = false;
  std::uint64_t live_ = 0, live_when_swept_ = 0;
  std::uint64_t homeless_ = 0;  // in the cache, but not kept here: there was no room
  PassFigures figures_;
};

}  // namespace icbench
