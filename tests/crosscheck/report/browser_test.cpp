// Opens pages in headless Chromium: no console message, no sideways scrolling at phone and desktop width, figures alive,
// values read back from the page. Skipped where Chromium is not installed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "report/page.h"
#include "report/svg.h"
#include "report/sweep_page.h"

namespace terrode::report {
namespace {

namespace fs = std::filesystem;

std::string output_of(const std::string& command) {
  std::string out;
  FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) return out;
  std::array<char, 65536> buffer;
  for (size_t n; (n = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) out.append(buffer.data(), n);
  pclose(pipe);
  return out;
}

std::string chromium() {
  std::string path = output_of("command -v chromium || command -v chromium-browser || true");
  while (!path.empty() && path.back() == '\n') path.pop_back();
  return path;
}

class Browser : public testing::Test {
 protected:
  void SetUp() override {
    if (chromium().empty()) GTEST_SKIP() << "chromium is not installed: the pages are not opened in a browser";
    folder_ = fs::temp_directory_path() / ("terrode-browser-" + std::to_string(getpid()) +
                                           "-" + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override {
    if (!folder_.empty()) fs::remove_all(folder_);
  }

  // Opens the page at a width, runs `script` (an expression) in it after loading and returns its value. Messages on the
  // console go to console_.
  nlohmann::json ask(const std::string& html, int width, const std::string& script) {
    const std::string probe =
        "<script>addEventListener('load',()=>setTimeout(()=>{const p=document.createElement('pre');p.id='probe';"
        "p.hidden=true;p.textContent='@'+encodeURIComponent(JSON.stringify(" + script + "))+'@';parent.document.body.append(p);},400));</script></body>";
    std::string page = html;
    page.replace(page.rfind("</body>"), 7, probe);
    const fs::path file = folder_ / "page.html", profile = folder_ / "profile", errors = folder_ / "errors";
    // A window cannot be made narrower than 500 pixels, a frame can.
    if (width < 500)
      page = "<!doctype html><body style=\"margin:0\"><iframe style=\"border:0;height:900px;width:" + std::to_string(width) +
             "px\" srcdoc=\"" + escape(page) + "\"></iframe></body>";
    std::ofstream(file) << page;
    fs::remove_all(profile);
    const std::string dom = output_of(
        chromium() + " --headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking"
        " --disable-component-update --disable-sync --enable-logging=stderr --virtual-time-budget=4000 --user-data-dir=" +
        profile.string() + " --hide-scrollbars --window-size=" + std::to_string(std::max(width, 500)) + ",900 --dump-dom file://" + file.string() + " 2>" + errors.string());
    std::ifstream in(errors);
    console_.clear();
    for (std::string line; std::getline(in, line);)
      if (line.find("CONSOLE") != std::string::npos) console_ += line + "\n";
    const size_t from = dom.find(">@");
    if (from == std::string::npos) {
      ADD_FAILURE() << "the page did not answer";
      return {};
    }
    const std::string coded = dom.substr(from + 2, dom.find('@', from + 2) - from - 2);
    std::string text;
    for (size_t i = 0; i < coded.size(); ++i)
      if (coded[i] == '%' && i + 2 < coded.size())
        text += static_cast<char>(std::stoi(coded.substr(i + 1, 2), nullptr, 16)), i += 2;
      else
        text += coded[i];
    return nlohmann::json::parse(text);
  }

  fs::path folder_;
  std::string console_;
};

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
  EXPECT_THAT(r["verdict"].get<std::string>(), testing::HasSubstr("node-spring 0 % in drawbar pull"));
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
