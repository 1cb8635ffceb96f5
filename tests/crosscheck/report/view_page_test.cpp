// The 3-D player: what was packed comes out again in the browser, and something is drawn.
#include "report/view_page.h"

#include <gtest/gtest.h>

#include <cmath>

#include "chromium.h"
#include "frames_example.h"

namespace terrode::report {
namespace {

class Viewer : public Browser {
 protected:
  ViewPage make(int frames, bool particles, ViewOptions options = {"A <b>run</b>"}) {
    const auto path = (folder_.empty() ? std::filesystem::temp_directory_path() / ("terrode-view-" + std::to_string(getpid())) : folder_ / "run").string() + ".h5";
    {
      auto file = recording::Hdf5File::create(path);
      write_example(file, frames, particles);
      file.close();
    }
    recording::Run run;
    for (int i = 0; i < 5000; ++i) run.time.push_back(1e-4 * i);
    recording::Channel pull{"drawbar_pull", "N", {}};
    for (double t : run.time) pull.values.push_back(std::sin(20 * t));
    run.channels = {pull};
    const auto file = recording::Hdf5File::open(path);
    const recording::FrameReader reader(file);
    ViewPage page = view_page(reader, run, options);
    std::filesystem::remove(path);
    return page;
  }
};

TEST_F(Viewer, UnpacksWhatWasPackedAndDrawsIt) {
  const ViewPage page = make(5, true);
  const auto r = ask(page.html, 1280,
                     "(()=>{const v=terrode_view;v.seek(0.25);return {ready:document.documentElement.dataset.ready,h:v.height(3,10,5),level:v.height(4,0,0),"
                     "p:v.position(4,7),sinkage:v.sinkage_most,frame:v.state.frame,part:v.state.part,picture:v.has_picture,painted:v.has_picture?v.painted():null,"
                     "title:document.querySelector('h1').textContent,message:document.getElementById('message').hidden,scroll:document.documentElement.scrollWidth}})()",
                     true);
  ASSERT_TRUE(r.is_object());
  EXPECT_EQ(console_, "");
  EXPECT_EQ(r["ready"], "5");
  EXPECT_EQ(r["title"], "A <b>run</b>");
  EXPECT_NEAR(r["h"].get<double>(), -0.03, page.height_step);
  EXPECT_NEAR(r["level"].get<double>(), 0.0, page.height_step);
  EXPECT_NEAR(r["sinkage"].get<double>(), 0.04, page.height_step);
  EXPECT_NEAR(r["p"][0].get<double>(), 0.07, page.position_step);
  EXPECT_NEAR(r["p"][1].get<double>(), 0.0, page.position_step);
  EXPECT_NEAR(r["p"][2].get<double>(), -0.015, page.position_step);
  EXPECT_EQ(r["frame"], 2);
  EXPECT_NEAR(r["part"].get<double>(), 0.5, 1e-6);
  EXPECT_LE(r["scroll"].get<int>(), 1280);
  if (!r["picture"].get<bool>()) GTEST_SKIP() << "this browser has no WebGL 2: nothing is drawn";
  EXPECT_TRUE(r["message"].get<bool>());
  EXPECT_GT(r["painted"].get<double>(), 0.05) << "share of the picture that is not background";
}

TEST_F(Viewer, FitsAPhone) {
  const auto r = ask(make(3, false).html, 390, "{w:innerWidth,s:document.documentElement.scrollWidth,stage:document.getElementById('stage').clientHeight}", true);
  ASSERT_TRUE(r.is_object());
  EXPECT_EQ(console_, "");
  EXPECT_EQ(r["w"], 390);
  EXPECT_LE(r["s"].get<int>(), 390);
  EXPECT_GT(r["stage"].get<int>(), 250);
}

TEST_F(Viewer, LeavesFramesOutRatherThanGrowTooLarge) {
  const ViewPage whole = make(40, true);
  EXPECT_EQ(whole.every, 1u);
  ViewOptions small{"A <b>run</b>"};
  small.largest = whole.html.size() - 1;
  const ViewPage thinned = make(40, true, small);
  EXPECT_GT(thinned.every, 1u);
  EXPECT_LT(thinned.html.size(), whole.html.size());
  EXPECT_NE(thinned.html.find("The result file has all."), std::string::npos);
}

}  // namespace
}  // namespace terrode::report
