// Sums of what a cache finds, which must not depend on the order in which it finds it.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>

#include "render/waves.h"

namespace icbench {
namespace {

// Records as they are, of no level that extrapolates.
class PlainSource final : public RecordSource {
 public:
  RecordsThen begin_frame(const SceneChange&, Crew&) override { return RecordsThen::go; }
  Record evaluate(unsigned, Tracer&, const Visible&, const SampleKey&) noexcept override { return {}; }
};

// Guards against: sums in the order of the cache. Such pictures are alike all the same where irradiance is: doubles
// hold sums of floats exactly unless these are 2^29 times as large as one another. Here the mean of four lies half way
// between two floats, but for what the small ones add, and each alone is lost beside the large one.
TEST(Answers, AreSummedInAnOrderThatTheCacheHasNoPartIn) {
  PlainSource source;
  Answers answers(source);
  const SurfacePoint x{glm::vec3(0.5f), {0, 1, 0}};
  constexpr std::array kE{0x1p60f, 0x1p36f, 0x1p7f, 0x1p7f};
  for (const bool at_one_place : {false, true}) {
    std::array order{0, 1, 2, 3};
    std::optional<float> first;
    int differ = 0;
    do {
      MeanIrradiance as_found;
      answers.ask_at({&x, 1});
      for (const int k : order) {
        const auto i = static_cast<std::size_t>(k);
        const glm::vec3 p = at_one_place ? x.p : glm::vec3(0.5f, 0.5f, 0.1f * static_cast<float>(k));
        answers[0]({p, x.n, 1.0f, Irradiance(kE[i]), RecordDetails::kNone}, 1.0f);
        as_found.add(Irradiance(kE[i]), 1.0f);
      }
      const Reply reply = answers.settle(0);
      ASSERT_TRUE(reply.E.has_value());
      if (!first) first = reply.E->x;
      EXPECT_EQ(reply.E->x, *first);
      differ += as_found.result()->x != *first;
    } while (std::next_permutation(order.begin(), order.end()));
    EXPECT_GT(differ, 0) << "there was nothing to guard against";
    EXPECT_LT(differ, 24);
  }
  answers.ask_at({&x, 1});
  EXPECT_FALSE(answers.settle(0).E.has_value()) << "what was settled is forgotten";
}

}  // namespace
}  // namespace icbench
