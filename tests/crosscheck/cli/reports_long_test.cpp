// Screenshots of every kind of report, at the width of a phone and of a desktop, light and dark, to look at:
// build/screenshots/. Each is a picture with something on it.
#include "../report/chromium.h"
#include "report_pages.h"

namespace terrode::cli {
namespace {

class Screenshots : public report::Browser {};

TEST_F(Screenshots, NoReportScrollsSidewaysOnAPhone) {
  for (const auto& [name, page] : make_reports(folder_, true)) {
    const auto r = ask(page.html, 390, "{inner:innerWidth,scroll:document.documentElement.scrollWidth}");
    ASSERT_TRUE(r.is_object()) << name;
    EXPECT_EQ(console_, "") << name;
    EXPECT_EQ(r["inner"], 390) << name;
    EXPECT_LE(r["scroll"].get<int>(), 390) << name;
  }
}

TEST_F(Screenshots, OfEveryReport) {
  namespace fs = std::filesystem;
  const fs::path pictures = fs::path(TERRODE_BINARY_DIR) / "screenshots";
  fs::create_directories(pictures);
  for (const auto& [name, page] : make_reports(folder_, true))
    for (const int width : {390, 1280})
      for (const bool dark : {false, true}) {
        if (dark && width == 390) continue;
        std::string html = page.html;
        if (dark) html.replace(html.find("<html"), 5, "<html data-theme=\"dark\"");
        // A window cannot be made narrower than 500 pixels, a frame can.
        if (width < 500)
          html = "<!doctype html><body style=\"margin:0\"><iframe style=\"border:0;height:2400px;width:390px\" srcdoc=\"" + report::escape(html) + "\"></iframe>";
        const fs::path file = folder_ / "page.html";
        std::ofstream(file) << html;
        const fs::path picture = pictures / (name + "-" + std::to_string(width) + (dark ? "-dark" : "") + ".png");
        fs::remove(picture);
        output_of(chromium() + " --headless --no-sandbox --disable-gpu --no-first-run --disable-background-networking --virtual-time-budget=4000 --hide-scrollbars"
                  " --user-data-dir=" + (folder_ / "profile").string() + " --window-size=" + std::to_string(width) + ",2400 --screenshot=" + picture.string() +
                  " file://" + file.string() + " 2>&1");
        ASSERT_TRUE(fs::exists(picture)) << picture;
        // An empty page of this size is a PNG of about 10 kB.
        EXPECT_GT(fs::file_size(picture), 30000u) << picture;
      }
}

}  // namespace
}  // namespace terrode::cli
