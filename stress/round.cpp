#include "stress/round.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "caches/session.h"
#include "core/interpolation.h"

namespace icbench::stress {

namespace {

constexpr float kManySizes[] = {0.9f, 0.4f, 0.1f, 0.02f};
constexpr float kSmallSizes[] = {0.02f, 0.005f};

constexpr Shape kShapes[] = {
    {"few places", 3, kManySizes, 200, 25, 2, 200},
    {"young tree", 2, kManySizes, 24, 50, 1, 200},
    {"many places", 1000, kSmallSizes, 20'000, 50, 3, 200},
    {"pool too small", 3, kManySizes, 200, 50, 2, 50},
};

std::uint32_t bits(float f) noexcept { return std::bit_cast<std::uint32_t>(f); }

/// A float that holds 24 bits of `hash` exactly.
float digits(std::uint64_t hash) noexcept { return static_cast<float>(hash >> 40); }

}  // namespace

std::span<const Shape> all_shapes() { return kShapes; }

Landscape::Landscape(const Shape& shape, std::uint64_t seed, float a)
    : radii_(shape.radii.begin(), shape.radii.end()),
      validity_(shape.places, static_cast<std::uint32_t>(shape.radii.size())) {
  Pcg32 random(hash_keys(seed, 3));
  // Half of those with few places have them close together, around where cells of all levels meet: a record is then
  // valid at several places, in different cells.
  constexpr std::uint32_t kFewPlaces = 10;
  const bool is_close = shape.places < kFewPlaces && hash_keys(seed, 6) % 2 == 0;
  for (std::uint32_t i = 0; i < shape.places; ++i) {
    const auto coordinate = [&] {
      return is_close ? 0.4f + 0.2f * random.uniform() : 0.05f + 0.9f * random.uniform();
    };
    places_.push_back({{coordinate(), coordinate(), coordinate()}, {0.0f, 0.0f, 1.0f}});
  }
  for (std::uint32_t kind = 0; kind < validity_.kinds(); ++kind) {
    const Record r = record(kind, 0, 0);
    for (std::uint32_t place = 0; place < shape.places; ++place) {
      if (split_sphere_weight(places_[place], r, a) > 0.0f) validity_.set_valid(place, kind);
    }
  }
}

Record Landscape::record(std::uint32_t kind, std::uint32_t id, std::uint32_t update) const noexcept {
  const SurfacePoint& x = places_[kind / radii_.size()];
  Record r{x.p, x.n, radii_[kind % radii_.size()], {}, id};
  r.E = seal(r, update);
  return r;
}

Irradiance seal(const Record& r, std::uint32_t update) noexcept {
  std::uint64_t hash = hash_keys(r.id, update, bits(r.R));
  for (int axis = 0; axis < 3; ++axis) hash = hash_keys(hash, bits(r.p[axis]), bits(r.n[axis]));
  return {static_cast<float>(update & 0xffffffu), digits(hash), digits(mix64(hash))};
}

void ThreadLog::append_to(History& history) const {
  const auto base = static_cast<std::uint32_t>(history.seen.size());
  for (std::uint32_t i = 0; i < operations_used_; ++i) {
    history.operations.push_back(operations_[i]);
    if (operations_[i].is_query()) history.operations.back().first += base;
  }
  history.seen.insert(history.seen.end(), seen_.begin(), seen_.begin() + seen_used_);
}

RoundSizes::RoundSizes(const RoundPlan& plan) {
  const Shape& shape = *plan.shape;
  thread_operations = std::max(1u, std::min(shape.epoch_operations, plan.operations) / plan.threads);
  const std::uint32_t epoch_operations = thread_operations * plan.threads;
  epochs = std::max(1u, plan.operations / epoch_operations);
  most_seen = epoch_operations * std::min(shape.clear_every, epochs) + 1;
  // Sessions draw room in batches: where the pool is to suffice, each gets one more than it needs.
  const std::uint64_t expected = std::uint64_t{most_seen} * shape.insert_percent / 100 + 1;
  const std::uint64_t spare = shape.capacity_percent > 100 ? kTicketBatch * plan.threads : 0;
  capacity = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(expected * shape.capacity_percent / 100 + spare, kMaxCapacity));
}

}  // namespace icbench::stress
