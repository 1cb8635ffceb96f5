#include "report/svg.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <regex>

#include "core/problem.h"
#include "report/png.h"

namespace terrode::report {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

size_t count(const std::string& text, const std::string& what) {
  size_t n = 0;
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + what.size())) ++n;
  return n;
}

Figure line_figure() {
  Figure f;
  f.title = "Drawbar pull";
  f.x = {"Slip", ""};
  f.y = {"Drawbar pull", "N"};
  f.series = {{"steady", {0.0, 0.1, 0.2}, {-4.0, 5.0, 9.0}}};
  return f;
}

// What stands in `d` of the first path drawn with the class given, or "". Without std::regex, whose matching of [^"]* takes a
// stack frame a character: a long path would need the whole stack.
std::string path_data(const std::string& drawing, const std::string& css_class) {
  const std::size_t end = drawing.find("\" class=\"" + css_class + "\"");
  if (end == std::string::npos) return {};
  const std::string start = "<path d=\"";
  const std::size_t at = drawing.rfind(start, end);
  if (at == std::string::npos) return {};
  const std::string d = drawing.substr(at + start.size(), end - at - start.size());
  return d.find('"') == std::string::npos ? d : std::string();
}

// Points of the first path drawn with the class given.
std::vector<std::pair<double, double>> path_points(const std::string& drawing, const std::string& css_class) {
  std::vector<std::pair<double, double>> out;
  const std::string d = path_data(drawing, css_class);
  const std::regex point("[ML](-?[0-9.]+) (-?[0-9.]+)");
  for (auto it = std::sregex_iterator(d.begin(), d.end(), point); it != std::sregex_iterator(); ++it)
    out.emplace_back(std::stod((*it)[1]), std::stod((*it)[2]));
  return out;
}

TEST(NiceTicks, AreRoundAndInside) {
  EXPECT_THAT(nice_ticks(0.0, 1.0, 5), ElementsAre(0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0));
  EXPECT_THAT(nice_ticks(-7.0, 16.0, 5), ElementsAre(-5.0, 0.0, 5.0, 10.0, 15.0));
  for (double t : nice_ticks(1.23e-5, 9.87e-5)) {
    EXPECT_GE(t, 1.23e-5);
    EXPECT_LE(t, 9.87e-5);
  }
}

TEST(FormatNumber, KeepsSignificantDigits) {
  EXPECT_EQ(format_number(12.3456), "12.35");
  EXPECT_EQ(format_number(-0.0031), "−0.0031");
  EXPECT_EQ(format_number(9.9996), "10");
  EXPECT_EQ(format_number(123456.0), "123456");
  EXPECT_EQ(format_number(4.2e7), "4.2e7");
  EXPECT_EQ(format_number(3.0e-6, 2), "3e−6");
  EXPECT_EQ(format_number(0.0), "0");
  EXPECT_EQ(format_number(std::nan("")), "–");
}

TEST(Svg, PlacesPointsInProportion) {
  const auto p = path_points(svg(line_figure()), "s0");
  ASSERT_EQ(p.size(), 3u);
  constexpr double kRounding = 0.011;  // two decimals of a pixel
  EXPECT_NEAR(p[1].first - p[0].first, p[2].first - p[1].first, kRounding);
  EXPECT_NEAR((p[0].second - p[1].second) / 9.0, (p[1].second - p[2].second) / 4.0, kRounding);
  EXPECT_GT(p[0].second, p[2].second) << "larger values are drawn higher";
}

TEST(Svg, LogarithmicAxisSpacesDecadesEvenly) {
  Figure f = line_figure();
  f.x.log = f.y.log = true;
  f.series = {{"error", {1.0, 10.0, 100.0}, {1e-3, 1e-2, 1e-1}}};
  const auto p = path_points(svg(f), "s0");
  ASSERT_EQ(p.size(), 3u);
  EXPECT_NEAR(p[1].first - p[0].first, p[2].first - p[1].first, 0.011);
  EXPECT_NEAR(p[1].second - p[0].second, p[2].second - p[1].second, 0.011);
}

TEST(Svg, BreaksLinesAtMissingValues) {
  Figure f = line_figure();
  f.series = {{"", {0, 1, 2, 3}, {1, 2, std::nan(""), 3}}};
  EXPECT_THAT(svg(f), Not(HasSubstr("nan")));
  f.series[0].x.push_back(4), f.series[0].y.push_back(4);
  const std::string drawing = svg(f);
  std::smatch m;
  ASSERT_TRUE(std::regex_search(drawing, m, std::regex("<path d=\"([^\"]*)\" class=\"s0\"")));
  EXPECT_EQ(count(m[1], "M"), 2u);
}

TEST(Svg, ThinsOutLongLinesWithoutLosingPeaks) {
  Figure f = line_figure();
  Series s{"signal", {}, {}};
  for (int i = 0; i < 200000; ++i) {
    s.x.push_back(i * 1e-4);
    s.y.push_back(i == 123456 ? 50.0 : std::sin(i * 0.01));
  }
  f.series = {s};
  f.y.max = 60.0;
  const auto p = path_points(svg(f), "s0");
  EXPECT_LT(p.size(), 4000u);
  double highest = 1e9, lowest = 0.0;
  for (auto [x, y] : p) highest = std::min(highest, y), lowest = std::max(lowest, y);
  EXPECT_LT(highest, 0.35 * lowest) << "the single sample of 50 N is drawn";
}

TEST(Svg, DrawsBandsErrorBarsAndRules) {
  Figure f = line_figure();
  f.series = {{"band", {0, 1}, {}, Draw::band, {1, 2}, {2, 3}},
              {"measured", {0, 1}, {1.5, 2.5}, Draw::points, {1, 2}, {2, std::nan("")}, kInk}};
  f.annotations = {{0.5, std::nan(""), "here"}};
  const std::string drawing = svg(f);
  EXPECT_EQ(count(drawing, "fill-opacity=\"0.18\""), 1u);
  EXPECT_EQ(count(drawing, "stroke-width=\"1.3\""), 1u) << "one bar: the other has no upper limit";
  EXPECT_EQ(count(drawing, "<circle"), 3u) << "two points and the legend";
  EXPECT_THAT(drawing, HasSubstr(">here</text>"));
}

TEST(Svg, EscapesEveryText) {
  Figure f = line_figure();
  const std::string evil = "<script>alert(\"1\")</script>&'";
  f.title = f.x.label = f.x.unit = f.y.label = f.series[0].name = evil;
  f.annotations = {{0.1, 1.0, evil}};
  const std::string drawing = svg(f);
  EXPECT_THAT(drawing, Not(HasSubstr("<script")));
  EXPECT_EQ(count(drawing, "&lt;script&gt;alert(&quot;1&quot;)&lt;/script&gt;&amp;&#39;"), 7u);
}

TEST(Svg, SameFigureSameBytes) { EXPECT_EQ(svg(line_figure()), svg(line_figure())); }

TEST(Svg, RefusesWhatCannotBeDrawn) {
  Figure f = line_figure();
  f.series[0].y.pop_back();
  EXPECT_THROW(svg(f), InputError);
  f = line_figure();
  f.y.log = true;
  f.series[0].y = {-1, -2, 0};
  EXPECT_THROW(svg(f), InputError);
  f = line_figure();
  f.x.min = 2.0, f.x.max = 1.0;
  EXPECT_THROW(svg(f), InputError);
  HeatMap m;
  m.x_names = {"a"}, m.y_names = {"b", "c"}, m.values = {1.0};
  EXPECT_THROW(svg(m), InputError);
  EXPECT_THROW(write_svg(line_figure(), "/nowhere/at/all.svg"), RunError);
}

TEST(Svg, SurvivesEmptyAndConstantData) {
  Figure f;
  EXPECT_THAT(svg(f), Not(HasSubstr("nan")));
  f.series = {{"constant", {1, 2}, {3, 3}}};
  EXPECT_THAT(svg(f), Not(HasSubstr("nan")));
  f.series = {{"one point", {1}, {-3}, Draw::points}};
  EXPECT_THAT(svg(f), Not(HasSubstr("nan")));
}

TEST(HeatMapSvg, ColoursFollowTheSign) {
  HeatMap m;
  m.x_names = {"0.1", "0.2", "0.3"}, m.y_names = {"drawbar pull"}, m.values = {-2.0, 0.0, 2.0};
  m.diverging = m.print_values = true;
  const std::string drawing = svg(m);
  EXPECT_THAT(drawing, HasSubstr(palette::diverging(-1.0).hex()));
  EXPECT_THAT(drawing, HasSubstr(palette::diverging(0.0).hex()));
  EXPECT_THAT(drawing, HasSubstr(palette::diverging(1.0).hex()));
  EXPECT_THAT(drawing, HasSubstr(">−2</text>"));
}

TEST(HeatMapSvg, LargeGridsBecomeAPicture) {
  HeatMap m;
  for (int i = 0; i < 100; ++i) m.x_values.push_back(i), m.y_values.push_back(i);
  m.values.assign(10000, 1.0);
  m.values[0] = std::nan("");
  EXPECT_THAT(svg(m), HasSubstr("data:image/png;base64,iVBORw0KGgo"));
}

TEST(Base64, MatchesRfc4648) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
}

}  // namespace
}  // namespace terrode::report
