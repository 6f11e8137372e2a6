#include "render/guarded_sum.h"

namespace icbench {

void LeakGuard::judge() noexcept {
  std::uint32_t worthy = 0;
  for (std::uint32_t i = 0; i < suspects_; ++i) {
    if (!is_worth_a_ray(held_[i])) continue;
    rays_[worthy] = rays_[i];
    held_[worthy++] = held_[i];
  }
  suspects_ = worthy;
  if (suspects_ == 0) return;
  std::array<bool, kLeakPacket> stopped;
  tracer_.occluded({rays_.data(), suspects_}, {stopped.data(), suspects_});
  for (std::uint32_t i = 0; i < suspects_; ++i) {
    if (stopped[i])
      ++tests_.stopped;
    else
      sum_.add(held_[i]);
  }
  tests_.rays += suspects_;
  suspects_ = 0;
}

}  // namespace icbench
