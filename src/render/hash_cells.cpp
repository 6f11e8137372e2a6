#include "render/hash_cells.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render/integrators.h"
#include "render/irradiance_cache.h"
#include "scene/directions.h"

namespace icbench {
namespace {

// Normals of one cell agree in each component within one step of 1 / kNormalSteps: walls along the axes lie in the
// middle of a step, and surfaces that bend are cut every 30 degrees or so.
constexpr float kNormalSteps = 2.0f;

// How far points are displaced at most, in edges of a cell: a whole edge, as in the source, hides the grid no better
// and mixes more of what is apart.
constexpr float kDisplacement = 0.25f;

class HashCellsPass final : public IndirectPass {
 public:
  HashCellsPass(const PassSetup& s, std::size_t cells, bool grows)
      : rays_(s.rays),
        crew_(s.crew),
        cell_size_(s.cell_size),
        paths_(s.paths),
        height_(s.height),
        tiles_(make_tiles(s.width, s.height, 32, TileOrder::morton)),
        grows_(grows),
        table_(cells),
        workers_(s.crew.size()) {}

  void begin_frame(const SceneChange&) override {
    for (Worker& w : workers_) w.use = {};
  }

  void begin_sample(const PrimaryHits& primary, const SampleKey& key) override {
    crew_.for_each(cells_.size(), 4096, [&](unsigned, Tracer&, std::size_t i) {
      if (cells_[i] != CellTable::kNone) table_.sweep(cells_[i]);
    });
    number_extras(primary);
    if (grows_ && table_.size() < 2 * primary.count()) table_ = CellTable(2 * primary.count());
    E_.resize(primary.count());
    cells_.assign(primary.count(), CellTable::kNone);
    for (Worker& w : workers_) w.brightest = 0.0f;
    key_ = key;
    grid_ = CellGrid(rays_.scene(), height_, cell_size_, key);
  }

  void tile(unsigned thread, Tracer& tracer, const PrimaryHits& primary, const SampleKey& key,
            const Tile& tile, Image& out) noexcept override {
    float& brightest = workers_[thread].brightest;
    const SampleKey first{key.seed, key.frame, key.sample * paths_};
    for_each_visible(tile, primary, [&](const Visible& x) {
      Irradiance& E = E_[number_of(x)];
      E = reflects(rays_, x.hit) ? own_irradiance(tracer, x, first) : Irradiance(0.0f);
      if (is_finite(E)) brightest = std::max({brightest, E.x, E.y, E.z});
      x.show(out, glm::vec3(0.0f));
    });
  }

  void end_sample(const PrimaryHits& primary, Image& out) override {
    float brightest = 0.0f;
    for (const Worker& w : workers_) brightest = std::max(brightest, w.brightest);
    // n max < 2^(e + 1), so n max 2^(61 - e) < 2^62.
    const double most = static_cast<double>(brightest) * static_cast<double>(primary.count());
    const double scale = most > 0.0 ? std::ldexp(1.0, 61 - std::ilogb(most)) : 1.0;
    // Crew::run orders the additions of all threads before the means.
    crew_.for_each(tiles_.size(), 1, [&](unsigned thread, Tracer&, std::size_t i) {
      add_tile(primary, tiles_[i], scale, workers_[thread].use);
    });
    crew_.for_each(tiles_.size(), 1,
                   [&](unsigned, Tracer&, std::size_t i) { show_tile(primary, tiles_[i], scale, out); });
  }

  PassFigures figures() const override {
    PassFigures figures;
    for (const Worker& w : workers_) figures.use += w.use;
    figures.records = figures.use.inserts;
    return figures;
  }

 private:
  struct alignas(kNoSharing) Worker {
    CacheUse use;
    float brightest = 0.0f;  // of all samples, W/m^2
  };

  // Points behind mirrors and glass come after those of the pixels.
  void number_extras(const PrimaryHits& primary) {
    if (primary.is_plain()) return;
    extras_.resize(primary.hits.size());
    auto next = static_cast<std::uint32_t>(primary.hits.size());
    for (std::size_t pixel = 0; pixel < extras_.size(); ++pixel) {
      extras_[pixel] = next;
      next += static_cast<std::uint32_t>(primary.extra[pixel].size());
    }
  }

  std::uint32_t number_of(const Visible& x) const noexcept {
    return x.layer == 0 ? x.pixel : extras_[x.pixel] + x.layer - 1;
  }

  Irradiance own_irradiance(Tracer& tracer, const Visible& x, const SampleKey& first) const noexcept {
    glm::dvec3 sum(0.0);
    for (std::uint32_t s = 0; s < paths_; ++s) {
      Pcg32 random(x.key(first.next_sample(s), Purpose::path));
      sum += sample_irradiance(tracer, x.hit, Light::indirect, random);
    }
    return sum / static_cast<double>(paths_);
  }

  void add_tile(const PrimaryHits& primary, const Tile& tile, double scale, CacheUse& use) noexcept {
    const auto in_units = [scale](float E) { return static_cast<std::int64_t>(double{E} * scale + 0.5); };
    for_each_visible(tile, primary, [&](const Visible& x) {
      const Irradiance& E = E_[number_of(x)];
      if (!reflects(rays_, x.hit) || !is_finite(E)) return;
      Pcg32 random(x.key(key_, Purpose::cell));
      const CellTable::Found found = table_.find_or_claim(grid_.fingerprint(x.hit, random));
      ++use.queries;
      if (found.cell == CellTable::kNone) {
        ++use.full;
        return;
      }
      ++(found.is_new ? use.inserts : use.hits);
      table_.add(found.cell, {in_units(E.x), in_units(E.y), in_units(E.z), 1});
      cells_[number_of(x)] = found.cell;
    });
  }

  void show_tile(const PrimaryHits& primary, const Tile& tile, double scale, Image& out) const noexcept {
    for_each_visible(tile, primary, [&](const Visible& x) {
      glm::vec3 L(0.0f);
      if (reflects(rays_, x.hit)) {
        Irradiance E = E_[number_of(x)];
        if (const std::uint32_t cell = cells_[number_of(x)]; cell != CellTable::kNone) {
          const CellSum sum = table_.sum(cell);
          const double share = 1.0 / (scale * static_cast<double>(sum.points));
          E = glm::vec3(share * glm::dvec3(static_cast<double>(sum.r), static_cast<double>(sum.g),
                                           static_cast<double>(sum.b)));
        }
        L = reflected_radiance(rays_, x.hit, E);
      }
      x.show(out, L);
    });
  }

  const RayTracer& rays_;
  Crew& crew_;
  float cell_size_;
  std::uint32_t paths_;
  int height_;
  std::vector<Tile> tiles_;
  bool grows_;  // so that nobody is refused
  CellTable table_;
  std::vector<Worker> workers_;

  // Of the sample of the pixels that is under way.
  SampleKey key_;
  CellGrid grid_;
  std::vector<Irradiance> E_;          // by number of the visible point
  std::vector<std::uint32_t> cells_;   // likewise
  std::vector<std::uint32_t> extras_;  // number of a pixel's first further point
};

}  // namespace

// All atomics are relaxed. A fingerprint publishes nothing but itself: the numbers of a cell are 0 from its
// construction or its sweep on, and Crew::run orders both before any thread that adds (its partner), as it orders every
// addition before the loads of sum(). Additions commute, and no thread reads what another adds meanwhile.

CellTable::CellTable(std::size_t cells)
    : mask_(std::bit_ceil(std::clamp<std::size_t>(cells, 1, std::size_t{1} << 31)) - 1),
      cells_(std::make_unique<Cell[]>(mask_ + 1)) {}

CellTable::Found CellTable::find_or_claim(std::uint64_t fingerprint) noexcept {
  const std::size_t probes = std::min<std::size_t>(kMaxProbes, size());
  for (std::size_t i = 0, at = fingerprint & mask_; i < probes; ++i, at = (at + 1) & mask_) {
    std::atomic<std::uint64_t>& place = cells_[at].fingerprint;
    std::uint64_t there = place.load(std::memory_order_relaxed);
    if (there == 0 && place.compare_exchange_strong(there, fingerprint, std::memory_order_relaxed,
                                                    std::memory_order_relaxed))
      return {static_cast<std::uint32_t>(at), true};
    // The loser of the CAS has learnt who won.
    if (there == fingerprint) return {static_cast<std::uint32_t>(at), false};
  }
  return {kNone, false};
}

void CellTable::add(std::uint32_t cell, const CellSum& point) noexcept {
  Cell& c = cells_[cell];
  c.r.fetch_add(point.r, std::memory_order_relaxed);
  c.g.fetch_add(point.g, std::memory_order_relaxed);
  c.b.fetch_add(point.b, std::memory_order_relaxed);
  c.points.fetch_add(point.points, std::memory_order_relaxed);
}

CellSum CellTable::sum(std::uint32_t cell) const noexcept {
  const Cell& c = cells_[cell];
  return {c.r.load(std::memory_order_relaxed), c.g.load(std::memory_order_relaxed),
          c.b.load(std::memory_order_relaxed), c.points.load(std::memory_order_relaxed)};
}

void CellTable::sweep(std::uint32_t cell) noexcept {
  Cell& c = cells_[cell];
  c.fingerprint.store(0, std::memory_order_relaxed);
  c.r.store(0, std::memory_order_relaxed);
  c.g.store(0, std::memory_order_relaxed);
  c.b.store(0, std::memory_order_relaxed);
  c.points.store(0, std::memory_order_relaxed);
}

CellGrid::CellGrid(const Scene& scene, int height, float size, const SampleKey& key) noexcept
    : eye_(scene.camera.eye),
      size_(double{size} * 2.0 * std::tan(0.5 * double{scene.camera.fov_y}) / height) {
  const glm::vec3 farthest = glm::max(glm::abs(scene.bounds.lower), glm::abs(scene.bounds.upper));
  const float most = std::max({farthest.x, farthest.y, farthest.z});
  finest_ = most > 0.0f ? std::ilogb(most) - 29 : 0;
  Pcg32 random(key.of_pixel(0, Purpose::cell) + 1);  // no pixel's own
  shift_.x = random.uniform();
  shift_.y = random.uniform();
  shift_.z = random.uniform();
}

double CellGrid::edge(const glm::vec3& p) const noexcept {
  const double wanted = size_ * glm::distance(glm::dvec3(p), eye_);
  return std::ldexp(1.0, wanted > 0.0 ? std::max(finest_, std::ilogb(wanted)) : finest_);
}

std::uint64_t CellGrid::fingerprint(const Hit& hit, Pcg32& random) const noexcept {
  const double edge = this->edge(hit.p);
  const Basis frame(hit.n);
  const float u = kDisplacement * (2.0f * random.uniform() - 1.0f);
  const float v = kDisplacement * (2.0f * random.uniform() - 1.0f);
  const glm::dvec3 p = glm::dvec3(hit.p) / edge + glm::dvec3(u * frame.s + v * frame.t) + shift_;
  const auto whole = [](double x) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(x)));
  };
  std::uint64_t direction = 0;
  for (int c = 0; c < 3; ++c)
    direction = direction << 8 | (whole(double{hit.n[c] * kNormalSteps} + 0.5) & 0xff);
  const auto level = static_cast<std::uint64_t>(std::ilogb(edge)) & 0xffff;
  const std::uint64_t name =
      hash_keys(hash_keys(whole(p.x), whole(p.y), whole(p.z)), direction << 16 | level);
  return name != 0 ? name : 1;
}

std::unique_ptr<IndirectPass> make_hash_cells(const PassSetup& setup, std::size_t cells) {
  return std::make_unique<HashCellsPass>(setup, cells, false);
}

std::unique_ptr<IndirectPass> make_hash_cells(const PassSetup& setup) {
  // Twice as many as there can be, so that hardly any place is taken: where pixels see several points through glass
  // that is known when they have been seen.
  const std::size_t pixels = static_cast<std::size_t>(setup.width) * static_cast<std::size_t>(setup.height);
  return std::make_unique<HashCellsPass>(setup, 2 * pixels, true);
}

}  // namespace icbench
