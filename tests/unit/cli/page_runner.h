// Does what a page of the documentation says, in order, in a folder of its own: writes the files that it shows, runs the
// commands in its code blocks, and holds what they print against what the page says they print.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

namespace terrode::docs {

namespace fs = std::filesystem;

struct Block {
  std::string language, file;  // file: what the text before names in backticks, of yaml and csv blocks
  std::vector<std::string> lines;
  int line = 0;
};

inline std::vector<Block> blocks_of(const fs::path& page) {
  std::vector<Block> out;
  std::ifstream in(page);
  std::string named;
  bool code = false;
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    if (line.starts_with("```")) {
      code = !code;
      if (code) {
        out.push_back({line.substr(3), named, {}, number});
        named.clear();
      }
    } else if (code) {
      out.back().lines.push_back(line);
    } else {
      static const std::regex name("`([A-Za-z0-9_/-]+\\.(yaml|csv))`");
      for (auto it = std::sregex_iterator(line.begin(), line.end(), name); it != std::sregex_iterator(); ++it) named = (*it)[1];
    }
  }
  return out;
}

class PageRunner {
 public:
  PageRunner() : folder_(fs::temp_directory_path() / ("terrode_page_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "bin");
    fs::create_symlink(TERRODE_PROGRAM, folder_ / "bin" / "terrode");
    for (const char* shared : {"scenarios", "recordings"}) fs::create_directory_symlink(fs::path(TERRODE_SOURCE_DIR) / shared, folder_ / shared);
  }
  ~PageRunner() { fs::remove_all(folder_); }

  // Number of commands run. Only lines that begin with `terrode`, or with the `sed` that makes its scenario, are commands; "..." in
  // a printed block stands for any lines.
  int run(const fs::path& page) {
    int commands = 0;
    for (const Block& b : blocks_of(page)) {
      const std::string where = page.filename().string() + ":" + std::to_string(b.line);
      if ((b.language == "yaml" || b.language == "csv") && !b.file.empty()) {
        fs::create_directories((folder_ / b.file).parent_path());
        std::ofstream out(folder_ / b.file);
        for (const std::string& l : b.lines) out << l << "\n";
      } else if (b.language == "sh") {
        for (const std::string& l : b.lines)
          if (l.starts_with("terrode ")) {
            ++commands;
            execute(l, where);
          }
      } else if (b.language == "console") {
        for (std::size_t i = 0; i < b.lines.size();) {
          const std::string command = b.lines[i].starts_with("$ ") ? b.lines[i].substr(2) : "";
          std::vector<std::string> printed;
          for (++i; i < b.lines.size() && !b.lines[i].starts_with("$ "); ++i) printed.push_back(b.lines[i]);
          if (!command.starts_with("terrode ") && !command.starts_with("sed ")) continue;
          ++commands;
          compare(printed, execute(command, where), where + ": " + command);
        }
      }
    }
    return commands;
  }

 private:
  std::string execute(const std::string& command, const std::string& where) {
    std::string out;
    FILE* pipe = popen(("cd " + folder_.string() + " && PATH=" + folder_.string() + "/bin:$PATH " + command + " 2> errors.txt").c_str(), "r");
    std::array<char, 4096> buffer;
    for (std::size_t n; (n = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) out.append(buffer.data(), n);
    const int status = pclose(pipe);
    std::ifstream errors(folder_ / "errors.txt");
    EXPECT_EQ(status, 0) << where << ": " << command << "\n" << std::string(std::istreambuf_iterator<char>(errors), {});
    return out;
  }

  static void compare(const std::vector<std::string>& wanted, const std::string& text, const std::string& where) {
    std::vector<std::string> got;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) got.push_back(line);
    std::size_t g = 0;
    for (std::size_t w = 0; w < wanted.size(); ++w) {
      if (wanted[w] == "...") {
        if (w + 1 == wanted.size()) return;
        while (g < got.size() && got[g] != wanted[w + 1]) ++g;
        continue;
      }
      ASSERT_LT(g, got.size()) << where << "\nprints too little; next should be: " << wanted[w];
      EXPECT_EQ(got[g], wanted[w]) << where;
      ++g;
    }
    EXPECT_EQ(g, got.size()) << where << "\nprints more than the page shows: " << (g < got.size() ? got[g] : "");
  }

  fs::path folder_;
};

}  // namespace terrode::docs
