// A minimal renderer around a shared irradiance cache: oneTBB's tasks, no exceptions, no RTTI, nothing of icbench but
// core and caches.
//
// The scene has a closed form: the inside of a sphere of radius 1 m, its wall diffuse with albedo rho, lit by a point
// light of intensity I, W/sr, anywhere in it. What a wall reflects arrives everywhere on the wall alike, since between
// any two of its points cos cos / (pi d^2) is 1 / (4 pi). So light reflected once makes E = rho I, W/m^2, everywhere,
// though direct light varies tenfold. Pictures of independent seeds must have that mean, within four standard errors.
#include <oneapi/tbb/blocked_range2d.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

#include "caches/cache_file.h"
#include "caches/direct.h"
#include "caches/packed_octree.h"
#include "core/random.h"

namespace {

using namespace icbench;
using Cache = Direct<Packed<StdSync>>;  // packed_wait_free

constexpr float kAlbedo = 0.7f, kIntensity = 2.0f;
constexpr glm::vec3 kLight(0.3f, 0.4f, -0.2f), kEye(-0.5f, 0.1f, 0.2f);
constexpr int kWidth = 48, kHeight = 32, kRays = 64;
constexpr float kMean = kAlbedo * kIntensity;

/// Where a ray from within the sphere meets its wall.
SurfacePoint wall(const glm::vec3& o, const glm::vec3& d) {
  const float b = glm::dot(o, d);
  const float half = std::sqrt(std::max(b * b + 1.0f - glm::dot(o, o), 0.0f));
  const glm::vec3 p = glm::normalize(o + (half - b) * d);
  return {p, -p};
}

float direct(const SurfacePoint& x) {
  const glm::vec3 to_light = kLight - x.p;
  const float d2 = glm::dot(to_light, to_light);
  return kIntensity * glm::dot(to_light, x.n) / (d2 * std::sqrt(d2));
}

/// Light reflected once, by rays over the hemisphere; the harmonic mean of their lengths is 1 m everywhere.
Record make_record(const SurfacePoint& x, std::uint32_t pixel, std::uint64_t seed) {
  Pcg32 random(hash_keys(seed, pixel));
  const glm::vec3 u = glm::normalize(std::abs(x.n.x) > 0.5f ? glm::vec3(-x.n.y, x.n.x, 0.0f)
                                                            : glm::vec3(0.0f, -x.n.z, x.n.y));
  const glm::vec3 v = glm::cross(x.n, u);
  float E = 0.0f;
  for (int i = 0; i < kRays; ++i) {
    const float phi = 2.0f * std::numbers::pi_v<float> * random.uniform(), s = random.uniform();
    const glm::vec3 d = std::sqrt(s) * (std::cos(phi) * u + std::sin(phi) * v) + std::sqrt(1.0f - s) * x.n;
    E += kAlbedo / kRays * direct(wall(x.p, d));
  }
  return {x.p, x.n, 1.0f, Irradiance(E), pixel};
}

SurfacePoint seen_by(int x, int y) {
  const glm::vec3 d(1.0f, (x + 0.5f) / kWidth - 0.5f, (y + 0.5f) / kHeight - 0.5f);
  return wall(kEye, glm::normalize(d));
}

/// What a slot of the task arena works with. A task is one thread's while it runs, and that thread's slot nobody
/// else's; so sessions by slot are never used by two threads at once, whatever was stolen by whom. Were a record itself
/// made by tasks, its thread might take up another tile meanwhile: with the same session, but between two operations.
struct alignas(kNoSharing) Slot {
  Cache::Session session;
  std::uint32_t made = 0, full = 0;
  double sum = 0.0;
};

/// The renderer.
void render(tbb::task_arena& arena, std::vector<Slot>& slots, std::uint64_t seed,
            std::vector<float>& picture) {
  const tbb::blocked_range2d<int> pixels(0, kHeight, 4, 0, kWidth, 4);
  const auto tile = [&](const tbb::blocked_range2d<int>& range) {
    Slot& slot = slots[static_cast<std::size_t>(tbb::this_task_arena::current_thread_index())];
    for (int y = range.rows().begin(); y < range.rows().end(); ++y) {
      for (int x = range.cols().begin(); x < range.cols().end(); ++x) {
        const auto pixel = static_cast<std::uint32_t>(y * kWidth + x);
        const SurfacePoint at = seen_by(x, y);
        std::optional<Irradiance> E = slot.session.query(at);
        if (!E) {
          const Record record = make_record(at, pixel, seed);
          ++slot.made;
          // A full cache costs time, not light: the picture goes on with what was computed, and the count tells that a
          // larger capacity would have paid.
          if (slot.session.insert(record) == InsertResult::full) ++slot.full;
          E = record.E;
        }
        slot.sum += E->x;
        picture[pixel] = kAlbedo * std::numbers::inv_pi_v<float> * (E->x + direct(at));
      }
    }
  };
  arena.execute([&] { tbb::parallel_for(pixels, tile); });
}

/// Sums of what the slots counted.
struct Totals {
  std::uint32_t made = 0, full = 0;
  double sum = 0.0;
};
Totals collect(std::vector<Slot>& slots) {
  Totals t;
  for (Slot& s : slots) {
    t.made += std::exchange(s.made, 0u);
    t.full += std::exchange(s.full, 0u);
    t.sum += std::exchange(s.sum, 0.0);
  }
  return t;
}

std::vector<Slot> open_slots(Cache& cache, int n) {
  std::vector<Slot> slots;
  for (int i = 0; i < n; ++i) slots.push_back({cache.open_session(static_cast<std::uint32_t>(i))});
  return slots;
}

int failures = 0;

void check(bool holds, const char* what) {
  if (holds) return;
  std::printf("FAILED: %s\n", what);
  ++failures;
}

/// Pictures of many seeds from an empty cache each.
void check_the_mean(tbb::task_arena& arena, std::uint32_t capacity, bool should_be_full) {
  constexpr int kPictures = 200;
  const int n = arena.max_concurrency();
  Cache cache({.bounds = {glm::vec3(-1.001f), glm::vec3(1.001f)},
               .a_max = 0.3f,
               .a = 0.3f,
               .capacity = capacity,
               .max_sessions = static_cast<std::uint32_t>(n)});
  std::vector<Slot> slots = open_slots(cache, n);
  std::vector<float> picture(kWidth * kHeight);
  double sum = 0.0, squares = 0.0;
  std::uint32_t made = 0, full = 0;
  for (int i = 0; i < kPictures; ++i) {
    cache.clear();
    render(arena, slots, static_cast<std::uint64_t>(i), picture);
    const Totals t = collect(slots);
    const double mean = t.sum / (kWidth * kHeight);
    sum += mean;
    squares += mean * mean;
    made += t.made;
    full += t.full;
  }
  const double mean = sum / kPictures;
  const double error = std::sqrt((squares / kPictures - mean * mean) / (kPictures - 1));
  std::printf(
      "capacity %u: mean %.5f +- %.5f, should be %.5f; %.1f records made a picture, %.1f of them not kept\n",
      capacity, mean, error, static_cast<double>(kMean), static_cast<double>(made) / kPictures,
      static_cast<double>(full) / kPictures);
  check(std::abs(mean - kMean) <= 4.0 * error, "the mean is the closed form's");
  check(error < 0.005 * kMean, "the mean is known well enough to tell");
  check((full > 0) == should_be_full, "a cache is full when it is");
  check(full > 0 || made < kPictures * kWidth * kHeight / 4, "records serve many pixels");
}

/// A picture, its cache saved, and the picture again from what was loaded.
void check_a_warm_start(tbb::task_arena& arena, const char* path) {
  const int n = arena.max_concurrency();
  CacheConfig config{.bounds = {glm::vec3(-1.001f), glm::vec3(1.001f)},
                     .a_max = 0.3f,
                     .a = 0.3f,
                     .capacity = 100'000,
                     .max_sessions = static_cast<std::uint32_t>(n)};
  Cache cold(config);
  std::vector<Slot> slots = open_slots(cold, n);
  std::vector<float> picture(kWidth * kHeight);
  render(arena, slots, 1, picture);
  Failure failed = save_cache(path, cold);
  CacheFile file;
  if (!failed) failed = file.open(path);
  config = file.config();
  Cache warm(config);
  slots = open_slots(warm, n);
  if (!failed) failed = load_records(file, slots[0].session);
  if (failed) return check(false, failed->c_str());
  render(arena, slots, 2, picture);
  check(file.records() > 0, "records were saved");
  check(collect(slots).made == 0, "a loaded cache spares all work");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FILE, where a cache may be saved\n", argv[0]);
    return 2;
  }
  constexpr int kThreads = 4;
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, kThreads);
  tbb::task_arena arena(kThreads);
  check_the_mean(arena, 100'000, false);
  check_the_mean(arena, 16, true);
  check_a_warm_start(arena, argv[1]);
  return failures == 0 ? 0 : 1;
}
