#include "render/waves.h"

#include <algorithm>
#include <limits>
#include <tuple>

#include "core/random.h"
#include "render/irradiance_cache.h"

namespace icbench {
namespace {

constexpr unsigned kCoarsest = 8;     // pixels between those of the first wave; a power of two
constexpr std::uint32_t kSquare = 4;  // edge of the squares that one miss is chosen from, spacings
constexpr std::size_t kFew = 64;      // misses that need not wait for each other
constexpr std::size_t kAskedAtOnce = 64;

bool comes_before(const Record& a, const Record& b) noexcept {
  const auto key = [](const Record& r) {
    return std::tie(r.p.x, r.p.y, r.p.z, r.n.x, r.n.y, r.n.z, r.R, r.E.x, r.E.y, r.E.z);
  };
  return a.p.x != b.p.x ? a.p.x < b.p.x : key(a) < key(b);
}

bool is_added(unsigned x, unsigned y, unsigned spacing) noexcept {
  if (((x | y) & (spacing - 1)) != 0) return false;
  return spacing == kCoarsest || ((x | y) & (2 * spacing - 1)) != 0;
}

// Neighbours in the image by one thread: rays from near each other go through the same nodes. Eight at most, and many
// chunks for each thread, so that all end at about the same time.
std::size_t grain_of(std::size_t records, unsigned threads) noexcept {
  return std::clamp<std::size_t>(records / (32 * std::size_t{threads}), 1, 8);
}

}  // namespace

Reply Answers::settle(std::size_t i, const SurfacePoint& x) noexcept {
  std::vector<Answer>& found = found_[i];
  std::sort(found.begin(), found.end(),
            [](const Answer& a, const Answer& b) { return comes_before(a.record, b.record); });
  const auto sum_by = [&](auto sum) {
    for (const Answer& a : found) sum(a.record, a.weight);
    return sum.result();
  };
  Reply reply{shapes_ == nullptr              ? sum_by(Interpolator{})
              : shapes_->details.have_marks() ? sum_by(GuardedSum(*shapes_, *tracer_, x, *tests_))
                                              : sum_by(Extrapolator(*shapes_, x)),
              std::numeric_limits<float>::infinity()};
  if (shapes_ != nullptr && shapes_->clamps_to_neighbours()) {
    for (const Answer& a : found) reply.most_R = std::min(reply.most_R, allowed_by_neighbour(a.record, x.p));
  }
  if (source_.wants_use()) {
    for (const Answer& a : found) source_.used(a.record);
  }
  found.clear();
  return reply;
}

Waves::Waves(const RayTracer& rays, RecordSource& source, Crew& crew)
    : rays_(rays), source_(source), crew_(crew) {
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
  }
  const Frame frame{cache, primary, key, out};
  Steps steps(crew_.size());
  crew_.run([&](unsigned index, Tracer& tracer) {
    const Thread t{frame, steps, index, tracer};
    for (unsigned spacing = kCoarsest; spacing > 0; spacing /= 2) {
      ask(t, spacing, Lattice::added);
      answer_misses(t, spacing);
    }
    if (!overture) return;
    ask(t, 1, Lattice::all);
    answer_misses(t, 1);  // if the cache was full
  });
}

void Waves::answer_misses(const Thread& t, unsigned spacing) {
  t.steps.end([&] {
    gather_misses();
    choose(spacing);
  });
  while (!chosen_.empty()) {  // one in each square that has any, so that none is left in the end
    make_chosen(t);
    t.steps.end([&] {
      show_made(t.frame);
      t.frame.cache.publish();
    });
    ask_again(t);
    t.steps.end([&] {
      keep_unanswered(t.frame);
      choose(spacing);
    });
  }
}

// Pixels that find no record are left 0, but for the layers that do.
void Waves::ask(const Thread& t, unsigned spacing, Lattice lattice) {
  const auto& [cache, primary, key, out] = t.frame;
  const std::size_t grain = std::max<std::size_t>(1, spacing * spacing / 16);
  Worker& w = workers_[t.index];
  w.answers.guard_by(t.tracer, w.use.leaks);
  t.steps.share(tiles_.size(), grain, [&](std::size_t i) {
    w.points.clear();
    w.asked.clear();
    const auto each_pixel = [&](const Tile& tile, int width, auto&& f) {
      for_each_pixel(tile, width, [&](std::uint32_t pixel) {
        const auto row = static_cast<std::uint32_t>(width);
        if (lattice == Lattice::all || is_added(pixel % row, pixel / row, spacing)) f(pixel);
      });
    };
    for_each_visible(tiles_[i], primary, each_pixel, [&](const Visible& x) {
      if (x.layer == 0) out.pixels[x.pixel] = glm::vec3(0.0f);
      if (!reflects(rays_, x.hit)) return;
      w.points.push_back({x.hit.p, x.hit.n});
      w.asked.push_back({i << 32 | w.asked.size(), x.pixel, x.layer, 0.0f});
    });
    w.replies.resize(w.points.size());
    cache.ask(t.index, w.points, w.answers, w.replies);
    w.use.queries += w.points.size();
    for (std::size_t k = 0; k < w.points.size(); ++k) {
      Miss& m = w.asked[k];
      if (w.replies[k].E) {
        show(t.frame, m, *w.replies[k].E);
        ++w.use.hits;
      } else {
        m.most_R = w.replies[k].most_R;
        w.missed.push_back(m);
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
  std::sort(misses_.begin(), misses_.end(), [](const Miss& a, const Miss& b) { return a.place < b.place; });
}

// In a random order, unique in an image. The rank of a miss in its square decides when its record is made.
std::uint64_t Waves::rank_of(const Miss& m) const noexcept {
  return hash_keys(m.pixel, m.layer) << 32 | m.pixel;
}

// Takes those of misses_ whose records are made next.
void Waves::choose(unsigned spacing) {
  const std::uint32_t side = kSquare * spacing, row = static_cast<std::uint32_t>(width_);
  const std::uint32_t across = row / side + 1, down = static_cast<std::uint32_t>(height_) / side + 1;
  const auto first_of = [&](const Miss& m) -> std::uint64_t& {
    const std::uint32_t square = (m.pixel / row / side) * across + m.pixel % row / side;
    return first_[square];
  };
  first_.resize(std::max(first_.size(), std::size_t{across} * down));
  for (const Miss& m : misses_) first_of(m) = ~std::uint64_t{0};  // the others are not looked at
  for (const Miss& m : misses_) first_of(m) = std::min(first_of(m), rank_of(m));
  const bool few = misses_.size() <= kFew;
  chosen_.clear();
  std::erase_if(misses_, [&](const Miss& m) {
    const bool is_first = few || first_of(m) == rank_of(m);
    if (is_first) chosen_.push_back(m);
    return is_first;
  });
  made_.resize(chosen_.size());
  replies_.resize(misses_.size());
}

void Waves::make_chosen(const Thread& t) {
  const Frame& frame = t.frame;
  t.steps.share(chosen_.size(), grain_of(chosen_.size(), crew_.size()), [&](std::size_t i) {
    const Miss& m = chosen_[i];
    Record record = source_.evaluate(t.index, t.tracer, frame.primary.at(m.pixel, m.layer), frame.key);
    record.R = std::min(record.R, m.most_R);
    made_[i] = record.E;
    const InsertResult result = frame.cache.insert(t.index, record);
    workers_[t.index].use.count(result);
    source_.settle(t.index, record, result);
  });
}

void Waves::show_made(const Frame& frame) {
  for (std::size_t i = 0; i < chosen_.size(); ++i) show(frame, chosen_[i], made_[i]);
}

void Waves::ask_again(const Thread& t) {
  const std::size_t chunks = (misses_.size() + kAskedAtOnce - 1) / kAskedAtOnce;
  Worker& w = workers_[t.index];
  t.steps.share(chunks, 1, [&](std::size_t chunk) {
    const std::size_t first = chunk * kAskedAtOnce, n = std::min(kAskedAtOnce, misses_.size() - first);
    w.points.clear();
    for (std::size_t i = first; i < first + n; ++i) {
      const Hit& hit = t.frame.primary.at(misses_[i].pixel, misses_[i].layer).hit;
      w.points.push_back({hit.p, hit.n});
    }
    t.frame.cache.ask(t.index, w.points, w.answers, std::span(replies_).subspan(first, n));
  });
}

void Waves::keep_unanswered(const Frame& frame) {
  std::size_t left = 0;
  for (std::size_t i = 0; i < misses_.size(); ++i) {
    if (replies_[i].E) {
      show(frame, misses_[i], *replies_[i].E);
      ++workers_.front().use.hits;
    } else {
      misses_[left] = misses_[i];
      misses_[left++].most_R = replies_[i].most_R;
    }
  }
  misses_.resize(left);
}

void Waves::show(const Frame& frame, const Miss& m, const Irradiance& E) const noexcept {
  const Visible x = frame.primary.at(m.pixel, m.layer);
  frame.out.pixels[m.pixel] += x.weight * reflected_radiance(rays_, x.hit, E);
}

}  // namespace icbench
