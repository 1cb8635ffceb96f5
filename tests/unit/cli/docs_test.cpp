// Commands that README.md and docs/ show: they exist, and so do their options.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>
#include <sstream>

namespace {

namespace fs = std::filesystem;

std::string output_of(const std::string& command) {
  std::string out;
  FILE* pipe = popen(command.c_str(), "r");
  std::array<char, 4096> buffer;
  for (size_t n; (n = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) out.append(buffer.data(), n);
  return pclose(pipe) == 0 ? out : std::string();
}

TEST(Docs, CommandsAndOptionsExist) {
  const fs::path root = TERRODE_SOURCE_DIR;
  std::vector<fs::path> pages = {root / "README.md"};
  for (const auto& e : fs::recursive_directory_iterator(root / "docs"))
    if (e.path().extension() == ".md") pages.push_back(e.path());
  std::map<std::string, std::string> help;
  size_t checked = 0;
  for (const fs::path& page : pages) {
    std::ifstream in(page);
    bool code = false;
    std::string whole;
    for (std::string line; std::getline(in, line);) {
      if (line.starts_with("```")) code = !code;
      if (!code) continue;
      if (line.starts_with("$ ")) line = line.substr(2);
      if (line.ends_with("\\")) {
        whole += line.substr(0, line.size() - 1) + " ";
        continue;
      }
      whole += line;
      std::istringstream words(whole);
      std::string program, command;
      words >> program >> command;
      const std::string shown = std::exchange(whole, {});
      if ((program != "terrode" && program != "build/terrode") || command.empty() || command[0] == '-') continue;
      ++checked;
      if (!help.contains(command)) help[command] = output_of(fmt::format("{} {} --help 2>/dev/null", TERRODE_PROGRAM, command));
      const fs::path where = fs::relative(page, root);
      if (help[command].empty()) {
        ADD_FAILURE() << where << " shows a command that does not exist: " << shown;
        continue;
      }
      for (std::string word; words >> word;)
        if (word.starts_with("--") && word.size() > 2) {
          EXPECT_NE(help[command].find(word.substr(0, word.find('='))), std::string::npos) << where << ": " << shown;
        }
    }
  }
  EXPECT_GT(checked, 3u);
}

}  // namespace
