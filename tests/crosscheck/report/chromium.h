// Opens pages in headless Chromium and asks them questions.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "report/svg.h"

namespace terrode::report {

class Browser : public testing::Test {
 protected:
  static std::string output_of(const std::string& command) {
    std::string out;
    FILE* pipe = popen(command.c_str(), "r");
    if (!pipe) return out;
    std::array<char, 65536> buffer;
    for (size_t n; (n = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) out.append(buffer.data(), n);
    pclose(pipe);
    return out;
  }
  static std::string chromium() {
    std::string path = output_of("command -v chromium || command -v chromium-browser || true");
    while (!path.empty() && path.back() == '\n') path.pop_back();
    return path;
  }
  void SetUp() override {
    if (chromium().empty()) GTEST_SKIP() << "chromium is not installed: the pages are not opened in a browser";
    folder_ = std::filesystem::temp_directory_path() /
              ("terrode-browser-" + std::to_string(getpid()) + "-" + testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override {
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
  }

  // Opens the page at a width, runs `script` (an expression) in it once <html data-ready> is there and returns its
  // value. Messages on the console go to console_. `software_gl`: three dimensions drawn by the processor.
  nlohmann::json ask(const std::string& html, int width, const std::string& script, bool software_gl = false) {
    namespace fs = std::filesystem;
    const std::string probe =
        "<script>addEventListener('load',()=>{const wait=setInterval(()=>{if(!document.documentElement.dataset.ready)return;clearInterval(wait);"
        "setTimeout(()=>{const p=document.createElement('pre');p.id='probe';p.hidden=true;"
        "p.textContent='@'+encodeURIComponent(JSON.stringify(" + script + "))+'@';parent.document.body.append(p);},300)},50)});</script></body>";
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
        chromium() + " --headless --no-sandbox --disable-quic --no-first-run --disable-background-networking --disable-component-update --disable-sync" +
        (software_gl ? " --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader" : " --disable-gpu") +
        " --enable-logging=stderr --virtual-time-budget=20000 --user-data-dir=" + profile.string() + " --hide-scrollbars --window-size=" +
        std::to_string(std::max(width, 500)) + ",900 --dump-dom file://" + file.string() + " 2>" + errors.string());
    std::ifstream in(errors);
    console_.clear();
    for (std::string line; std::getline(in, line);)
      // The driver remarks on pixels that only this test reads.
      if (line.find("CONSOLE") != std::string::npos && line.find("GL Driver Message (OpenGL, Performance") == std::string::npos)
        console_ += line + "\n";
    const size_t from = dom.find(">@");
    if (from == std::string::npos) {
      ADD_FAILURE() << "the page did not answer\n" << console_;
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

  std::filesystem::path folder_;
  std::string console_;
};

}  // namespace terrode::report
