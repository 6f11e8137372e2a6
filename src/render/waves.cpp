#include "render/waves.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <tuple>
#include <utility>

#include "core/interpolation.h"
#include "core/random.h"
#include "render/guarded_sum.h"
#include "render/irradiance_cache.h"
#include "render/place_hash.h"

namespace icbench {
namespace {

constexpr unsigned kCoarsest = 8;  // pixels between those of the first wave; a power of two
constexpr std::size_t kAskedAtOnce = 64;

// What is told of the work of a sample: as much for each wave, whose misses are then what is done of it, and the rest
// for what comes after them.
constexpr int kWaves = std::bit_width(kCoarsest);
constexpr double kLastWork = 0.1, kWaveWork = (1.0 - kLastWork) / kWaves;

bool is_added(unsigned x, unsigned y, unsigned spacing) noexcept {
  if (((x | y) & (spacing - 1)) != 0) return false;
  return spacing == kCoarsest || ((x | y) & (2 * spacing - 1)) != 0;
}

// Edge of the blocks that a thread makes records for at a time, pixels: small enough that there are many, large enough
// that few records of a round are made for places next to each other.
std::uint32_t edge_of_blocks(unsigned spacing) noexcept { return std::max(4 * spacing, 8u); }

// The bits of x, which has 16, on even places.
std::uint32_t spread(std::uint32_t x) noexcept {
  x = (x | x << 8) & 0x00ff00ffu;
  x = (x | x << 4) & 0x0f0f0f0fu;
  x = (x | x << 2) & 0x33333333u;
  return (x | x << 1) & 0x55555555u;
}

// Numbers of blocks along a Z-curve.
std::uint32_t block_number(std::uint32_t column, std::uint32_t line) noexcept {
  return spread(column) | spread(line) << 1;
}

// The colour of a block on a chessboard, 0 or 1.
std::uint32_t colour_of(std::uint32_t block) noexcept { return (block ^ block >> 1) & 1u; }

}  // namespace

void Answers::ask_at(std::span<const SurfacePoint> points) noexcept {
  points_ = points;
  tells_ = source_.tells();
  if (shapes_ == nullptr || !extrapolates(shapes_->shaper.level())) return;
  for (std::size_t i = 0; i < points.size(); ++i) queries_[i].extrapolator.emplace(*shapes_, points[i]);
}

void Answers::take(std::size_t i, const Record& r, float weight) noexcept {
  Query& query = queries_[i];
  const SurfacePoint& x = points_[i];
  if (tells_ == UseToTell::answering) source_.used(r);
  if (clamps_) query.most_R = std::min(query.most_R, allowed_by_neighbour(r, x.p));
  const Contribution c =
      query.extrapolator ? query.extrapolator->of(r, weight) : Contribution{r.E, weight, true};
  if (!(c.w > 0.0f)) return;
  const std::uint64_t order = hash_of(r.p);
  if (tells_ == UseToTell::needed && c.covers) query.needed.offer(r, order);
  std::uint32_t ray = kTrusted;
  if (guarded_ && is_suspect(x, r, shapes_->details.marks(r.id))) {
    ray = static_cast<std::uint32_t>(query.rays.size());
    query.rays.push_back(leak_ray(tracer_->shared(), x, r));
  }
  query.answers.push_back({order, c.E.x, c.E.y, c.E.z, c.w, c.covers, ray});
}

Reply Answers::settle(std::size_t i) noexcept {
  Query& query = queries_[i];
  // What is alike may be in any order.
  const auto key = [](const Answer& a) { return std::tie(a.red, a.green, a.blue, a.w); };
  std::sort(query.answers.begin(), query.answers.end(), [&](const Answer& a, const Answer& b) {
    return a.order != b.order ? a.order < b.order : key(a) < key(b);
  });
  CoveredMean sum;
  for (const Answer& a : query.answers)
    if (a.ray == kTrusted) sum.add(a.brings());
  if (!query.rays.empty()) {
    LeakGuard guard(*tracer_, *tests_, sum);
    for (const Answer& a : query.answers)
      if (a.ray != kTrusted && guard.is_worth_a_ray(a.brings())) guard.add(a.brings(), query.rays[a.ray]);
    guard.judge();
  }
  query.needed.tell(source_);
  query.needed = {};
  const Reply reply{sum.result(), query.most_R};
  query.answers.clear();
  query.rays.clear();
  query.most_R = std::numeric_limits<float>::infinity();
  return reply;
}

Waves::Waves(const RayTracer& rays, RecordSource& source, Crew& crew, std::function<void(double)> did)
    : rays_(rays), source_(source), crew_(crew), did_(std::move(did)) {
  for (unsigned t = 0; t < crew.size(); ++t) workers_.emplace_back(source);
}

void Waves::reset_use() noexcept {
  for (Worker& w : workers_) w.use = {};
}

CacheUse Waves::use() const noexcept {
  CacheUse out;
  for (const Worker& w : workers_) out += w.use;
  return out;
}

void Waves::render(WaveCache& cache, const PrimaryHits& primary, const SampleKey& key, bool overture,
                   Image& out) {
  if (width_ != primary.width || height_ != primary.height) {
    width_ = primary.width;
    height_ = primary.height;
    tiles_ = make_tiles(width_, height_, kFrameTile, TileOrder::morton);
    asked_.resize(primary.hits.size());
  }
  stage_ = 0;
  const RecordShapes* const shapes = source_.shapes();
  const bool overlaps = shapes != nullptr && is_elliptic(shapes->shaper.level());
  const Frame frame{cache, primary, key, out, overlaps && !overture};
  for (Worker& w : workers_) w.made.clear();
  Steps steps(crew_.size());
  crew_.run([&](unsigned index, Tracer& tracer) {
    const Thread t{frame, steps, index, tracer};
    if (key.sample == 0) {
      for (unsigned spacing = kCoarsest; spacing > 0; spacing /= 2) {
        ask(t, spacing, Which::added);
        answer_misses(t, kWaveWork);
      }
    } else {  // nearly all records are there
      ask(t, 1, Which::all);
      answer_misses(t, kWaves * kWaveWork);
    }
    if (overture) {
      ask(t, 1, Which::all);
      answer_misses(t, kLastWork);  // if the cache was full, or as below
    } else if (frame.asks_again) {
      steps.end([&] { gather_made(); });
      ask(t, 1, Which::outdated);
      answer_misses(t, kLastWork);  // where the guard no longer asks for the only record that covered a hit
    } else {
      steps.end([&] { tell(kLastWork); });
    }
  });
}

void Waves::tell(double work) const {
  if (did_) did_(work);
}

void Waves::answer_misses(const Thread& t, double work) {
  t.steps.end([&] {
    gather_misses();
    choose_runs();
    if (misses_.empty())
      tell(work);
    else
      work_of_a_miss_ = work / static_cast<double>(misses_.size());
  });
  while (!runs_.empty()) {  // each answers one miss, so that none is left in the end
    t.steps.share(runs_.size(), 1, [&](std::size_t i) { make(t, runs_[i]); });
    t.steps.end([&] {
      t.frame.cache.publish();
      ++stage_;
    });
    ask_again(t);
    t.steps.end([&] {
      keep_unanswered(t.frame);
      choose_runs();
    });
  }
}

// Pixels that find no record are left 0, but for the layers that do.
void Waves::ask(const Thread& t, unsigned spacing, Which which) {
  const std::size_t grain = std::max<std::size_t>(1, spacing * spacing / 16);
  const std::uint32_t edge = edge_of_blocks(spacing);
  Worker& w = workers_[t.index];
  w.answers.guard_by(t.tracer, w.use.leaks);
  t.steps.share(tiles_.size(), grain, [&](std::size_t i) {
    if (which == Which::outdated) {
      find_made_in(tiles_[i], w.made_here);
      if (w.made_here.empty()) return;
    }
    w.points.clear();
    w.asked.clear();
    const auto each_pixel = [&](const Tile& tile, int width, auto&& f) {
      for_each_pixel(tile, width, [&](std::uint32_t pixel) {
        const auto row = static_cast<std::uint32_t>(width);
        if (which == Which::added && !is_added(pixel % row, pixel / row, spacing)) return;
        if (which == Which::outdated && !is_outdated(t.frame, pixel, w.made_here)) return;
        asked_[pixel] = stage_;
        f(pixel);
      });
    };
    for_each_visible(tiles_[i], t.frame.primary, each_pixel, [&](const Visible& x) {
      if (x.layer == 0) t.frame.out.pixels[x.pixel] = glm::vec3(0.0f);
      if (!reflects(rays_, x.hit)) return;
      if (which == Which::outdated) {
        if (const Made* own = made_at(x.pixel, x.layer, w.made_here)) {
          show(t.frame, x.pixel, x.layer, own->record.E);
          return;
        }
      }
      w.points.push_back({x.hit.p, x.hit.n});
      w.asked.push_back({x.pixel, x.layer});
    });
    w.replies.resize(w.points.size());
    t.frame.cache.ask(t.index, w.points, w.answers, w.replies);
    w.use.queries += w.points.size();
    for (std::size_t k = 0; k < w.points.size(); ++k) {
      const auto [pixel, layer] = w.asked[k];
      if (w.replies[k].E) {
        show(t.frame, pixel, layer, *w.replies[k].E);
        ++w.use.hits;
      } else {
        const auto row = static_cast<std::uint32_t>(width_);
        const std::uint32_t block = block_number(pixel % row / edge, pixel / row / edge);
        const auto rank = static_cast<std::uint32_t>(hash_keys(pixel, layer));
        w.missed.push_back({block, rank, pixel, layer, w.replies[k].most_R, false, false});
      }
    }
  });
}

void Waves::gather_misses() {
  misses_.clear();
  for (Worker& w : workers_) {
    misses_.insert(misses_.end(), w.missed.begin(), w.missed.end());
    w.missed.clear();
  }
  std::sort(misses_.begin(), misses_.end(), [](const Miss& a, const Miss& b) {
    return std::tie(a.block, a.rank, a.pixel, a.layer) < std::tie(b.block, b.rank, b.pixel, b.layer);
  });
  colour_ = 0;
}

void Waves::gather_made() {
  made_.clear();
  for (Worker& w : workers_) made_.insert(made_.end(), w.made.begin(), w.made.end());
  std::sort(made_.begin(), made_.end(), [](const Made& a, const Made& b) {
    return std::tie(a.pixel, a.layer) < std::tie(b.pixel, b.layer);
  });
}

void Waves::find_made_in(const Tile& tile, std::vector<const Made*>& made_here) const {
  made_here.clear();
  const auto width = static_cast<std::uint32_t>(width_);
  const auto x0 = static_cast<std::uint32_t>(tile.x0), x1 = static_cast<std::uint32_t>(tile.x1);
  for (auto y = static_cast<std::uint32_t>(tile.y0); y < static_cast<std::uint32_t>(tile.y1); ++y) {
    const auto first = std::lower_bound(made_.begin(), made_.end(), y * width + x0,
                                        [](const Made& m, std::uint32_t pixel) { return m.pixel < pixel; });
    for (auto m = first; m != made_.end() && m->pixel < y * width + x1; ++m) made_here.push_back(&*m);
  }
}

const Waves::Made* Waves::made_at(std::uint32_t pixel, std::uint32_t layer,
                                  std::span<const Made* const> made_here) noexcept {
  const auto found = std::lower_bound(
      made_here.begin(), made_here.end(), Asked{pixel, layer}, [](const Made* m, const Asked& asked) {
        return std::tie(m->pixel, m->layer) < std::tie(asked.pixel, asked.layer);
      });
  return found != made_here.end() && (*found)->pixel == pixel && (*found)->layer == layer ? *found : nullptr;
}

bool Waves::is_outdated(const Frame& frame, std::uint32_t pixel,
                        std::span<const Made* const> made_here) const noexcept {
  for (std::uint32_t layer = 0; layer < frame.primary.layers_of(pixel); ++layer) {
    const Hit& hit = frame.primary.at(pixel, layer).hit;
    if (!reflects(rays_, hit) || made_at(pixel, layer, made_here) != nullptr) continue;
    for (const Made* m : made_here) {
      if (m->is_stored && m->stage >= asked_[pixel] &&
          counts_at(*source_.shapes(), m->record, {hit.p, hit.n}))
        return true;
    }
  }
  return false;
}

// Takes the blocks of the next colour that has misses.
void Waves::choose_runs() {
  runs_.clear();
  replies_.assign(misses_.size(), Reply{});
  for (int turn = 0; turn < 2 && runs_.empty(); ++turn) {
    for (std::size_t begin = 0, end; begin < misses_.size(); begin = end) {
      const std::uint32_t block = misses_[begin].block;
      for (end = begin + 1; end < misses_.size() && misses_[end].block == block;) ++end;
      if (colour_of(block) == colour_) runs_.push_back({begin, end});
    }
    colour_ = 1 - colour_;
  }
  // The longest first, or all would wait for the thread that came to it last.
  std::stable_sort(runs_.begin(), runs_.end(),
                   [](const Run& a, const Run& b) { return a.end - a.begin > b.end - b.begin; });
}

// Makes records until each miss of a run has its own or is covered by those that were made for it. Whether it really
// is, the cache tells when it is asked again.
void Waves::make(const Thread& t, const Run& run) {
  const Frame& frame = t.frame;
  Worker& w = workers_[t.index];
  const float a = frame.cache.accuracy();
  w.own.clear();
  unsigned untold = 0;
  for (std::size_t i = run.begin; i < run.end; ++i) {
    Miss& m = misses_[i];
    untold += !std::exchange(m.is_told, true);
    const Visible x = frame.primary.at(m.pixel, m.layer);
    const SurfacePoint point{x.hit.p, x.hit.n};
    w.answers.ask_at({&point, 1});
    for (const Record& r : w.own)
      if (const float weight = split_sphere_weight(point, r, a); weight > 0.0f) w.answers[0](r, weight);
    const Reply own = w.answers.settle(0);
    if (own.E) continue;
    Record record = source_.evaluate(t.index, t.tracer, x, frame.key);
    record.R = std::min({record.R, m.most_R, own.most_R});
    replies_[i].E = record.E;
    m.is_made = true;
    const InsertResult result = frame.cache.insert(t.index, record);
    w.use.count(result);
    source_.settle(t.index, record, result);
    if (result == InsertResult::inserted) w.own.push_back(record);
    if (frame.asks_again)
      w.made.push_back({m.pixel, m.layer, stage_, result == InsertResult::inserted, record});
  }
  tell(untold * work_of_a_miss_);
}

void Waves::ask_again(const Thread& t) {
  const std::size_t chunks = (misses_.size() + kAskedAtOnce - 1) / kAskedAtOnce;
  Worker& w = workers_[t.index];
  t.steps.share(chunks, 1, [&](std::size_t chunk) {
    const std::size_t first = chunk * kAskedAtOnce, n = std::min(kAskedAtOnce, misses_.size() - first);
    w.points.clear();
    for (std::size_t i = first; i < first + n; ++i) {
      if (misses_[i].is_made) continue;
      const Hit& hit = t.frame.primary.at(misses_[i].pixel, misses_[i].layer).hit;
      w.points.push_back({hit.p, hit.n});
    }
    w.replies.resize(w.points.size());
    t.frame.cache.ask(t.index, w.points, w.answers, w.replies);
    std::size_t k = 0;
    for (std::size_t i = first; i < first + n; ++i) {
      if (misses_[i].is_made) continue;
      replies_[i] = w.replies[k++];
      if (replies_[i].E) ++w.use.hits;
    }
  });
}

void Waves::keep_unanswered(const Frame& frame) {
  std::size_t left = 0;
  unsigned untold = 0;
  for (std::size_t i = 0; i < misses_.size(); ++i) {
    if (replies_[i].E) {
      untold += !misses_[i].is_told;
      show(frame, misses_[i].pixel, misses_[i].layer, *replies_[i].E);
      // Other hits of the pixel may have been answered before.
      if (frame.primary.layers_of(misses_[i].pixel) == 1) asked_[misses_[i].pixel] = stage_;
    } else {
      misses_[left] = misses_[i];
      misses_[left++].most_R = replies_[i].most_R;
    }
  }
  misses_.resize(left);
  tell(untold * work_of_a_miss_);
}

void Waves::show(const Frame& frame, std::uint32_t pixel, std::uint32_t layer,
                 const Irradiance& E) const noexcept {
  const Visible x = frame.primary.at(pixel, layer);
  frame.out.pixels[pixel] += x.weight * reflected_radiance(rays_, x.hit, E);
}

}  // namespace icbench
