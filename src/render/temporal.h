// Temporal instant caching (Dubla 2012, 6.3): instant caching whose virtual point lights (VPLs) and records live on
// from frame to frame; after a change only what it may have touched is computed again.
//
// As a frame begins, in parallel over the crew:
//
//   light paths   those with a segment that meets a moved mesh's box, before or after, are retraced with the random
//                 numbers they had; all are when lights or materials changed
//
//   records       on a mesh that moved are dropped. Of the others, a bit says of each VPL whether anything that stands
//                 still hides it; that is retraced of the VPLs that moved alone. Whether something that moves hides it
//                 as well is asked, every time, of all those whose segment meets such a mesh's box: which these are
//                 follows from the present, so they may go in full packets (render/occluders.h). Then irradiance is
//                 summed anew, over all VPLs in fixed order, unless no VPL changed and no open segment meets a moved
//                 box. Compensation is computed again where there was any or a box is near; its paths may go anywhere.
//                 Distance rays that meet a box are retraced, and with them the radius. A record on a mesh that can
//                 move but did not is made anew as a whole (record_packing).
//
// Boxes are conservative (render/moved_boxes.h), every ray goes through the same kernel as when a record is made, and
// nothing is ever corrected by a difference. So after begin_frame each record equals, bit for bit, the one that would
// be made at its place in this frame: nothing drifts, however many frames. (But where three or more shapes that can move
// coincide: which of them a ray meets follows from Embree's tree over all that move.)
//
// A cache may not let a radius grow in place: a record that gets a larger one is dropped and inserted again, as it
// would be now (to_insert). A cache that holds a record in several copies is told the same of each: what update()
// answers was worked out before, and is looked up by id. The cache alone keeps irradiance from frame to frame, so only
// update() can tell whether a sum that was taken anew differs from what it was.
//
// Records that no pixel uses any more cost as much as others, and so do those that others make superfluous: when the
// number of records has grown by kGrowth (or kLeastGrowth) since this was last done, after kSweepUpdates updates, or
// when there is no room for a new one, the queries of one frame tell which records they need, one each (NeededRecord),
// and the others are dropped as the next frame begins. So there stay about as many as would be made anew, for ever;
// between such frames queries tell nothing and nothing is paid for. Where nothing but the camera moves, superfluous
// records cost nothing, and all that are used stay; and so they do under the guard against leaks, which may leave out
// any of them.
//
// Where so much moves that an update would take most of the rays that new records do (share_to_update), which is asked
// of a few records each time, nothing is kept but light paths: all records are dropped, and made as those on meshes
// that move are, with fast packing. The next change then drops them in any case. So a frame takes no longer than one of
// instant caching, but for little. Where the camera moves as well, as many records come into view as leave it, and
// instant caching makes no others: an update of what is out of sight is for nothing. So what comes into view counts as
// part of the cost, and queries tell of the records' use in every frame, so that what left the picture goes before the
// next.
//
// Where records are extrapolated (render/extrapolation.h), gradients follow from the same bits, are found anew with the
// sum, and bound the radius; they are as exact as it is. A guard against leaks (render/leak_guard.h) keeps nothing.
//
// Memory beside the cache's: for each record, of the most there were, 48 bytes, and a bit a VPL if it lies on what
// stands still and is kept (render/record_table.h); and the VPLs. While an update lasts, 13 bytes a record more.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/sync.h"
#include "render/instant_caching.h"
#include "render/moved_boxes.h"
#include "render/record_table.h"

namespace icbench {

/// How the rays of a record on a mesh are packed. On one that moves a record is made anew from all its rays or not at
/// all; so whatever a packet's rays do to each other, they do each time.
inline Packing record_packing(const RayTracer& rays, std::uint32_t mesh) noexcept {
  return mesh < kManyMeshes && rays.scene().meshes[mesh].moves() ? Packing::fast : Packing::exact;
}

/// What can move, as it stands, in the way of virtual lights. Movable, not copyable.
class MovingShadows {
 public:
  MovingShadows() = default;
  MovingShadows(const RayTracer& rays, const VplArrays& vpls);
  MovingShadows(MovingShadows&&) = default;
  MovingShadows& operator=(MovingShadows&&) = default;

  /// Of the VPLs that nothing hides from a point that stands still, `open`, those that nothing that moves hides either:
  /// `open` itself or what `seen` became. `suspects` and `seen` are scratch. A function of these arguments and the
  /// frame alone, whatever the frames before.
  std::span<const std::uint64_t> unhidden(Tracer& tracer, const Hit& point, const VplArrays& vpls,
                                          std::span<const std::uint64_t> open,
                                          std::vector<std::uint64_t>& suspects,
                                          std::vector<std::uint64_t>& seen) const noexcept;

  /// Sets the bit of each VPL that something that moves may hide from the point, and no others.
  void mark(const RayTracer& rays, const Hit& point, std::span<std::uint64_t> suspects) const noexcept;

 private:
  MovedBoxes boxes_;  // of all that can move
  SegmentEnds ends_;  // the VPLs, for segments to them that these may cut
};

class TemporalSource final : public RecordSource {
 public:
  explicit TemporalSource(const PassSetup& setup);

  RecordsThen begin_frame(const SceneChange& change, Crew& crew) override;
  UpdateResult update(Record& record) noexcept override;
  void updated() noexcept override;
  std::span<const Record> to_insert() const noexcept override { return to_insert_; }
  void refused(const Record& record) override;

  Record evaluate(unsigned thread, Tracer& tracer, const Visible& x, const SampleKey& key) noexcept override;
  void settle(unsigned thread, const Record& record, InsertResult result) noexcept override;
  RecordShapes* shapes() noexcept override { return shapes_.get(); }
  bool makes_plain_records() noexcept override { return false; }
  UseToTell tells() const noexcept override;
  void used(const Record& record) noexcept override;
  void report(PassFigures& figures) const noexcept override;

  /// The VPLs of this frame.
  const VplSet& vpls() const noexcept { return vpls_; }

  /// How the rays of records on a mesh are packed in this frame.
  Packing packing(std::uint32_t mesh) const noexcept {
    return all_anew_ ? Packing::fast : record_packing(rays_, mesh);
  }

 private:
  enum class Verdict : std::uint8_t {
    keep,     // nothing changed
    shrunk,   // the radius alone did
    renewed,  // irradiance was summed anew; maybe it is what it was
    changed,  // the same, and something did change
    drop,
    insert  // drop, and insert again
  };

  // Shadow rays of records made anew, of those that the picture has a place for, and of their update: to VPLs that
  // moved, and past what may move.
  struct Rays {
    std::uint64_t anew = 0, in_view = 0, to_moved = 0, past_moving = 0;
    Rays& operator+=(const Rays& o) noexcept {
      anew += o.anew;
      in_view += o.in_view;
      to_moved += o.to_moved;
      past_moving += o.past_moving;
      return *this;
    }
  };

  // What a thread needs for a record, and what it did.
  struct alignas(kNoSharing) Worker {
    std::vector<std::uint64_t> suspect;  // VPLs that something may hide
    std::vector<std::uint64_t> visible;  // VPLs that nothing hides
    std::vector<std::uint64_t> homeless_bits;
    std::vector<std::uint32_t> dropped;
    std::vector<Record> regrown;
    std::uint64_t kept = 0, updated = 0;
    std::uint64_t made = 0;      // records that this thread inserted
    std::uint64_t homeless = 0;  // of those, without an id
    KeptRecord homeless_record;
    bool out_of_room = false;  // here or in the cache
    Rays rays;                 // of the records that share_to_update looked at
  };

  // What a frame's change means for records.
  struct Change {
    MovedBoxes boxes;                        // of what moved
    SegmentEnds ends;                        // the VPLs, for segments to them
    std::vector<std::uint8_t> moved_meshes;  // by KeptRecord::mesh
    std::vector<std::uint64_t> moved_vpls;   // a bit for each
    bool light_changed = false;              // any VPL, or what may reach compensation rays
    bool surfaces_changed = false;           // what any surface reflects
    bool unused_goes = false;
    bool camera = false;  // moved
  };

  void count_new_records() noexcept;
  double share_to_update(const Change& change, Crew& crew);
  void forget_records();
  void begin_sweep_if_due(bool camera_moved) noexcept;
  static bool goes(const Change& change, const KeptRecord& r) noexcept;
  bool is_near_change(const Change& change, const KeptRecord& r) const noexcept;
  bool needs_lights_anew(Worker& w, const Change& change, const Hit& point, std::uint32_t id) noexcept;
  Verdict reconsider(Tracer& tracer, Worker& w, const Change& change, std::uint32_t id) noexcept;
  std::span<const std::uint64_t> see_anew(Tracer& tracer, Worker& w, const Change& change, const Hit& point,
                                          std::uint32_t id) noexcept;
  bool cut_lights(Worker& w, const Change& change, const Hit& point, std::uint32_t id) noexcept;
  std::uint32_t cut_distances(const Change& change, const Hit& point,
                              const DistanceCodes& distances) const noexcept;
  float radius_of(std::uint32_t id, const DistanceCodes& distances) const noexcept;
  Irradiance light_from(std::span<const std::uint64_t> seen, const Hit& point,
                        IrradianceGradients& gradients) const noexcept;
  Irradiance gather(Tracer& tracer, const Hit& point, IrradianceGradients& gradients) const noexcept;
  void reshape(std::uint32_t id, const Irradiance& E, const IrradianceGradients& gradients) noexcept;
  void forget_verdicts() noexcept;
  VplChange update_lights(const SceneChange& change, const MovedBoxes& boxes, Crew& crew);

  const RayTracer& rays_;
  VplSet vpls_;
  RadiusRays radius_;
  float clamp_;
  int width_, height_;  // pixels
  RecordTable table_;
  bool extrapolated_;                     // records have details in shapes_, by the ids of table_
  std::unique_ptr<RecordShapes> shapes_;  // shapes_beside_cache
  std::vector<Worker> workers_;
  MovingShadows moving_;  // of this frame
  // While an update lasts, by id.
  std::vector<Verdict> verdicts_;
  std::vector<Irradiance> renewed_;  // W/m^2; of the records renewed or changed
  std::vector<Record> to_insert_;
  bool all_anew_ = false;  // the records of this frame; the next change then drops them
  bool changed_ = false;   // something but the camera, in this frame
  bool sweeping_ = false;
  bool started_ = false;
  bool out_of_room_ = false;
  std::uint64_t live_ = 0, live_when_swept_ = 0;  // the latter: or fewer, if so few were left meanwhile
  std::uint32_t updates_since_sweep_ = 0;
  std::uint64_t homeless_ = 0;  // in the cache, but not kept here: there was no room
  PassFigures figures_;
};

}  // namespace icbench
