// Opens pages in headless Chromium: no console message, no sideways scrolling at phone and desktop width, figures alive,
// values read back from the page. Skipped where Chromium is not installed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "chromium.h"
#include "report/page.h"
#include "report/sweep_page.h"

namespace terrode::report {
namespace {

Page full_page() {
  SweepReport r;
  r.title = "A title that is long enough to take more than one line on a phone";
  r.command = "terrode sweep scenarios/wheel.yaml --method steady,node-spring --slip -0.4:0.6:0.1 --report sweep.html";
  r.scenario_name = "scenarios/wheel.yaml";
  r.scenario_text = std::string(300, 'x') + "\n";
  r.facts = {{"Wheel radius", "157.35 mm"}, {"Load", "80 N"}, {"Soil", "a_soil_with_a_very_long_name_without_spaces"}};
  SweepCurve a{"steady", {}, false}, b{"node-spring", {}, false}, m{"measured", {}, true};
  for (int i = -4; i <= 6; ++i) {
    SweepPoint p;
    p.slip = 0.1 * i;
    p.drawbar_pull = 20.0 * std::tanh(0.4 * i) - 4.0;
    p.driving_torque = 5.0 * std::tanh(0.4 * i);
    p.sinkage = 0.006 + 0.001 * std::abs(i);
    a.points.push_back(p);
    p.drawbar_pull_sem = p.driving_torque_sem = 0.3;
    p.sinkage_sem = 1e-4;
    b.points.push_back(p);
    if (i >= 0 && i % 2 == 0) m.points.push_back(p);
  }
  r.curves = {a, b, m};
  Page page = sweep_page(r);
  Figure time{"Over time", {"Time", "s"}, {"Drawbar pull", "N"}, {}, {{2.0, std::nan(""), "steady from here"}}};
  Series s{"run", {}, {}};
  for (int i = 0; i < 5000; ++i) s.x.push_back(1e-3 * i), s.y.push_back(std::sin(0.01 * i));
  time.series = {s, {"± deviation", {0, 5}, {}, Draw::band, {-1, -1}, {1, 1}}};
  Figure log{"Convergence", {"Spacing", "mm", true}, {"Error", "%", true}, {{"e", {1, 10, 100}, {0.1, 1, 10}, Draw::line_and_points}}};
  Figure loop{"Loop", {"Pressure", "kPa"}, {"Sinkage", "mm"}, {{"plate", {0, 5, 2}, {0, 5, 4}}}};
  page.section("More").figure(time).figures({log, loop});
  HeatMap map{"Residuals", {"Slip"}, {"Channel"}, {"0", "0.2", "0.4"}, {"drawbar pull", "sinkage"}, {}, {}, {1, -2, 3, -4, 5, -6}, "residual", "σ", true, true};
  page.heat_map(map).callout(Mood::warning, "Careful", "Digitised points.");
  page.download("a.json", "{}");
  return page;
}

TEST_F(Browser, NoConsoleMessageAndNoSidewaysScrolling) {
  const std::string html = full_page().html();
  for (int width : {390, 768, 1280}) {
    const auto r = ask(html, width,
                       "{inner:innerWidth,scroll:document.documentElement.scrollWidth,ready:document.documentElement.dataset.ready,"
                       "live:document.querySelectorAll('.is-live canvas').length,drawn:document.querySelectorAll('.static svg').length,"
                       "clipped:[...document.querySelectorAll('h1,h2,h3,p,dd,code,.u-legend')].filter(e=>{const b=e.getBoundingClientRect();"
                       "return b.width>0&&b.right>innerWidth+1}).length}");
    ASSERT_TRUE(r.is_object());
    EXPECT_EQ(console_, "") << "at width " << width;
    EXPECT_EQ(r["inner"], width);
    EXPECT_LE(r["scroll"].get<int>(), width);
    EXPECT_EQ(r["clipped"], 0) << "at width " << width;
    EXPECT_EQ(r["drawn"], 7);
    if (interactive_figures()) {
      EXPECT_EQ(r["live"], 5) << "all but the loop, which turns back, and the map";
    }
  }
}

TEST_F(Browser, ShowsTheValuesThatWereGiven) {
  const auto r = ask(full_page().html(), 1280,
                     "{cells:[...document.querySelectorAll('table')].flatMap(t=>[...t.querySelectorAll('tbody td')].map(d=>d.textContent)),"
                     "y:JSON.parse(document.getElementById('data').textContent).figures[0].series[0].y,"
                     "verdict:document.getElementById('verdict').innerText}");
  ASSERT_TRUE(r.is_object());
  EXPECT_EQ(r["y"].size(), 11u);
  EXPECT_NEAR(r["y"][4].get<double>(), -4.0, 1e-9);
  EXPECT_NEAR(r["y"][10].get<double>(), 20.0 * std::tanh(2.4) - 4.0, 1e-8);
  EXPECT_THAT(r["cells"].dump(), testing::HasSubstr("−4.00 ± 0.30"));
  EXPECT_THAT(r["verdict"].get<std::string>(), testing::HasSubstr("node-spring 0\u00a0% in drawbar pull"));
}

TEST_F(Browser, CurvesAnswerToThePointerAndToClicks) {
  if (!interactive_figures()) GTEST_SKIP() << "built without the plotting library";
  // Hover in the middle of the first figure, read the legend, then hide a curve by a click on its name.
  const auto r = ask(full_page().html(), 1280,
                     "(()=>{const f=document.querySelector('figure.is-live'),o=f.querySelector('.u-over'),b=o.getBoundingClientRect();"
                     "for(const t of ['mouseenter','mousemove'])o.dispatchEvent(new MouseEvent(t,{bubbles:true,clientX:b.left+b.width-20,clientY:b.top+20}));"
                     "const n=[...f.querySelectorAll('.u-legend .u-series')];n[1].querySelector('th').click();"
                     "return {values:n.map(e=>e.innerText),off:n.map(e=>e.classList.contains('u-off'))}})()");
  ASSERT_TRUE(r.is_object());
  EXPECT_EQ(console_, "");
  ASSERT_EQ(r["off"].size(), 4u);
  EXPECT_EQ(r["off"][1], true);
  EXPECT_EQ(r["off"][2], false);
}

TEST_F(Browser, DarkAndLightDiffer) {
  const auto r = ask(full_page().html(), 1280,
                     "(()=>{const c=()=>getComputedStyle(document.body).backgroundColor,a=c();document.querySelector('.theme').click();return [a,c()]})()");
  ASSERT_EQ(r.size(), 2u);
  EXPECT_NE(r[0], r[1]);
  EXPECT_EQ(console_, "");
}

}  // namespace
}  // namespace terrode::report
