// Links of README.md and docs/: every relative target exists, and so does the heading that it names.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

namespace {

namespace fs = std::filesystem;

const fs::path kRoot = TERRODE_SOURCE_DIR;

std::vector<fs::path> pages() {
  std::vector<fs::path> out = {kRoot / "README.md"};
  for (const auto& e : fs::recursive_directory_iterator(kRoot / "docs"))
    if (e.path().extension() == ".md") out.push_back(e.path());
  return out;
}

// The text without code: what stands in backticks is no link.
std::string prose(const fs::path& page) {
  std::ifstream in(page);
  std::string out;
  bool code = false;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("```")) code = !code;
    else if (!code) out += std::regex_replace(line, std::regex("`[^`]*`"), "") + "\n";
  }
  return out;
}

// As Markdown renderers name headings: lower case, words joined by "-", other signs dropped.
std::set<std::string> anchors(const fs::path& page) {
  std::set<std::string> out;
  std::ifstream in(page);
  bool code = false;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("```")) code = !code;
    if (code || !line.starts_with("#")) continue;
    std::string name;
    for (const char c : line.substr(std::min(line.find_first_not_of("# "), line.size())))
      if (std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-') name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      else if (c == ' ') name += '-';
    out.insert(name);
  }
  return out;
}

TEST(Docs, LinksLeadSomewhere) {
  const std::regex link("\\]\\(([^)\\s]+)\\)");
  size_t checked = 0;
  for (const fs::path& page : pages()) {
    const std::string text = prose(page);
    for (auto it = std::sregex_iterator(text.begin(), text.end(), link); it != std::sregex_iterator(); ++it) {
      std::string target = (*it)[1];
      if (target.starts_with("http://") || target.starts_with("https://") || target.starts_with("mailto:")) continue;
      ++checked;
      const auto hash = target.find('#');
      const std::string heading = hash == std::string::npos ? "" : target.substr(hash + 1);
      const fs::path file = hash == 0 ? page : page.parent_path() / target.substr(0, hash);
      EXPECT_TRUE(fs::exists(file)) << fs::relative(page, kRoot) << " links to " << target;
      if (!heading.empty() && fs::exists(file)) {
        EXPECT_TRUE(anchors(file).contains(heading)) << fs::relative(page, kRoot) << " links to " << target;
      }
    }
  }
  EXPECT_GT(checked, 10u);
}

TEST(Docs, FilesNamedInCodeExist) {
  // `src/report/page.h`, `scenarios/ding2011.yaml`: names in backticks that begin with a folder of the repository.
  const std::regex name("`((src|tests|tools|cmake|web|docs|scenarios|examples|bench)/[A-Za-z0-9_./-]+)`");
  for (const fs::path& page : pages()) {
    std::ifstream in(page);
    std::stringstream text;
    text << in.rdbuf();
    const std::string all = text.str();
    for (auto it = std::sregex_iterator(all.begin(), all.end(), name); it != std::sregex_iterator(); ++it) {
      const std::string file = (*it)[1];
      EXPECT_TRUE(fs::exists(kRoot / file)) << fs::relative(page, kRoot) << " names " << file;
    }
  }
}

}  // namespace
