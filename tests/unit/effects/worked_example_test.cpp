// The worked example of docs/adding-an-effect.md: worked_example.cpp is its code, letter by letter, and does what the page says.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "effects/catalogue.h"
#include "worked_example.cpp"

namespace terrode::effects {
namespace {

std::string text_of(const char* path) {
  std::ifstream file(std::string(TERRODE_SOURCE_DIR "/") + path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

bekker::SteadyState solve(const bekker::Soil& soil, const Effect* effect, double load = 115.0) {
  std::vector<const bekker::StressModifier*> modifiers;
  if (effect) modifiers.push_back(effect);
  const bekker::SteadyWheel wheel(reference_wheel(), soil, {}, {nullptr, nullptr, modifiers}, {.tolerance = 1e-12});
  bekker::Operating o = reference_operating();
  o.normal_load = load;
  o.phase_average = true;
  return wheel.solve(o);
}

TEST(WorkedExample, ThePageShowsTheFileThatIsCompiled) {
  const std::string page = text_of("docs/adding-an-effect.md"), code = text_of("tests/unit/effects/worked_example.cpp");
  ASSERT_GT(code.size(), 500u);
  EXPECT_NE(page.find("```cpp\n" + code + "```"), std::string::npos);
}

TEST(WorkedExample, ReachesTheLimitThatThePageGivesForTheTable) {
  const EffectType type = capillary_cohesion();
  bekker::Soil soil = reference_soil();
  const auto effect = type.make({2000});
  const bekker::SteadyState with = solve(soil, effect.get());
  soil.cohesion += 2000 * std::tan(soil.friction_angle);
  const bekker::SteadyState limit = solve(soil, nullptr);
  EXPECT_NEAR(with.drawbar_pull, limit.drawbar_pull, 1e-8 * 115);
  EXPECT_NEAR(with.driving_torque, limit.driving_torque, 1e-8 * 15);
  EXPECT_NEAR(with.sinkage, limit.sinkage, 1e-8 * 0.01);
}

TEST(WorkedExample, HasTheFingerprintItDeclaresAndANullValue) {
  const EffectType type = capillary_cohesion();
  const Parameter& p = type.info->parameters.front();
  EXPECT_TRUE(type.make({p.null_value})->is_null());
  const auto effect = type.make({p.typical});
  EXPECT_FALSE(effect->is_null());
  double first = 0.0;
  for (const double load : {57.5, 115.0, 230.0}) {
    const bekker::SteadyState with = solve(reference_soil(), effect.get(), load), without = solve(reference_soil(), nullptr, load);
    const double pull = with.drawbar_pull - without.drawbar_pull;
    EXPECT_GT(pull, 0) << load;
    EXPECT_GT(with.driving_torque, without.driving_torque) << load;
    // "By an amount that grows less than the load".
    if (first > 0) {
      EXPECT_LT(pull / load, first) << load;
    }
    first = pull / load;
  }
}

}  // namespace
}  // namespace terrode::effects
