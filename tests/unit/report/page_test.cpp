#include "report/page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <regex>

#include <nlohmann/json.hpp>

#include "core/problem.h"
#include "report/sweep_page.h"

namespace terrode::report {
namespace {

using testing::HasSubstr;
using testing::Not;

nlohmann::json page_data(const std::string& html) {
  const std::string open = "id=\"data\">";
  const size_t from = html.find(open) + open.size();
  return nlohmann::json::parse(html.substr(from, html.find("</script>", from) - from));
}

SweepReport small_sweep() {
  SweepReport r;
  r.title = "Smooth wheel";
  r.command = "terrode sweep wheel.yaml --report sweep.html";
  r.scenario_name = "wheel.yaml";
  r.scenario_text = "wheel: {radius: 157 mm}\n";
  SweepCurve model{"steady", {}, false}, measured{"measured", {}, true};
  for (double s : {0.0, 0.2, 0.4}) {
    SweepPoint p;
    p.slip = s;
    p.drawbar_pull = 10.0 * s;
    p.driving_torque = 1.0 + s;
    p.sinkage = 0.005;
    model.points.push_back(p);
  }
  SweepPoint m;
  m.slip = 0.1;  // between two slips of the model, which is 1 N there
  m.drawbar_pull = 2.0;
  measured.points = {m};
  r.curves = {model, measured};
  return r;
}

TEST(Page, IsOneFileWithoutNetwork) {
  Page page("Title");
  page.section("Curves").figure({"f", {"x"}, {"y"}, {{"a", {0, 1}, {0, 1}}}});
  std::string html = page.html();
  EXPECT_THAT(html, HasSubstr("default-src 'none'"));
  html = std::regex_replace(html, std::regex("http://www\\.w3\\.org/[a-zA-Z0-9/]+"), "");
  EXPECT_FALSE(std::regex_search(html, std::regex("(src|href)\\s*=\\s*[\"'](https?:)?//")));
  EXPECT_THAT(html, Not(HasSubstr("@import")));
  EXPECT_THAT(html, Not(HasSubstr("url(http")));
}

TEST(Page, EscapesEveryText) {
  const std::string evil = "</script><script>alert('\"&')";
  Page page(evil);
  page.subtitle(evil).command(evil).verdict(Mood::bad, evil).facts({{evil, evil}});
  page.section(evil).text(evil).list({evil}).callout(Mood::good, evil, evil).listing(evil, evil).download(evil, evil);
  page.table({{{evil, evil}}, {{Cell(evil)}}, evil});
  Figure f{evil, {evil, evil}, {evil, evil}, {{evil, {0, 1}, {0, 1}}}, {{0.5, 0.5, evil}}, evil};
  page.figure(f);
  EXPECT_THAT(page.html(), Not(HasSubstr("<script>alert")));
  EXPECT_EQ(page_data(page.html())["figures"][0]["title"], evil);
  EXPECT_EQ(page_data(page.html())["downloads"][0], evil);
}

TEST(Page, KeepsTheDataOfItsFigures) {
  Page page("t");
  page.figure({"f", {"Time", "s"}, {"Drawbar pull", "N"}, {{"run", {0.0, 0.1, 0.2}, {1.25, std::nan(""), -3e-7}}}});
  const auto figure = page_data(page.html())["figures"][0];
  EXPECT_EQ(figure["x"]["unit"], "s");
  EXPECT_EQ(figure["series"][0]["x"], nlohmann::json({0.0, 0.1, 0.2}));
  EXPECT_EQ(figure["series"][0]["y"], nlohmann::json({1.25, nullptr, -3e-7}));
}

TEST(Page, SameContentSameBytes) { EXPECT_EQ(sweep_page(small_sweep()).html(), sweep_page(small_sweep()).html()); }

TEST(Page, TablesShowUnitsErrorsAndGaps) {
  Page page("t");
  page.table({{{"Method"}, {"Drawbar pull", "N"}, {"Empty"}}, {{std::string("dem"), PlusMinus{12.3456, 0.123}}}});
  EXPECT_THAT(page.html(), HasSubstr("Drawbar pull<span class=\"unit\">N</span>"));
  EXPECT_THAT(page.html(), HasSubstr(">12.35 ± 0.12<"));
  Page wrong("t");
  wrong.table({{{"one"}}, {{1.0, 2.0}}});
  EXPECT_THROW(wrong.html(), InputError);
}

TEST(Page, SaysWhenItCannotBeWritten) { EXPECT_THROW(Page("t").write_html("/nowhere/at/all.html"), RunError); }

TEST(SweepPage, ComparesWithTheMeasuredPointsBetweenItsSlips) {
  // Model 1 N against measured 2 N: half of the largest measured value.
  const std::string html = sweep_page(small_sweep()).html();
  EXPECT_THAT(html, HasSubstr("steady 50\u00a0% in drawbar pull."));
  EXPECT_THAT(html, HasSubstr("terrode sweep wheel.yaml"));
  EXPECT_THAT(html, HasSubstr("wheel: {radius: 157 mm}"));
}

TEST(SweepPage, ShowsSinkageInMillimetres) {
  const auto figures = sweep_figures(small_sweep());
  ASSERT_EQ(figures.size(), 3u);
  EXPECT_EQ(figures[2].y.unit, "mm");
  EXPECT_DOUBLE_EQ(figures[2].series[0].y[0], 5.0);
}

TEST(SweepPage, NamesFailedAndUnsettledPoints) {
  SweepReport r = small_sweep();
  r.curves[0].points[0].error = "the load cannot be carried";
  r.curves[0].points[1].steady = false;
  const std::string html = sweep_page(r).html();
  EXPECT_THAT(html, HasSubstr("1 of 3 points failed."));
  EXPECT_THAT(html, HasSubstr("1 of 3 runs had not reached a steady state."));
  EXPECT_THAT(html, HasSubstr("the load cannot be carried"));
}

TEST(SweepPage, WithoutMeasurementsSaysSo) {
  SweepReport r = small_sweep();
  r.curves.pop_back();
  EXPECT_THAT(sweep_page(r).html(), HasSubstr("no measurement to compare with"));
}

}  // namespace
}  // namespace terrode::report
