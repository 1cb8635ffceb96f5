// The steady wheel and the node-spring ground about every effect.
#include "cli/effects_agreement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <sstream>

namespace terrode::cli {
namespace {

TEST(EffectsAgreement, BothMethodsSeeTheSameChangeOrTheEffectSaysWhyNot) {
  const std::vector<Agreement> rows = effects_agreement(2);
  ASSERT_EQ(rows.size(), effects::all_effects().size());
  for (const Agreement& r : rows) {
    ASSERT_EQ(r.error, "") << r.id;
    const bool parts = !effects::find_effect(r.id)->info->parts_in_time.empty();
    if (parts) EXPECT_GT(r.gap, kAgreement) << r.id << " says that it parts, and does not";
    else EXPECT_LE(r.gap, kAgreement) << r.id;
  }

  // Every reason is measured: the effect agrees once it is taken away.
  const std::vector<ReasonAway> without = effects_without_reason(2);
  for (const effects::EffectType& t : effects::all_effects()) {
    const auto n = std::count_if(without.begin(), without.end(), [&](const ReasonAway& w) { return w.id == t.info->id; });
    EXPECT_EQ(n, t.info->parts_in_time.empty() ? 0 : 1) << t.info->id;
  }
  for (const ReasonAway& w : without) {
    EXPECT_EQ(w.error, "") << w.id;
    EXPECT_LE(w.gap, kAgreement) << w.id << ": " << w.how;
  }

  // The page holds the same effects, reasons and, within a point of the change, gaps.
  std::ifstream file(TERRODE_SOURCE_DIR "/docs/effects-agreement.md");
  ASSERT_TRUE(file);
  std::map<std::string, double> gaps;
  std::string reasons;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("* `")) reasons += line + "\n";
    if (line.starts_with("The reasons are measured")) break;
    if (!line.starts_with("| `")) continue;
    const std::string id = line.substr(3, line.find('`', 3) - 3);
    const auto last = line.rfind('|', line.size() - 2);
    gaps[id] = std::stod(line.substr(last + 1)) / 100;
  }
  const std::string now = agreement_markdown(rows, without);
  for (const Agreement& r : rows) {
    ASSERT_TRUE(gaps.contains(r.id)) << r.id << "; run: terrode effects --agreement > docs/effects-agreement.md";
    EXPECT_NEAR(gaps[r.id], r.gap, 0.01 * (1.0 + 10.0 * r.gap)) << r.id << "; run: terrode effects --agreement > docs/effects-agreement.md";
  }
  EXPECT_NE(now.find(reasons), std::string::npos) << "run: terrode effects --agreement > docs/effects-agreement.md";
}

}  // namespace
}  // namespace terrode::cli
