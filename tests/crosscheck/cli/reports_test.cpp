// Reports as commands write them, opened in headless Chromium at the width of a desktop, all in one window (that of a phone:
// reports_long_test.cpp): no console message, no sideways scrolling, every figure gives its SVG and its CSV at a click, and
// the numbers on the page are those that the command printed.
#include <gmock/gmock.h>

#include "../report/chromium.h"
#include "report_pages.h"

namespace terrode::cli {
namespace {

using report::Browser;

// Answers of one page: what it looks like, and what its buttons save.
const char* kProbe = R"JS(
addEventListener('load', () => { const wait = setInterval(() => {
  if (!document.documentElement.dataset.ready) return;
  clearInterval(wait);
  setTimeout(async () => {
    const saved = [];
    URL.createObjectURL = (blob) => { saved.push(blob); return '#'; };
    HTMLAnchorElement.prototype.click = () => {};
    const figures = [...document.querySelectorAll('figure[data-figure]')];
    for (const f of figures) { f.querySelector('.svg').click(); f.querySelector('.csv').click(); }
    const texts = await Promise.all(saved.map((b) => b.text()));
    parent.answers[NUMBER] = {
      inner: innerWidth, scroll: document.documentElement.scrollWidth,
      clipped: [...document.querySelectorAll('h1,h2,h3,p,dd,code,.u-legend')].filter((e) => { const b = e.getBoundingClientRect(); return b.width > 0 && b.right > innerWidth + 1; }).length,
      title: document.title, heading: document.querySelector('h1').textContent, figures: figures.length,
      svg: texts.filter((t) => t.startsWith('<svg') && t.includes('</svg>')).length,
      csv: texts.filter((t) => !t.startsWith('<svg') && t.split('\r\n').length > 2).length,
      command: document.body.innerText.includes('terrode '), theme: !!document.querySelector('.theme'),
      series: JSON.parse(document.getElementById('data').textContent).figures.map((f) => (f.series || []).map((s) => [s.name, s.x, s.y])),
      text: document.body.innerText };
    if (++parent.done === TOTAL) parent.document.documentElement.dataset.ready = 'all';
  }, 200);
}, 50); });
)JS";

class Reports : public Browser {};

TEST_F(Reports, OpenAtEveryWidthAndShowWhatTheCommandsPrinted) {
  const auto reports = make_reports(folder_, false);
  const std::vector<int> widths = {1280};
  std::string frames;  // one over the other: what lies outside the window is drawn late or never
  int number = 0;
  for (const auto& [name, page] : reports)
    for (const int width : widths) {
      std::string probe = kProbe, html = page.html;
      probe.replace(probe.find("NUMBER"), 6, std::to_string(number++));
      probe.replace(probe.find("TOTAL"), 5, std::to_string(reports.size() * widths.size()));
      html.replace(html.rfind("</body>"), 7, "<script>" + probe + "</script></body>");
      frames += "<iframe style=\"position:absolute;top:0;left:0;border:0;height:900px;width:" + std::to_string(width) + "px\" srcdoc=\"" + report::escape(html) + "\"></iframe>";
    }
  const auto answers = ask("<!doctype html><body style=\"margin:0\"><script>window.answers=[];window.done=0</script>" + frames + "</body>", 1400, "window.answers");
  EXPECT_EQ(console_, "");
  ASSERT_EQ(answers.size(), reports.size() * widths.size());
  std::map<std::string, nlohmann::json> desktop;
  for (std::size_t i = 0; i < answers.size(); ++i) {
    const std::string name = std::next(reports.begin(), static_cast<long>(i / widths.size()))->first;
    const nlohmann::json& a = answers[i];
    ASSERT_TRUE(a.is_object()) << name;
    EXPECT_EQ(a["inner"], widths[i % widths.size()]) << name;
    EXPECT_LE(a["scroll"].get<int>(), widths[i % widths.size()]) << name << " scrolls sideways";
    EXPECT_EQ(a["clipped"], 0) << name << " at " << widths[i % widths.size()];
    EXPECT_GT(a["figures"].get<int>(), 0) << name;
    EXPECT_EQ(a["svg"], a["figures"]) << name << ": figures that are saved as SVG";
    EXPECT_EQ(a["csv"], a["figures"]) << name << ": figures that are saved as CSV";
    EXPECT_EQ(a["command"], true) << name << ": the command that made it";
    EXPECT_EQ(a["theme"], true) << name;
    EXPECT_NE(a["heading"], "") << name;
    desktop[name] = a;
  }

  const auto series = [&](const std::string& page, std::size_t figure, std::size_t k) { return desktop[page]["series"][figure][k][2].get<std::vector<double>>(); };
  const std::vector<double> measured_pull = {-6.5, 11, 14.5, 15, 15, 15};
  // Pages round to nine digits.
  const auto near = [](const std::vector<double>& want) {
    std::vector<testing::Matcher<double>> out;
    for (const double v : want) out.push_back(testing::DoubleNear(v, 1e-7 * std::abs(v) + 1e-12));
    return testing::ElementsAreArray(out);
  };
  std::vector<double> computed;
  for (const auto& p : reports.at("sweep").printed["results"][0]["points"]) computed.push_back(p["drawbar_pull"]);
  EXPECT_THAT(series("sweep", 0, 0), near(computed));
  EXPECT_THAT(series("sweep", 0, 1), near(measured_pull));
  EXPECT_THAT(series("compare", 0, 0), near(measured_pull));
  EXPECT_THAT(series("calibrate", 0, 0), near(measured_pull));
  EXPECT_THAT(series("diagnose", 0, 0), near(measured_pull));
  EXPECT_THAT(desktop["diagnose"]["text"].get<std::string>(), testing::HasSubstr(reports.at("diagnose").printed["statement"].get<std::string>()));
  // The spectrum, which lies on its band of confidence, peaks at the line that was found: within one of its bins.
  const auto& spectrum = desktop["oscillation"]["series"][0][1];
  const auto density = spectrum[2].get<std::vector<double>>();
  const auto frequency = spectrum[1].get<std::vector<double>>();
  const auto top = static_cast<std::size_t>(std::max_element(density.begin(), density.end()) - density.begin());
  const double line = reports.at("oscillation").printed["files"][0]["channels"]["drawbar_pull"]["lines"][0]["frequency"];
  EXPECT_NEAR(frequency[top], line, 1.5 * (frequency[1] - frequency[0]));
  EXPECT_NEAR(line, 0.8, 0.005);
}

}  // namespace
}  // namespace terrode::cli
