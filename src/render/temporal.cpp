#include "render/temporal.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include "core/cache.h"
#include "render/camera.h"
#include "render/integrators.h"
#include "render/place_hash.h"

namespace icbench {
namespace {

// Records, as a share of those after the last sweep and at least, by which their number may grow until the next.
constexpr double kGrowth = 1.0 / 16.0;
constexpr std::uint64_t kLeastGrowth = 64;
constexpr std::uint32_t kSweepUpdates = 8;  // after so many there is one even so
constexpr std::size_t kGrain = 16;          // records a thread takes at a time

// Records that are looked at to find what an update takes; what a ray in exact packing costs, in rays in fast packing;
// and the share of the rays of new records from which on these are made instead. With 8,192 VPLs, at 0.75 (Bunnies 9)
// an update took 1.08 times as long, at 0.42 (Bunnies 4), by a state before, 0.92 times.
constexpr std::uint64_t kLookedAt = 64;  // about
constexpr double kExactCost = 1.2;
constexpr double kMostToUpdate = 0.6;
// Where the camera moves, over the time of new records for the whole picture: what it takes that queries tell of their
// records and what is left behind goes; and new records with bits for the share of the picture that comes into view. In
// a hall with one moving ball a frame took 0.75 of instant caching's time where a fifth came into view, 1.3 where half
// did.
constexpr double kLeftBehind = 0.25, kComingIntoView = 1.4;

std::uint16_t mesh_of(std::uint32_t mesh) noexcept {
  return static_cast<std::uint16_t>(std::min<std::uint32_t>(mesh, kManyMeshes));
}

bool same_bits(const Irradiance& a, const Irradiance& b) noexcept {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

std::uint32_t capacity_of(const PassSetup& s) {
  return capacity_for(room_for_records(s.width, s.height, s.samples), s.crew.size());
}

PointsView places_of(const VplArrays& vpls) noexcept {
  return {vpls.of(VplArrays::kPx), vpls.of(VplArrays::kPy), vpls.of(VplArrays::kPz), vpls.slots()};
}

}  // namespace

MovingShadows::MovingShadows(const RayTracer& rays, const VplArrays& vpls)
    : boxes_(rays.moving(), rays.epsilon()), ends_(boxes_, places_of(vpls)) {}

std::span<const std::uint64_t> MovingShadows::unhidden(Tracer& tracer, const Hit& point,
                                                       const VplArrays& vpls,
                                                       std::span<const std::uint64_t> open,
                                                       std::vector<std::uint64_t>& suspects,
                                                       std::vector<std::uint64_t>& seen) const noexcept {
  if (boxes_.empty()) return open;
  suspects.resize(open.size());
  mark(tracer.shared(), point, suspects);
  for (std::size_t i = 0; i < open.size(); ++i) suspects[i] &= open[i];
  seen.assign(open.begin(), open.end());
  trace_visibility(tracer, point, vpls, suspects, seen, Packing::fast, Shapes::moving);
  return seen;
}

void MovingShadows::mark(const RayTracer& rays, const Hit& point,
                         std::span<std::uint64_t> suspects) const noexcept {
  std::fill(suspects.begin(), suspects.end(), 0);
  ends_.mark(rays.leave(point.p, point.ng), suspects);
}

TemporalSource::TemporalSource(const PassSetup& s)
    : rays_(s.rays),
      vpls_(s.rays, {s.vpls, s.seed, s.vpl_paths}),
      radius_(s.rays.scene().bounds, radius_limits(s.rays.scene().bounds)),
      clamp_(vpl_clamp(s.rays.scene().bounds)),
      width_(s.width),
      height_(s.height),
      table_(capacity_of(s), s.crew.size()),
      extrapolated_(extrapolates(s.interpolation)),
      shapes_(shapes_beside_cache(s)),
      workers_(s.crew.size()) {}

RecordsThen TemporalSource::begin_frame(const SceneChange& change, Crew& crew) {
  figures_ = {};
  to_insert_.clear();
  count_new_records();

  Change c;
  c.boxes = MovedBoxes(change, rays_.epsilon());
  const VplChange light = update_lights(change, c.boxes, crew);
  const VplArrays& vpls = vpls_.vpls();
  moving_ = MovingShadows(rays_, vpls);
  const bool swept = std::exchange(sweeping_, false);
  c.light_changed = light.any() || change.lights || change.materials;
  c.surfaces_changed = change.materials;
  c.camera = change.camera;
  changed_ = !c.boxes.empty() || c.light_changed;
  if (live_ + homeless_ == 0 || (!changed_ && !swept)) {
    figures_.records_kept = live_;
    begin_sweep_if_due(c.camera);
    return RecordsThen::stay;
  }

  c.ends = SegmentEnds(c.boxes, places_of(vpls));
  c.moved_meshes.assign(std::min<std::size_t>(rays_.scene().meshes.size(), kManyMeshes + 1u), 0);
  for (const MovedMesh& m : change.moved) c.moved_meshes[mesh_of(m.mesh)] = 1;
  c.moved_vpls = light.moved;
  c.moved_vpls.resize(vpls.words());
  c.unused_goes = swept;
  if (changed_) {
    const bool were_anew = std::exchange(all_anew_, share_to_update(c, crew) > kMostToUpdate);
    if (all_anew_ || were_anew) {
      forget_records();
      return RecordsThen::go;
    }
  }
  verdicts_.assign(table_.end(), Verdict::drop);
  renewed_.resize(table_.end());
  crew.for_each(verdicts_.size(), kGrain, [&](unsigned thread, Tracer& tracer, std::size_t id) {
    if (table_[static_cast<std::uint32_t>(id)].state != KeptRecord::free)
      verdicts_[id] = reconsider(tracer, workers_[thread], c, static_cast<std::uint32_t>(id));
  });

  auto touched = static_cast<std::uint64_t>(std::count(verdicts_.begin(), verdicts_.end(), Verdict::renewed) +
                                            std::count(verdicts_.begin(), verdicts_.end(), Verdict::changed));
  for (Worker& w : workers_) {
    table_.release(w.dropped);
    live_ -= w.dropped.size();
    to_insert_.insert(to_insert_.end(), w.regrown.begin(), w.regrown.end());
    touched += w.updated + w.dropped.size() + w.regrown.size();
    figures_.records_kept += std::exchange(w.kept, 0);
    figures_.records_updated += std::exchange(w.updated, 0) + w.regrown.size();
    figures_.records_dropped += w.dropped.size();
    w.dropped.clear();
    w.regrown.clear();
  }
  figures_.records_dropped += homeless_;
  touched += std::exchange(homeless_, 0);
  live_when_swept_ = swept ? live_ : std::min(live_when_swept_, live_);
  ++updates_since_sweep_;
  begin_sweep_if_due(c.camera);
  if (touched != 0) return RecordsThen::update;
  forget_verdicts();
  return RecordsThen::stay;
}

void TemporalSource::forget_verdicts() noexcept {
  verdicts_ = {};
  renewed_ = {};
}

void TemporalSource::count_new_records() noexcept {
  for (Worker& w : workers_) {
    live_ += std::exchange(w.made, 0);
    homeless_ += std::exchange(w.homeless, 0);
    out_of_room_ |= std::exchange(w.out_of_room, false);
  }
}

// What the shadow rays of an update would cost, over those of as many new records, and where the camera moved what else
// is to be done. Of some records on what stands still, and that stay: the others are made anew in any case. Which these
// are, and the result, do not depend on the number of threads. What hides a light already is counted as if it did not.
double TemporalSource::share_to_update(const Change& c, Crew& crew) {
  constexpr std::uint64_t kAll = std::numeric_limits<std::uint64_t>::max();
  const std::uint64_t below = live_ <= kLookedAt ? kAll : kAll / live_ * kLookedAt;
  const VplArrays& vpls = vpls_.vpls();
  const std::vector<std::uint64_t> all_vpls(vpls.words(), kAll);
  const CameraView view(rays_.scene().camera, width_, height_);
  crew.for_each(table_.end(), kGrain, [&](unsigned thread, Tracer&, std::size_t i) {
    const auto id = static_cast<std::uint32_t>(i);
    const KeptRecord& r = table_[id];
    if (r.state == KeptRecord::free || hash_of(r.p) > below) return;
    if (record_packing(rays_, r.mesh) == Packing::fast || goes(c, r)) return;
    Worker& w = workers_[thread];
    const Hit point = record_point(r.p, r.n, r.ng);
    const std::uint64_t anew = count_facing(point, vpls, all_vpls);
    w.rays.anew += anew;
    if (view.shows(r.p)) w.rays.in_view += anew;
    // Those of a frame in which all was made anew have no bits to tell.
    if (!all_anew_ && !needs_lights_anew(w, c, point, id)) return;
    w.rays.to_moved += count_facing(point, vpls, c.moved_vpls);
    w.suspect.resize(vpls.words());
    moving_.mark(rays_, point, w.suspect);
    w.rays.past_moving += count_facing(point, vpls, w.suspect);
  });
  Rays sum;
  for (Worker& w : workers_) sum += std::exchange(w.rays, {});
  if (sum.anew == 0) return 0.0;
  const auto anew = static_cast<double>(sum.anew);
  const double update =
      (kExactCost * static_cast<double>(sum.to_moved) + static_cast<double>(sum.past_moving)) / anew;
  if (!c.camera) return update;
  const double new_in_view = 1.0 - static_cast<double>(sum.in_view) / anew;
  return update + kMostToUpdate * (kLeftBehind + kComingIntoView * new_in_view);
}

void TemporalSource::forget_records() {
  figures_.records_dropped = live_ + std::exchange(homeless_, 0);
  table_.clear();
  live_ = live_when_swept_ = 0;
  updates_since_sweep_ = 0;
  out_of_room_ = false;
}

void TemporalSource::begin_sweep_if_due(bool camera_moved) noexcept {
  const auto growth = static_cast<std::uint64_t>(kGrowth * static_cast<double>(live_when_swept_));
  const bool is_due = live_ > live_when_swept_ + std::max(growth, kLeastGrowth) ||
                      updates_since_sweep_ >= kSweepUpdates || out_of_room_ || (changed_ && camera_moved);
  if (!is_due) return;
  out_of_room_ = false;
  updates_since_sweep_ = 0;
  sweeping_ = true;
  for (std::uint32_t id = 0; id < table_.end(); ++id)
    if (table_[id].state == KeptRecord::live) table_[id].state = KeptRecord::unused;
}

// Traces paths anew that the change may have touched.
VplChange TemporalSource::update_lights(const SceneChange& change, const MovedBoxes& boxes, Crew& crew) {
  figures_.light_paths = vpls_.paths();
  const bool all = !std::exchange(started_, true) || change.lights || change.materials;
  std::vector<std::uint32_t> cut;
  for (std::uint32_t path = 0; path < vpls_.paths(); ++path) {
    const std::span<const glm::vec3> vertices = vpls_.vertices(path);
    bool is_cut = all;
    for (std::size_t i = 1; i < vertices.size() && !is_cut; ++i)
      is_cut = boxes.meet(vertices[i - 1], vertices[i]);
    if (is_cut) cut.push_back(path);
  }
  figures_.light_paths_retraced = cut.size();
  if (cut.empty()) return {};
  VplUpdate update(vpls_, std::move(cut));
  VplChange changed = update_vpls(update, crew);
  table_.widen(vpls_.vpls().words());
  return changed;
}

// Whether a record is dropped whatever its light.
bool TemporalSource::goes(const Change& c, const KeptRecord& r) noexcept {
  return c.moved_meshes[r.mesh] != 0 || (c.unused_goes && r.state == KeptRecord::unused);
}

// Whether what compensation rays meet may be other than it was.
bool TemporalSource::is_near_change(const Change& c, const KeptRecord& r) const noexcept {
  return c.surfaces_changed || c.boxes.near(r.p, compensation_reach(clamp_));
}

// Whether a record's light may be other than it was.
bool TemporalSource::needs_lights_anew(Worker& w, const Change& c, const Hit& point,
                                       std::uint32_t id) noexcept {
  const KeptRecord& r = table_[id];
  return c.light_changed || r.met != 0 || is_near_change(c, r) || cut_lights(w, c, point, id);
}

TemporalSource::Verdict TemporalSource::reconsider(Tracer& tracer, Worker& w, const Change& c,
                                                   std::uint32_t id) noexcept {
  KeptRecord& r = table_[id];
  if (goes(c, r)) {
    w.dropped.push_back(id);
    return Verdict::drop;
  }
  if (c.boxes.empty() && !c.light_changed) {
    ++w.kept;
    return Verdict::keep;
  }
  const Hit point = record_point(r.p, r.n, r.ng);
  const float R_before = radius_of(id, r.distances);
  const std::uint32_t cut = cut_distances(c, point, r.distances);
  if (cut != 0) radius_.trace(tracer, point, cut, r.distances);

  const Packing packing = record_packing(rays_, r.mesh);
  const bool lights_anew = needs_lights_anew(w, c, point, id);
  // A radius by gradients needs these; and what is inserted again needs irradiance, which only the cache has.
  const bool radius_anew = cut != 0 && (extrapolated_ || radius_of(id, r.distances) > R_before);
  Irradiance& E = renewed_[id];
  if (lights_anew || radius_anew) {
    // Where nothing near has changed, the rays that met something are the same; the paths that go on from there may not
    // be.
    const bool all = packing == Packing::fast || is_near_change(c, r);
    const Compensation added =
        compensate_record(tracer, point, vpls_, clamp_, packing, all ? ~std::uint64_t{0} : r.met);
    IrradianceGradients gradients;
    E = packing == Packing::fast ? gather(tracer, point, gradients)
                                 : light_from(see_anew(tracer, w, c, point, id), point, gradients);
    E = E + added.E;
    r.met = static_cast<std::uint32_t>(added.met);
    if (extrapolated_) reshape(id, E, gradients);
  }

  const float R = radius_of(id, r.distances);
  if (R > R_before) {
    w.regrown.push_back({point.p, point.n, R, E, id});
    return Verdict::insert;
  }
  if (lights_anew || radius_anew) return R == R_before ? Verdict::renewed : Verdict::changed;
  ++(R == R_before ? w.kept : w.updated);
  return R == R_before ? Verdict::keep : Verdict::shrunk;
}

float TemporalSource::radius_of(std::uint32_t id, const DistanceCodes& distances) const noexcept {
  return extrapolated_ ? shapes_->details[id].R : radius_.radius(distances);
}

// Irradiance of the VPLs that are seen, and, where records are extrapolated, its gradients.
Irradiance TemporalSource::light_from(std::span<const std::uint64_t> seen, const Hit& point,
                                      IrradianceGradients& gradients) const noexcept {
  return extrapolated_ ? irradiance_from(seen, point, vpls_.vpls(), clamp_, gradients)
                       : irradiance_from(seen, point, vpls_.vpls(), clamp_);
}

// The same, whatever is seen: nothing is kept of it.
Irradiance TemporalSource::gather(Tracer& tracer, const Hit& point,
                                  IrradianceGradients& gradients) const noexcept {
  return extrapolated_ ? gather_vpls(tracer, point, vpls_.vpls(), clamp_, Packing::fast, gradients)
                       : gather_vpls(tracer, point, vpls_.vpls(), clamp_, Packing::fast);
}

// A kept record's detail and radius, as its light and gradients want them.
void TemporalSource::reshape(std::uint32_t id, const Irradiance& E,
                             const IrradianceGradients& gradients) noexcept {
  shapes_->shaper.shape_of_vpls(radius_.radius(table_[id].distances), E, gradients, shapes_->details[id]);
}

// Whether a segment to a VPL that may be seen meets a box of what moved.
bool TemporalSource::cut_lights(Worker& w, const Change& c, const Hit& point, std::uint32_t id) noexcept {
  if (c.boxes.empty()) return false;
  if (record_packing(rays_, table_[id].mesh) == Packing::fast) return true;  // its bits are of what it saw
  w.suspect.assign(vpls_.vpls().words(), 0);
  c.ends.mark(rays_.leave(point.p, point.ng), w.suspect);
  const std::span<const std::uint64_t> open = table_.visible(id);
  return !std::equal(open.begin(), open.end(), w.suspect.begin(),
                     [](std::uint64_t a, std::uint64_t b) { return (a & b) == 0; });
}

// The VPLs that a kept record on what stands still sees now.
std::span<const std::uint64_t> TemporalSource::see_anew(Tracer& tracer, Worker& w, const Change& c,
                                                        const Hit& point, std::uint32_t id) noexcept {
  const VplArrays& vpls = vpls_.vpls();
  const std::span<std::uint64_t> open = table_.visible(id);
  trace_visibility(tracer, point, vpls, c.moved_vpls, open, Packing::exact, Shapes::still);
  return moving_.unhidden(tracer, point, vpls, open, w.suspect, w.visible);
}

// The distance rays that meet a box no farther than they reached.
std::uint32_t TemporalSource::cut_distances(const Change& c, const Hit& point,
                                            const DistanceCodes& distances) const noexcept {
  std::uint64_t cut = 0;
  if (c.boxes.empty()) return 0;
  const auto directions = RadiusRays::directions(point.n);
  const glm::vec3 from = rays_.leave(point.p, point.ng);
  alignas(64) float x[64] = {}, y[64] = {}, z[64] = {};
  for (const MovedBox& box : c.boxes.boxes()) {
    for (std::size_t i = 0; i < kRadiusRays; ++i) {
      const glm::vec3 end = box.to_box(from + radius_.reach(distances[i]) * directions[i]);
      x[i] = end.x;
      y[i] = end.y;
      z[i] = end.z;
    }
    box.mark(box.to_box(from), x, y, z, cut);
  }
  return static_cast<std::uint32_t>(cut) & RadiusRays::kAll;
}

UpdateResult TemporalSource::update(Record& record) noexcept {
  if (record.id >= verdicts_.size()) return UpdateResult::drop;  // made when there was no room to keep it
  // Relaxed: several copies of a record may be under way at once, and all of them write the same; the end of the
  // update orders that before it is read.
  const std::atomic_ref<Verdict> verdict(verdicts_[record.id]);
  switch (verdict.load(std::memory_order_relaxed)) {
    case Verdict::keep:
      return UpdateResult::keep;
    case Verdict::renewed:
      if (same_bits(record.E, renewed_[record.id])) return UpdateResult::keep;
      verdict.store(Verdict::changed, std::memory_order_relaxed);
      [[fallthrough]];
    case Verdict::changed:
      record.E = renewed_[record.id];
      [[fallthrough]];
    case Verdict::shrunk:
      record.R = radius_of(record.id, table_[record.id].distances);
      return UpdateResult::keep;
    case Verdict::drop:
    case Verdict::insert:
      return UpdateResult::drop;
  }
  return UpdateResult::drop;
}

void TemporalSource::updated() noexcept {
  figures_.records_kept +=
      static_cast<std::uint64_t>(std::count(verdicts_.begin(), verdicts_.end(), Verdict::renewed));
  figures_.records_updated +=
      static_cast<std::uint64_t>(std::count(verdicts_.begin(), verdicts_.end(), Verdict::changed));
  forget_verdicts();
}

void TemporalSource::refused(const Record& record) {
  table_.release({&record.id, 1});
  --live_;
  --figures_.records_updated;
  ++figures_.records_dropped;
}

Record TemporalSource::evaluate(unsigned thread, Tracer& tracer, const Visible& x,
                                const SampleKey&) noexcept {
  Worker& w = workers_[thread];
  const Packing packing = this->packing(x.hit.mesh);
  const std::uint32_t id = table_.draft(thread, packing == Packing::exact ? LightBits::yes : LightBits::no);
  const bool has_room = id != RecordTable::kNone;  // else the record will do for this frame
  KeptRecord& r = has_room ? table_[id] : w.homeless_record;
  r.p = x.hit.p;
  r.n = PackedNormal::pack(x.hit.n);
  r.ng = PackedNormal::pack(x.hit.ng);
  r.mesh = mesh_of(x.hit.mesh);
  const Hit point = record_point(r.p, r.n, r.ng);
  radius_.trace(tracer, point, RadiusRays::kAll, r.distances);
  const Compensation added = compensate_record(tracer, point, vpls_, clamp_, packing);
  IrradianceGradients gradients;
  Irradiance E;
  if (packing == Packing::fast) {
    E = gather(tracer, point, gradients);
  } else {
    const VplArrays& vpls = vpls_.vpls();
    if (!has_room) w.homeless_bits.resize(vpls.words());
    const std::span<std::uint64_t> open = has_room ? table_.visible(id) : w.homeless_bits;
    trace_visibility(tracer, point, vpls, open, packing, Shapes::still);
    E = light_from(moving_.unhidden(tracer, point, vpls, open, w.suspect, w.visible), point, gradients);
  }
  E = E + added.E;
  r.met = static_cast<std::uint32_t>(added.met);
  const float R = radius_.radius(r.distances);
  if (!extrapolated_) return {point.p, point.n, R, E, id};
  RecordDetail thrown_away;
  if (has_room) shapes_->details.make_room(id);
  RecordDetail& detail = has_room ? shapes_->details[id] : thrown_away;
  return {point.p, point.n, shapes_->shaper.shape_of_vpls(R, E, gradients, detail), E, id};
}

void TemporalSource::settle(unsigned thread, const Record& record, InsertResult result) noexcept {
  Worker& w = workers_[thread];
  if (record.id == RecordTable::kNone || result == InsertResult::full) w.out_of_room = true;
  if (result != InsertResult::inserted) return;
  if (record.id == RecordTable::kNone) {
    ++w.homeless;
    return;
  }
  table_.keep(thread, record.id);
  table_[record.id].state = KeptRecord::live;
  ++w.made;
}

UseToTell TemporalSource::tells() const noexcept {
  if (!sweeping_) return UseToTell::nothing;
  const bool may_leave_out_any = shapes_ != nullptr && shapes_->details.are_guarded();
  return changed_ && !may_leave_out_any ? UseToTell::needed : UseToTell::answering;
}

void TemporalSource::used(const Record& record) noexcept {
  if (record.id == RecordTable::kNone) return;
  // Relaxed: whoever sets it sets the same; the end of the frame publishes. Read first, since most are set already.
  std::atomic_ref<std::uint8_t> state(table_[record.id].state);
  if (state.load(std::memory_order_relaxed) == KeptRecord::unused)
    state.store(KeptRecord::live, std::memory_order_relaxed);
}

void TemporalSource::report(PassFigures& figures) const noexcept {
  figures.records_kept = figures_.records_kept;
  figures.records_updated = figures_.records_updated;
  figures.records_dropped = figures_.records_dropped;
  figures.light_paths = figures_.light_paths;
  figures.light_paths_retraced = figures_.light_paths_retraced;
  figures.vpls_in_use = vpls_.count();
  if (extrapolated_) figures.bytes_of_details = shapes_->details.bytes();
  figures.bytes_beside_cache = table_.bytes() + figures.bytes_of_details;
}

std::unique_ptr<RecordSource> make_temporal_instant_caching(const PassSetup& setup) {
  return std::make_unique<TemporalSource>(setup);
}

}  // namespace icbench
