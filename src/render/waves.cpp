#include "render/waves.h"

#include <algorithm>
#include <limits>
#include <tuple>

#include "core/random.h"
#include "render/irradiance_cache.h"

namespace icbench {
namespace {

constexpr unsigned kCoarsest = 8;     // pixels between those of the first wave; a power of two
constexpr std::uint32_t kSquare = 3;  // edge of the squares that one miss is chosen from, spacings
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
  layers_ = primary.layers();
  for (unsigned spacing = kCoarsest; spacing > 0; spacing /= 2) {
    ask(cache, primary, spacing, Lattice::added, out);
    answer_misses(cache, primary, key, spacing, out);
  }
  if (!overture) return;
  ask(cache, primary, 1, Lattice::all, out);
  answer_misses(cache, primary, key, 1, out);  // if the cache was full
}

void Waves::answer_misses(WaveCache& cache, const PrimaryHits& primary, const SampleKey& key,
                          unsigned spacing, Image& out) {
  while (!misses_.empty()) {  // make() answers one in each square
    make(cache, primary, key, spacing, out);
    cache.publish();
    ask_again(cache, primary, out);
  }
}

// Pixels that find no record are left 0, but for the layers that do.
void Waves::ask(WaveCache& cache, const PrimaryHits& primary, unsigned spacing, Lattice lattice, Image& out) {
  const std::size_t grain = std::max<std::size_t>(1, spacing * spacing / 16);
  crew_.for_each(tiles_.size(), grain, [&](unsigned thread, Tracer& tracer, std::size_t i) {
    Worker& w = workers_[thread];
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
      if (!reflects(tracer.shared(), x.hit)) return;
      w.points.push_back({x.hit.p, x.hit.n});
      w.asked.push_back({i << 32 | w.asked.size(), x.pixel, x.layer, 0.0f});
    });
    w.replies.resize(w.points.size());
    w.answers.guard_by(tracer, w.use.leaks);
    cache.ask(thread, w.points, w.answers, w.replies);
    w.use.queries += w.points.size();
    for (std::size_t k = 0; k < w.points.size(); ++k) {
      Miss& m = w.asked[k];
      if (w.replies[k].E) {
        show(primary, m, *w.replies[k].E, out);
        ++w.use.hits;
      } else {
        m.most_R = w.replies[k].most_R;
        w.missed.push_back(m);
      }
    }
  });
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

// Chooses misses, has their records made, and inserts them. All chosen ones leave misses_.
void Waves::make(WaveCache& cache, const PrimaryHits& primary, const SampleKey& key, unsigned spacing,
                 Image& out) {
  const std::uint32_t side = kSquare * spacing, row = static_cast<std::uint32_t>(width_);
  const std::uint32_t across = row / side + 1, down = static_cast<std::uint32_t>(height_) / side + 1;
  const auto first_of = [&](const Miss& m) -> std::uint64_t& {
    const std::uint32_t square = (m.pixel / row / side) * across + m.pixel % row / side;
    return first_[std::size_t{square} * layers_ + m.layer];
  };
  first_.assign(std::size_t{across} * down * layers_, ~std::uint64_t{0});
  for (const Miss& m : misses_) first_of(m) = std::min(first_of(m), rank_of(m));
  const bool few = misses_.size() <= kFew;
  chosen_.clear();
  std::erase_if(misses_, [&](const Miss& m) {
    const bool is_first = few || first_of(m) == rank_of(m);
    if (is_first) chosen_.push_back(m);
    return is_first;
  });
  made_.resize(chosen_.size());
  crew_.for_each(chosen_.size(), 1, [&](unsigned thread, Tracer& tracer, std::size_t i) {
    const Miss& m = chosen_[i];
    Record record = source_.evaluate(thread, tracer, primary.at(m.pixel, m.layer), key);
    record.R = std::min(record.R, m.most_R);
    made_[i] = record.E;
    const InsertResult result = cache.insert(thread, record);
    workers_[thread].use.count(result);
    source_.settle(thread, record, result);
  });
  for (std::size_t i = 0; i < chosen_.size(); ++i) show(primary, chosen_[i], made_[i], out);
}

void Waves::ask_again(WaveCache& cache, const PrimaryHits& primary, Image& out) {
  replies_.resize(misses_.size());
  const std::size_t chunks = (misses_.size() + kAskedAtOnce - 1) / kAskedAtOnce;
  crew_.for_each(chunks, 1, [&](unsigned thread, Tracer& tracer, std::size_t chunk) {
    Worker& w = workers_[thread];
    w.answers.guard_by(tracer, w.use.leaks);
    const std::size_t first = chunk * kAskedAtOnce, n = std::min(kAskedAtOnce, misses_.size() - first);
    w.points.clear();
    for (std::size_t i = first; i < first + n; ++i) {
      const Hit& hit = primary.at(misses_[i].pixel, misses_[i].layer).hit;
      w.points.push_back({hit.p, hit.n});
    }
    cache.ask(thread, w.points, w.answers, std::span(replies_).subspan(first, n));
  });
  std::size_t left = 0;
  for (std::size_t i = 0; i < misses_.size(); ++i) {
    if (replies_[i].E) {
      show(primary, misses_[i], *replies_[i].E, out);
      ++workers_.front().use.hits;
    } else {
      misses_[left] = misses_[i];
      misses_[left++].most_R = replies_[i].most_R;
    }
  }
  misses_.resize(left);
}

void Waves::show(const PrimaryHits& primary, const Miss& m, const Irradiance& E, Image& out) const noexcept {
  const Visible x = primary.at(m.pixel, m.layer);
  out.pixels[m.pixel] += x.weight * reflected_radiance(rays_, x.hit, E);
}

}  // namespace icbench
