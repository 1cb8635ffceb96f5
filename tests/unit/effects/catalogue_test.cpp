#include "effects/catalogue.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

namespace terrode::effects {
namespace {

TEST(Catalogue, ThePageInDocsIsCurrent) {
  std::ifstream file(TERRODE_SOURCE_DIR "/docs/effects.md");
  std::stringstream text;
  text << file.rdbuf();
  EXPECT_EQ(text.str(), catalogue_markdown()) << "run: terrode effects --markdown > docs/effects.md";
}

TEST(Catalogue, AnEntryNamesEverythingOnce) {
  for (const EffectType& t : all_effects()) {
    const std::string entry = catalogue_entry(t);
    for (const std::string_view part : {t.info->physics, t.info->equation, t.info->source, t.info->separated_by})
      EXPECT_NE(entry.find(part), std::string::npos) << t.info->id;
    for (const Parameter& p : t.info->parameters) EXPECT_NE(entry.find(p.meaning), std::string::npos) << t.info->id;
  }
}

}  // namespace
}  // namespace terrode::effects
